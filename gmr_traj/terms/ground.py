"""Nothing goes below the floor: ``r = z - radius >= clearance`` for points of the soles and ends of the capsules.

Rows are built where a visited motion comes within ``near`` of the floor; ``refine`` checks the rest afterwards.  A
clearance just below zero (feet may press half a millimetre into the floor) keeps the rows of feet in stance, which
their anchors hold at zero, from all being active at once.
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

# A foot that tilts far rests on the side of its capsules: rows where they are lower than its sole by more [m].
_LOWER = 0.001


@dataclass(frozen=True)
class Ground(Term):
    """Fields: ``clearance`` [m], ``near`` [m], and ``scale`` of a violation where the term is a cost or soft [m]."""

    clearance: float
    near: float
    scale: float

    uses: ClassVar[tuple[str, ...]] = ("cost", "hard", "soft")

    def residuals(self, context: Context, variables: Variables) -> list[Residual]:
        """One residual a sole and a capsule, over the frames in which it comes near the floor."""
        robot = context.robot
        outlines = {sole.body: sole.outline if len(sole.outline) else sole.points for sole in robot.soles}
        out = [
            self._shape(context, variables, f"{sole.name} sole", sole.body, outlines[sole.body], 0.0)
            for sole in robot.soles
        ]
        for capsule in robot.capsules:
            ends = np.unique(np.stack([capsule.start, capsule.end]), axis=0)
            out.append(
                self._shape(
                    context, variables, capsule.name, capsule.body, ends, capsule.radius, outlines.get(capsule.body)
                )
            )
        return [residual for residual in out if residual is not None]

    def _shape(
        self,
        context: Context,
        variables: Variables,
        name: str,
        body: str,
        points: np.ndarray,
        radius: float,
        sole: np.ndarray | None = None,
    ) -> FrameResidual | None:
        """The rows of some points of a body; where it has a ``sole``, only those that come lower than that."""
        slot = context.robot.body_names.index(body)
        built = np.zeros((context.frames, len(points)), bool)
        for visited in context.visited:
            positions, rotations = visited.placements
            height = positions[:, slot, None, 2] + rotations[:, slot, 2] @ points.T - radius  # (T, m)
            low = height < self.near
            if sole is not None:
                lowest = (positions[:, slot, None, 2] + rotations[:, slot, 2] @ sole.T).min(axis=1, keepdims=True)
                low &= height < lowest - _LOWER
            built |= low
        frames = np.flatnonzero(built.any(axis=1))
        if not frames.size:
            return None
        value, jacobian = _functions(context.kinematics, body, tuple(map(tuple, points.tolist())), radius)
        shape = (len(points), len(frames))
        return FrameResidual(
            name=f"ground/{name}",
            unit="m",
            rows=[f"point {k}" for k in range(len(points))],
            frames=frames,
            columns=variables.steps[frames],
            parameters=context.centre.qpos[frames].T,
            value=value,
            jacobian=jacobian,
            lower=np.where(built[frames].T, self.clearance, -np.inf),
            upper=np.full(shape, np.inf),
            weights=np.full(shape, context.dt / self.scale**2),
        )


@lru_cache(maxsize=256)
def _functions(
    kinematics: CasadiKinematics, body: str, points: tuple[tuple[float, ...], ...], radius: float
) -> tuple[ca.Function, ca.Function]:
    """(step, configuration) -> heights of points of one body less a radius; and their Jacobian."""
    step, reference, placements = kinematics.symbols
    slot = kinematics.robot.body_names.index(body)
    heights = ca.vertcat(
        *[
            placements.positions[slot][2] + placements.rotations[slot][2, :] @ ca.DM(list(point)) - radius
            for point in points
        ]
    )
    options = {"cse": True}
    value = ca.Function("height", [step, reference], [heights], ["z", "p"], ["r"], options)
    jacobian = ca.Function(
        "height_jacobian", [step, reference], [ca.jacobian(heights, step)], ["z", "p"], ["J"], options
    )
    return value, jacobian
