"""Forces of the floor on a simulated robot, as arrows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from gmr_traj import colours
from gmr_traj.track import ContactForces, Track
from gmr_traj.viewer.paths import part
from gmr_traj.viewer.timelines import Clock

if TYPE_CHECKING:
    import rerun as rr

METRES_PER_NEWTON = 2.5e-3  # the weight of a G1, 340 N, shared by four points: arrows of a fifth of a metre


def log(stream: rr.RecordingStream, track: Track, forces: ContactForces, clock: Clock) -> None:
    """Log one arrow for each contact point in every frame; forces of zero are arrows of no length."""
    import rerun as rr

    path, count = f"/world/{part(track.name)}/forces", forces.points.shape[1]
    stream.log(path, rr.Arrows3D.from_fields(radii=[0.009], colors=[colours.FORCE]), static=True)
    origins, vectors = forces.points.astype(np.float32), (METRES_PER_NEWTON * forces.forces).astype(np.float32)

    def columns(rows: np.ndarray) -> rr.ComponentColumnList:
        made = rr.Arrows3D.columns(origins=origins[rows].reshape(-1, 3), vectors=vectors[rows].reshape(-1, 3))
        return made.partition([count] * len(rows))

    clock.send(stream, path, track.time, columns)
