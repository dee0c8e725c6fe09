"""Joint position, velocity and acceleration limits.

    lower <= j_t <= upper,   |D j_t| / dt <= v_max,   |D^2 j_t| / dt^2 <= a_max

Velocity and acceleration rows are only built where the centre motion comes near the limit: a limit that is far from
active changes nothing but the cost of the solve.  ``refine`` checks all of them afterwards and, should one be
violated that was not built, solves again about the result.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import scipy.sparse as sp
from scipy.ndimage import maximum_filter1d

from gmr_traj.residuals import LinearResidual, Residual
from gmr_traj.terms.context import Context
from gmr_traj.terms.smoothness import difference
from gmr_traj.terms.term import Term
from gmr_traj.variables import Variables

# Rows are built within this time of a frame that comes near the limit [s].
_REACH = 0.1


@dataclass(frozen=True)
class JointPosition(Term):
    """Fields: ``margin``, distance kept from the ends of the range [rad]."""

    margin: float

    uses: ClassVar[tuple[str, ...]] = ("hard",)

    def residuals(self, context: Context, variables: Variables) -> list[Residual]:
        """One row a joint and frame: bounds on the tangent steps."""
        columns = variables.steps[:, 6:]
        m, robot = columns.size, context.robot
        middle = 0.5 * (robot.position_lower + robot.position_upper)
        lower = np.minimum(robot.position_lower + self.margin, middle)
        upper = np.maximum(robot.position_upper - self.margin, middle)
        return [
            LinearResidual(
                name="joint_position",
                unit="rad",
                matrix=sp.csr_matrix((np.ones(m), columns.ravel(), np.arange(m + 1)), shape=(m, variables.size)),
                offset=context.centre.qpos[:, 7:].ravel(),
                lower=np.tile(lower, context.frames),
                upper=np.tile(upper, context.frames),
                weights=np.full(m, context.dt),
                frames=np.repeat(np.arange(context.frames), columns.shape[1]),
                subjects=np.tile(np.arange(columns.shape[1]), context.frames),
                rows=robot.joint_names,
            )
        ]


@dataclass(frozen=True)
class _RateLimit(Term):
    """Fields: ``factor``, share of the robot's limit to use; ``near``, share of that from which on rows are built."""

    factor: float
    near: float

    uses: ClassVar[tuple[str, ...]] = ("hard", "soft")
    order: ClassVar[int]
    label: ClassVar[str]

    def complaint(self) -> str:
        """Rows must be built wherever the limit is violated."""
        return "" if self.near <= 1 else f"near is {self.near:g}; above 1, rows that are violated are not built"

    def limit(self, context: Context) -> np.ndarray:
        """The robot's limit [rad/s^k], ``(n,)``."""
        raise NotImplementedError

    def residuals(self, context: Context, variables: Variables) -> list[Residual]:
        """One row a joint and frame that comes near its limit."""
        d = difference(context.frames, self.order) / context.dt**self.order
        if not d.shape[0]:
            return []
        limit = self.factor * self.limit(context)
        values = d @ context.centre.qpos[:, 7:]
        size = 2 * max(1, round(_REACH / context.dt)) + 1
        near = np.zeros(values.shape, bool)
        for visited in context.visited:
            near |= maximum_filter1d(np.abs(d @ visited.motion.qpos[:, 7:]) > self.near * limit, size, axis=0)
        frames, joints = np.nonzero(near)
        m, width = len(frames), self.order + 1
        if not m:
            return []
        stencil = d[:1, :width].toarray().ravel()
        columns = variables.steps[frames[:, None] + np.arange(width), 6 + joints[:, None]]
        return [
            LinearResidual(
                name=self.label,
                unit="rad/s" + (f"^{self.order}" if self.order > 1 else ""),
                matrix=sp.csr_matrix(
                    (np.tile(stencil, m), columns.ravel(), width * np.arange(m + 1)), shape=(m, variables.size)
                ),
                offset=values[frames, joints],
                lower=-limit[joints],
                upper=limit[joints],
                weights=np.full(m, context.dt),
                frames=frames,
                subjects=joints,
                rows=context.robot.joint_names,
            )
        ]


@dataclass(frozen=True)
class JointVelocity(_RateLimit):
    """Joint speed."""

    order: ClassVar[int] = 1
    label: ClassVar[str] = "joint_velocity"

    def limit(self, context: Context) -> np.ndarray:
        """Largest joint speeds [rad/s], ``(n,)``."""
        return context.robot.velocity_limit


@dataclass(frozen=True)
class JointAcceleration(_RateLimit):
    """Joint acceleration."""

    order: ClassVar[int] = 2
    label: ClassVar[str] = "joint_acceleration"

    def limit(self, context: Context) -> np.ndarray:
        """Largest joint accelerations [rad/s^2], ``(n,)``."""
        return context.robot.acceleration_limit
