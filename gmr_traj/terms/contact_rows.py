"""The rows of the contact wrench as constraints: what breaks them is no solution, or one that costs a slack.

    lower <= A_t (F, M)(v_{t-1}, v_t, v_{t+1}) <= upper

As a cost, a row that cannot be kept gives way (:mod:`~gmr_traj.terms.contact_wrench`).  Hard rows do not: where the
contact schedule asks for what the robot cannot do the problem has no solution, and the report says which rows are left.
Soft ones are kept up to slacks s that cost ``1/2 int (s / scale)^2 dt``, however large they are.

The rows of all frames are built: what a refined motion asks of the floor has little to do with what its input, full of
accelerations that no robot has, asked for.  Those of a force need the centre of mass alone, and are a residual of their
own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar

import casadi as ca
import numpy as np

from gmr_traj.constants import GRAVITY
from gmr_traj.kinematics.casadi_kinematics import CasadiKinematics
from gmr_traj.residuals import FrameResidual, Residual
from gmr_traj.terms.centroidal import arguments, around, symbols, wrench
from gmr_traj.terms.contact_wrench import CONE, FAR, ContactWrench, most_edges
from gmr_traj.terms.context import Context
from gmr_traj.terms.stance_support import LEG, leg
from gmr_traj.terms.vertical_moment import COUNT
from gmr_traj.variables import Variables
from gmr_traj.visited import Visited

_CONE_ROWS = ("pressing", "friction -x -y", "friction -x +y", "friction +x -y", "friction +x +y")
_AXES = ("x", "y", "z")
# A row's largest derivatives are brought to about this: with ten times as much a dance of 600 frames does not converge,
# with a fifth of it takes 36 iterations instead of 30.
_LARGEST = 10.0


@dataclass(frozen=True)
class ContactRows(ContactWrench):
    """The fields of :class:`~gmr_traj.terms.contact_wrench.ContactWrench`; ``robust`` has no say here."""

    uses: ClassVar[tuple[str, ...]] = ("hard", "soft")

    def residuals(self, context: Context, variables: Variables) -> list[Residual]:
        """Friction, the zero-moment point, the torques of each leg, and the wrench of flights, where there are such."""
        if context.frames < 3:
            return []
        robot, inner = context.robot, np.arange(1, context.frames - 1)
        origins = context.centre.qpos[:, :3] * [1.0, 1.0, 0.0]
        maps, lower, upper, feet = self._rows(context, origins)
        rows = _Rows(context, variables, origins, feet, maps, lower, upper)
        flies = (lower[:, 0] == 0.0) & (upper[:, 0] == 0.0)
        flight, borne = inner[flies[inner]], inner[~flies[inner]]
        legs = CONE + most_edges(robot)
        edges = [f"edge {k}" for k in range(legs - CONE)]
        found = [
            rows.residual("force", _CONE_ROWS, borne, 0, self.force),
            rows.residual("zero-moment point", edges, borne, CONE, self.moment),
            rows.residual("force in flight", _AXES, flight, 0, self.force),
            rows.residual("moment in flight", _AXES, flight, 3, self.moment),
        ]
        for number, sole in enumerate(robot.soles):
            names = [robot.joint_names[j] for j in leg(robot, sole.body)]
            alone = borne[feet[borne, number, 0] == 1.0]
            found.append(rows.residual(f"torques over {sole.name}", names, alone, legs, self.torque))
        if maps.shape[1] > legs + LEG:
            sides = [f"{sense} {k}" for sense in ("anticlockwise", "clockwise") for k in range(COUNT // 2)]
            found.append(rows.residual("moment about the vertical", sides, borne, legs + LEG, self.vertical))
        return [residual for residual in found if residual is not None]

    def _unexplained(self, context: Context, able: np.ndarray) -> np.ndarray:
        """As the target has it in every pass: a motion that keeps the rows of a flight falls, and gets no new ones."""
        target = Visited(context.robot, context.target)
        return super()._unexplained(replace(context, centre=context.target, visited=(target,)), able)


@dataclass(frozen=True)
class _Rows:
    """All rows of a clip, to make residuals of some of them.

    Attributes:
        context, variables: what they are about.
        origins: points of the floor [m].  # (T, 3)
        feet: see :func:`~gmr_traj.terms.centroidal.wrench`.  # (T, S, FOOT)
        maps: A.  # (T, R, 6)
        lower, upper: bounds, ``FAR`` away where there is none.  # (T, R)
    """

    context: Context
    variables: Variables
    origins: np.ndarray
    feet: np.ndarray
    maps: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    def residual(
        self, name: str, names: Sequence[str], frames: np.ndarray, first: int, scale: float
    ) -> FrameResidual | None:
        """Rows ``first`` to ``first + len(names)`` of some frames; None where none of them has a bound."""
        here = slice(first, first + len(names))
        lower, upper = self.lower[frames, here], self.upper[frames, here]
        frames = frames[((lower > -FAR) | (upper < FAR)).any(axis=1)]
        if not frames.size:
            return None
        context, count = self.context, len(frames)
        per_metre = 1.0 / (GRAVITY * context.dt**2)  # what a derivative of a row is about
        maps = self.maps[frames, here]
        of_force = not maps[:, :, 3:].any()
        maps = maps[:, :, :3] if of_force else maps
        value, jacobian = _functions(context.kinematics, len(names), maps.shape[2])
        lower, upper = self.lower[frames, here].T, self.upper[frames, here].T
        return FrameResidual(
            name=f"contact_wrench/{name}",
            unit="m g" if of_force else "m g m",
            rows=names,
            frames=frames,
            columns=around(self.variables.steps, frames),
            parameters=np.hstack(
                [
                    *arguments(context.centre.qpos, context.dt, frames, self.origins, self.feet),
                    maps.transpose(0, 2, 1).reshape(count, -1),
                ]
            ).T,
            value=value,
            jacobian=jacobian,
            lower=np.where(lower > -FAR, lower, -np.inf),
            upper=np.where(upper < FAR, upper, np.inf),
            weights=np.full((len(names), count), context.dt / scale**2),
            scale=_LARGEST / per_metre,
        )


@lru_cache(maxsize=32)
def _functions(kinematics: CasadiKinematics, count: int, width: int) -> tuple[ca.Function, ca.Function]:
    """(z, p) -> ``A w`` with the first ``width`` numbers of the wrench; and its Jacobian."""
    needed, jacobian = wrench(kinematics)
    z, *given = symbols(kinematics)
    flat = ca.SX.sym("A", count * width)
    A, p = ca.reshape(flat, count, width), ca.vertcat(*given, flat)
    r, J = A @ needed(z, *given)[:width], A @ jacobian(z, *given)[:width, :]
    options = {"cse": True}
    return (
        ca.Function("rows", [z, p], [r], ["z", "p"], ["r"], options),
        ca.Function("rows_jacobian", [z, p], [J], ["z", "p"], ["J"], options),
    )
