"""Where the bodies of a robot are, as columns of transforms."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.track import Track
from gmr_traj.viewer.paths import part
from gmr_traj.viewer.timelines import Clock

if TYPE_CHECKING:
    import rerun as rr

WORLD = "tf#/world"


def frame_name(track: Track, body: str) -> str:
    """Coordinate frame of a body of one of the robots."""
    return f"{part(track.name)}/{part(body)}"


def base_path(track: Track) -> str:
    """Path of a point at the robot's base, in the world's coordinates: what the eye follows."""
    return f"/world/{part(track.name)}/base"


def log(stream: rr.RecordingStream, track: Track, clock: Clock) -> None:
    """Log the placement of every body in every frame, under ``/tf/<track>/<body>``.

    Geometry is logged once, under ``/world``, in the coordinate frame of its body, so that shapes, meshes and marks
    of one robot can be shown and hidden apart from each other.
    """
    import rerun as rr

    seen = track.observation
    # The eye does not follow shapes, which are logged once in a frame that moves; it follows points that move.
    stream.log(base_path(track), rr.Points3D.from_fields(radii=[0.001]), static=True)
    base = seen.positions[:, 0].astype(np.float32)
    clock.send(stream, base_path(track), track.time, lambda rows: rr.Points3D.columns(positions=base[rows]))
    for b, body in enumerate(track.robot.body_names):
        translation = seen.positions[:, b].astype(np.float32)
        quaternion = Rotation.from_matrix(seen.rotations[:, b]).as_quat().astype(np.float32)  # xyzw
        name = frame_name(track, body)
        clock.send(
            stream, f"/tf/{part(track.name)}/{part(body)}", track.time, placements(translation, quaternion, name)
        )


def placements(
    translation: np.ndarray, quaternion: np.ndarray | None, name: str
) -> Callable[[np.ndarray], rr.ComponentColumnList]:
    """Makes the columns of the placement of frame ``name`` in the world: translation (T, 3), quaternion xyzw (T, 4)."""
    import rerun as rr

    # Both names in every row: with static names and temporal poses the robot collapses at the origin.
    return lambda rows: rr.Transform3D.columns(
        translation=translation[rows],
        quaternion=None if quaternion is None else quaternion[rows],
        parent_frame=[WORLD] * len(rows),
        child_frame=[name] * len(rows),
    )
