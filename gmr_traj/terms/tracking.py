"""Key bodies stay near where the target has them: position and orientation in the world.

    phi_t = trust_t sum_b [ k_b rho(|p_b - p*_b|) / position^2 + l_b (3 - tr(R*_b' R_b)) / (2 orientation^2) ] dt

with the pseudo-Huber function ``rho(e) = s^2 (sqrt(1 + e^2 / s^2) - 1)``, quadratic up to about s = ``robust``, and
the robot's relative weights k_b, l_b.  A frame that the target cannot be trusted in (a jump, the transient of the
first frames) counts less, so that the smoothness terms carry the motion across it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import casadi as ca
import numpy as np

from gmr_traj.kinematics.casadi_kinematics import CasadiKinematics
from gmr_traj.residuals import FrameResidual, GaussNewton, Residual
from gmr_traj.terms.composite import CompositeCost
from gmr_traj.terms.context import Context
from gmr_traj.terms.term import Term
from gmr_traj.variables import Variables


@dataclass(frozen=True)
class Tracking(Term):
    """Fields: scales of the deviation, ``position`` [m] and ``orientation`` [rad]; ``robust`` [m], see above.

    ``beside_source`` is the share of the weight that is left where the source's own targets are known (term
    ``source_tracking``): the robot clip is their approximation, with faults.
    """

    position: float
    orientation: float
    robust: float
    beside_source: float = 1.0

    uses: ClassVar[tuple[str, ...]] = ("cost",)

    def residuals(self, context: Context, variables: Variables) -> list[Residual]:
        """One residual: all key bodies in all frames."""
        keys = context.robot.key_bodies
        slots = [context.robot.body_names.index(key.body) for key in keys]
        positions, rotations = context.target_placements
        weight = context.trust * (1.0 if context.references is None else self.beside_source)
        bodies = TrackedBodies(
            slots=tuple(slots),
            points=np.zeros((len(slots), 3)),
            positions=positions[:, slots],
            rotations=rotations[:, slots],
            position_weights=np.outer(weight, [key.position_weight for key in keys]) / self.position**2,
            orientation_weights=np.outer(weight, [key.orientation_weight for key in keys]) / self.orientation**2,
        )
        return [tracking_residual("tracking", context, variables, bodies, self.robust)]


@dataclass(frozen=True)
class TrackedBodies:
    """What is tracked.

    Attributes:
        slots: the bodies, as indices into ``robot.body_names``.  # B
        points: the point of each body, in its frame [m].  # (B, 3)
        positions: where the points should be [m].  # (T, B, 3)
        rotations: how the bodies should be turned.  # (T, B, 3, 3)
        position_weights: [1/m^2].  # (T, B)
        orientation_weights: [1/rad^2].  # (T, B)
    """

    slots: tuple[int, ...]
    points: np.ndarray
    positions: np.ndarray
    rotations: np.ndarray
    position_weights: np.ndarray
    orientation_weights: np.ndarray


def tracking_residual(
    name: str, context: Context, variables: Variables, bodies: TrackedBodies, robust: float
) -> FrameResidual:
    """The cost phi_t above of all frames, as one residual."""
    frames, count = context.frames, len(bodies.slots)
    parameters = np.hstack(
        [
            context.centre.qpos,
            bodies.positions.reshape(frames, 3 * count),
            bodies.rotations.transpose(0, 1, 3, 2).reshape(frames, 9 * count),
            bodies.position_weights * context.dt,
            bodies.orientation_weights * context.dt,
        ]
    ).T
    points = tuple(map(tuple, bodies.points.tolist()))
    functions = _functions(context.kinematics, bodies.slots, points, robust)
    nothing = np.zeros((1, frames))
    return FrameResidual(
        name=name,
        unit="1",
        rows=["all key bodies"],
        frames=np.arange(frames),
        columns=variables.steps,
        parameters=parameters,
        value=functions.value,
        jacobian=None,
        lower=nothing,
        upper=nothing,
        weights=nothing,
        gauss_newton=functions,
    )


@lru_cache(maxsize=8)
def _functions(
    kinematics: CasadiKinematics, slots: tuple[int, ...], points: tuple[tuple[float, ...], ...], robust: float
) -> GaussNewton:
    """Value, gradient and Hessian of one frame's cost."""
    robot, count = kinematics.robot, len(slots)
    tangent = ca.SX.sym("v", kinematics.tangent_size)
    reference = ca.SX.sym("q", 7 + robot.dof)
    at, turned = ca.SX.sym("p", 3, count), ca.SX.sym("R", 9, count)
    at_weight, turned_weight = ca.SX.sym("w", count), ca.SX.sym("u", count)
    parameters = ca.vertcat(reference, ca.vec(at), ca.vec(turned), at_weight, turned_weight)
    placements = kinematics.placements(tangent, reference)
    cost = CompositeCost(kinematics, tangent, placements)
    for k, (slot, offset) in enumerate(zip(slots, points, strict=True)):
        point = placements.positions[slot]
        if any(offset):
            point = point + placements.rotations[slot] @ ca.DM(list(offset))
        cost.add_point(slot, point, at[:, k], at_weight[k], robust)
        cost.add_rotation(slot, ca.reshape(turned[:, k], 3, 3), turned_weight[k])
    gradient, hessian = cost.derivatives()
    names, options = (["z", "p"], ["out"]), {"cse": True}
    return GaussNewton(
        value=ca.Function("tracking_value", [tangent, parameters], [cost.value], *names, options),
        gradient=ca.Function("tracking_gradient", [tangent, parameters], [gradient], *names, options),
        hessian=ca.Function("tracking_hessian", [tangent, parameters], [hessian], *names, options),
    )
