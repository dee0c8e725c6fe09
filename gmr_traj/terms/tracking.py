"""Key bodies stay near where the target has them: position and orientation in the world.

    phi_t = trust_t sum_b [ k_b rho(|p_b - p*_b|) / position^2 + l_b (3 - tr(R*_b' R_b)) / (2 orientation^2) ] dt

with the pseudo-Huber function ``rho(e) = s^2 (sqrt(1 + e^2 / s^2) - 1)``, quadratic up to about s = ``robust``, and
the robot's relative weights k_b, l_b.  The target is the clip, or, where the clip brings them along, the source's
targets fitted to it (:mod:`~gmr_traj.misfit`).  A frame in which the clip cannot be trusted (a jump, the transient of
the first frames) counts less, so that the smoothness terms carry the motion across it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.kinematics.casadi_kinematics import CasadiKinematics
from gmr_traj.residuals import FrameResidual, GaussNewton, Residual
from gmr_traj.terms.composite import CompositeCost
from gmr_traj.terms.context import Context
from gmr_traj.terms.term import Term
from gmr_traj.variables import Variables


@dataclass(frozen=True)
class Tracking(Term):
    """Fields: scales of the deviation, ``position`` [m] and ``orientation`` [rad]; ``robust`` [m], see above.

    ``source_weight`` is the trust put into targets that come from the source, a human: they have none of the faults of
    a retargeted clip, so it may be more than 1.
    """

    position: float
    orientation: float
    robust: float
    source_weight: float = 1.0

    uses: ClassVar[tuple[str, ...]] = ("cost",)

    def residuals(self, context: Context, variables: Variables) -> list[Residual]:
        """One residual: all key bodies in all frames."""
        keys = context.robot.key_bodies
        count, frames = len(keys), context.frames
        slots = [context.robot.body_names.index(key.body) for key in keys]
        positions, rotations = (of_bodies[:, slots] for of_bodies in context.target_placements)
        trust = np.tile(context.trust[:, None], (1, count))
        points = np.zeros((count, 3))
        source = context.references
        for k, key in enumerate(keys):
            if source is not None and key.body in source.names:
                b = source.names.index(key.body)
                positions[:, k], points[k], trust[:, k] = source.positions[:, b], source.points[b], self.source_weight
                rotations[:, k] = Rotation.from_quat(source.quaternions[:, b], scalar_first=True).as_matrix()
        weight = trust * context.dt
        parameters = np.hstack(
            [
                context.centre.qpos,
                positions.reshape(frames, 3 * count),
                rotations.transpose(0, 1, 3, 2).reshape(frames, 9 * count),
                weight / self.position**2 * [key.position_weight for key in keys],
                weight / self.orientation**2 * [key.orientation_weight for key in keys],
            ]
        ).T
        functions = _functions(context.kinematics, tuple(slots), tuple(map(tuple, points.tolist())), self.robust)
        every = np.arange(frames)
        return [FrameResidual.cost("tracking", "all key bodies", every, variables.steps, parameters, functions)]


@lru_cache(maxsize=8)
def _functions(
    kinematics: CasadiKinematics, slots: tuple[int, ...], points: tuple[tuple[float, ...], ...], robust: float
) -> GaussNewton:
    """Value, gradient and Hessian of one frame's cost."""
    count = len(slots)
    tangent, reference, placements = kinematics.symbols
    at, turned = ca.SX.sym("p", 3, count), ca.SX.sym("R", 9, count)
    at_weight, turned_weight = ca.SX.sym("w", count), ca.SX.sym("u", count)
    parameters = ca.vertcat(reference, ca.vec(at), ca.vec(turned), at_weight, turned_weight)
    cost = CompositeCost(kinematics, tangent, placements)
    for k, (slot, offset) in enumerate(zip(slots, points, strict=True)):
        point = placements.positions[slot]
        if any(offset):
            point = point + placements.rotations[slot] @ ca.DM(list(offset))
        cost.add_point(slot, point, at[:, k], at_weight[k], robust)
        cost.add_rotation(slot, ca.reshape(turned[:, k], 3, 3), turned_weight[k])
    gradient, hessian = cost.derivatives()
    return GaussNewton(tangent, parameters, cost.value, gradient, hessian)
