"""Key bodies stay near where the source, a scaled human, has them, where the clip brings that along.

The cost is that of :mod:`~gmr_traj.terms.tracking` with the source's targets and relative weights; those are costs that
multiply the error before it is squared, as inverse kinematics has them, so they enter here squared.  Human and robot
are built differently: some targets are out of reach all the time, by centimetres, and the least squares of all of them
decide where the robot is, as in the inverse kinematics.  So ``robust`` is much larger here, and no frame is distrusted:
the jumps are the robot clip's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.residuals import Residual
from gmr_traj.terms.context import Context
from gmr_traj.terms.term import Term
from gmr_traj.terms.tracking import TrackedBodies, tracking_residual
from gmr_traj.variables import Variables


@dataclass(frozen=True)
class SourceTracking(Term):
    """Fields: scales of the deviation, ``position`` [m] and ``orientation`` [rad]; ``robust`` [m], see above."""

    position: float
    orientation: float
    robust: float

    uses: ClassVar[tuple[str, ...]] = ("cost",)

    def residuals(self, context: Context, variables: Variables) -> list[Residual]:
        """One residual: all targets in all frames; none where there are no targets."""
        targets = context.references
        if targets is None:
            return []
        known = [k for k, name in enumerate(targets.names) if name in context.robot.body_names]
        rotation = Rotation.from_quat(targets.quaternions[:, known].reshape(-1, 4), scalar_first=True)
        frames = np.ones(context.frames)
        bodies = TrackedBodies(
            slots=tuple(context.robot.body_names.index(targets.names[k]) for k in known),
            points=targets.points[known],
            positions=targets.positions[:, known],
            rotations=rotation.as_matrix().reshape(context.frames, len(known), 3, 3),
            position_weights=np.outer(frames, targets.position_weights[known] ** 2) / self.position**2,
            orientation_weights=np.outer(frames, targets.orientation_weights[known] ** 2) / self.orientation**2,
        )
        return [tracking_residual("source_tracking", context, variables, bodies, self.robust)]
