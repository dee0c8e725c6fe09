"""Finite differences of the motion: velocity, acceleration, jerk.

    r_t = D^k y_t / dt^k,   y = (base position, base rotation, joints)

with D the forward difference.  Linear in the steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import scipy.sparse as sp

from gmr_traj.residuals import LinearResidual, Residual
from gmr_traj.terms.context import Context
from gmr_traj.terms.term import Term
from gmr_traj.variables import Variables


def difference(frames: int, order: int) -> sp.csr_matrix:
    """The k-th forward difference over time, ``(T - k, T)``; no rows where there are not enough frames."""
    matrix = sp.identity(frames, format="csr")
    for _ in range(order):
        n = matrix.shape[0]
        if n < 2:
            return sp.csr_matrix((0, frames))
        step = sp.diags([-np.ones(n - 1), np.ones(n - 1)], [0, 1], shape=(n - 1, n))
        matrix = (step @ matrix).tocsr()
    return matrix


@dataclass(frozen=True)
class _Smoothness(Term):
    """Fields: scales of the derivative: ``base_position`` [m/s^k], ``base_rotation`` and ``joints`` [rad/s^k]."""

    base_position: float
    base_rotation: float
    joints: float

    uses: ClassVar[tuple[str, ...]] = ("cost",)
    order: ClassVar[int]
    label: ClassVar[str]

    def residuals(self, context: Context, variables: Variables) -> list[Residual]:
        """Three residuals over the whole clip: base position, base rotation, joints."""
        rate = 1.0 / context.dt**self.order
        d = difference(context.frames, self.order) * rate
        if not d.shape[0]:
            return []
        names = ["base x", "base y", "base z", "base roll", "base pitch", "base yaw", *context.robot.joint_names]
        groups = (
            ("base_position", "m", range(3), self.base_position),
            ("base_rotation", "rad", range(3, 6), self.base_rotation),
            ("joints", "rad", range(6, variables.tangent), self.joints),
        )
        out: list[Residual] = []
        for group, unit, members, scale in groups:
            m = len(members) * d.shape[0]
            matrix = sp.vstack(
                [
                    sp.csr_matrix((d.data, variables.steps[d.indices, c], d.indptr), shape=(d.shape[0], variables.size))
                    for c in members
                ]
            ).tocsr()
            out.append(
                LinearResidual(
                    name=f"{self.label}/{group}",
                    unit=f"{unit}/s" + (f"^{self.order}" if self.order > 1 else ""),
                    matrix=matrix,
                    offset=np.concatenate([d @ context.coordinates[:, c] for c in members]),
                    lower=np.zeros(m),
                    upper=np.zeros(m),
                    weights=np.full(m, context.dt / scale**2),
                    frames=np.tile(np.arange(d.shape[0]), len(members)),
                    subjects=np.repeat(np.arange(len(members)), d.shape[0]),
                    rows=[names[c] for c in members],
                )
            )
        return out


@dataclass(frozen=True)
class Velocity(_Smoothness):
    """First differences."""

    order: ClassVar[int] = 1
    label: ClassVar[str] = "velocity"


@dataclass(frozen=True)
class Acceleration(_Smoothness):
    """Second differences."""

    order: ClassVar[int] = 2
    label: ClassVar[str] = "acceleration"


@dataclass(frozen=True)
class Jerk(_Smoothness):
    """Third differences."""

    order: ClassVar[int] = 3
    label: ClassVar[str] = "jerk"
