"""Pictures of a robot in the frames of a clip."""

from __future__ import annotations

from contextlib import ExitStack
from types import TracebackType

import mujoco
import numpy as np

from gmr_traj.metrics.figures import DEEP
from gmr_traj.render.look import Look
from gmr_traj.render.offscreen import Offscreen
from gmr_traj.render.stage import build
from gmr_traj.track import Track


class Painter:
    """Draws the frames of one clip; to be used in a ``with`` block.

    What overlaps by more than a millimetre is red, by the same measure as in the certificate.

    Args:
        track: the clip.
        look: size of the pictures and camera.

    Raises:
        DrawingError: there is no driver to draw with.
    """

    def __init__(self, track: Track, look: Look) -> None:
        self._track, self._look = track, look
        self._stage = build(track.robot, look.meshes, (look.width, look.height))
        self._data = mujoco.MjData(self._stage.model)
        self._stack = ExitStack()
        self._screen = self._stack.enter_context(Offscreen(self._stage.model, look.width, look.height))

    def draw(self, frame: int, centre: np.ndarray, heading: float) -> np.ndarray:
        """One frame.

        Args:
            frame: which.
            centre: what the camera looks at, from above [m].  # (2,)
            heading: direction that the camera's azimuth counts from [rad].

        Returns:
            The picture.  # (height, width, 3) uint8
        """
        seen = self._track.observation
        self._stage.place(self._data, seen.positions[frame], seen.rotations[frame], overlapping(self._track, frame))
        return self._screen.draw(self._data, self._look.camera(self._track, centre, heading))

    def __enter__(self) -> Painter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._stack.close()


def overlapping(track: Track, frame: int) -> set[int]:
    """Collision shapes that reach more than a millimetre into another in a frame."""
    found = track.observation.overlaps
    deep = (found.frame == frame) & (found.depth > DEEP)
    return {shape for pair in found.pair[deep] for shape in track.robot.collision_pairs[pair]}
