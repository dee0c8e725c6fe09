"""A sole point in stance stays where it came down.

For every stance s of a sole point k there is one free anchor a_s on the floor, and in all its frames

    r = (p_k - (a_s, 0)) = 0.

Tying each frame to the one before instead would let the foot creep.  Several points of one rigid sole over-determine
its placement (four corners: 12 equations, 6 + 8 unknowns with their anchors), so this is a stiff cost, consistent
because the anchors are free, and not a hard constraint, whose rows would be dependent.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import casadi as ca
import numpy as np

from gmr_traj.kinematics.casadi_kinematics import CasadiKinematics
from gmr_traj.residuals import FrameResidual, Residual
from gmr_traj.terms.context import Context
from gmr_traj.terms.term import Term
from gmr_traj.variables import Variables


@dataclass(frozen=True)
class StanceAnchor(Term):
    """Fields: ``horizontal`` and ``vertical``, scales of a point's distance from its anchor and from the floor [m]."""

    horizontal: float
    vertical: float

    uses: ClassVar[tuple[str, ...]] = ("cost",)

    def residuals(self, context: Context, variables: Variables) -> list[Residual]:
        """One residual a sole, over the frames in which any of its points is in stance; adds the anchors."""
        positions, rotations = context.placements
        out: list[Residual] = []
        for sole in context.robot.soles:
            stances = [s for s in context.schedule.stances if s.sole == sole.name]
            slot = context.robot.body_names.index(sole.body)
            points = positions[:, slot, None] + np.einsum("tij,kj->tki", rotations[:, slot], sole.points)
            anchor = np.full((context.frames, len(sole.points), 2), -1)
            for stance in stances:
                during = slice(stance.start, stance.stop)
                start = points[during, stance.point, :2].mean(axis=0)  # the best anchor for feet that stay put
                anchor[during, stance.point] = variables.add(start)
            resting = anchor[:, :, 0] >= 0  # (T, K)
            frames = np.flatnonzero(resting.any(axis=1))
            if not frames.size:
                continue
            # A point in swing has weight zero; naming an anchor of its sole there keeps the Hessian as sparse as it is.
            some = anchor[frames, resting[frames].argmax(axis=1)]
            anchors = np.where(resting[frames][:, :, None], anchor[frames], some[:, None])
            scale = np.tile([self.horizontal, self.horizontal, self.vertical], len(sole.points))
            on = np.repeat(resting[frames], 3, axis=1).T
            value, jacobian = _functions(context.kinematics, sole.name)
            zero = np.zeros((3 * len(sole.points), len(frames)))
            out.append(
                FrameResidual(
                    name=f"stance/{sole.name}",
                    unit="m",
                    rows=[f"{part} {k} {axis}" for k, part in enumerate(sole.parts) for axis in "xyz"],
                    frames=frames,
                    columns=np.hstack([variables.steps[frames], anchors.reshape(len(frames), -1)]),
                    parameters=context.centre.qpos[frames].T,
                    value=value,
                    jacobian=jacobian,
                    lower=zero,
                    upper=zero,
                    weights=on * (context.dt / scale**2)[:, None],
                )
            )
        return out


@lru_cache(maxsize=8)
def _functions(kinematics: CasadiKinematics, name: str) -> tuple[ca.Function, ca.Function]:
    """(step and anchors, configuration) -> point errors; and their Jacobian."""
    robot = kinematics.robot
    sole = next(s for s in robot.soles if s.name == name)
    count = len(sole.points)
    z = ca.SX.sym("z", kinematics.tangent_size + 2 * count)
    reference = ca.SX.sym("q", 7 + robot.dof)
    placements = kinematics.placements(z[: kinematics.tangent_size], reference)
    slot = robot.body_names.index(sole.body)
    anchors = ca.reshape(z[kinematics.tangent_size :], 2, count)
    errors = ca.vertcat(
        *[
            placements.positions[slot] + placements.rotations[slot] @ ca.DM(point) - ca.vertcat(anchors[:, k], 0)
            for k, point in enumerate(sole.points)
        ]
    )
    options = {"cse": True}
    value = ca.Function("stance", [z, reference], [errors], ["z", "p"], ["r"], options)
    jacobian = ca.Function("stance_jacobian", [z, reference], [ca.jacobian(errors, z)], ["z", "p"], ["J"], options)
    return value, jacobian
