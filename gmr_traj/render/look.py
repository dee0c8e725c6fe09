"""How a robot is looked at."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from gmr_traj.exceptions import GmrTrajError
from gmr_traj.track import Track

_LARGEST = 4096  # pixels that every driver can draw at once


@dataclass(frozen=True)
class Look:
    """Size of the pictures, and where the camera stands.

    Attributes:
        width, height: of one picture [pixels].
        azimuth: direction the camera looks in, from the robot's heading, counterclockwise [deg]; 180 looks it in the
            face.
        elevation: how far it looks up [deg].
        distance: from the robot, relative to its standing base height.
        meshes: whether link meshes are drawn where there are any, or the collision shapes.

    Raises:
        GmrTrajError: a size that cannot be drawn, or a distance that is not positive.
    """

    width: int = 320
    height: int = 380
    azimuth: float = 140.0
    elevation: float = -8.0
    distance: float = 3.0
    meshes: bool = True

    def __post_init__(self) -> None:
        for name in ("width", "height"):
            if not 16 <= getattr(self, name) <= _LARGEST:
                raise GmrTrajError(f"a picture {getattr(self, name)} pixels in {name}: give 16 to {_LARGEST}")
        if not self.distance > 0.0:
            raise GmrTrajError(f"the camera's distance is {self.distance:g}; it must be positive")

    def camera(self, track: Track, centre: np.ndarray, heading: float) -> mujoco.MjvCamera:
        """A camera on a robot.

        Args:
            track: the robot.
            centre: what it stands over; the height is that of its middle, standing.  # (2,)
            heading: direction the robot faces [rad].
        """
        tall = float(track.robot.nominal[2])
        camera = mujoco.MjvCamera()
        camera.lookat[:] = [centre[0], centre[1], 0.8 * tall]
        camera.distance, camera.elevation = self.distance * tall, self.elevation
        camera.azimuth = float(np.degrees(heading)) + self.azimuth
        return camera


def heading(track: Track, frame: int) -> float:
    """Direction the base's x axis points in, seen from above [rad]."""
    x_axis = track.observation.rotations[frame, 0][:, 0]
    return float(np.arctan2(x_axis[1], x_axis[0]))
