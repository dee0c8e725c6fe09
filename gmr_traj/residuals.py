"""What a term contributes to the problem: residuals, written once, whatever use is made of them.

A residual is a vector r(x) with bounds, ``lower <= r <= upper``, and a weight for every row.  The problem file says
what it is used as:

- a *cost*: ``1/2 sum_i w_i e_i^2`` with ``e_i`` the distance of ``r_i`` from ``[lower_i, upper_i]``
  (plain least squares where both bounds are the target);
- a *hard* constraint: ``lower <= r <= upper``;
- a *soft* constraint: ``lower <= r + s <= upper`` with a slack that costs ``w_i (rho |s_i| + s_i^2 / 2)``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
import scipy.sparse as sp


class GaussNewton:
    """A cost with its exact gradient and a positive semidefinite model of its Hessian, as functions of (z, p).

    For costs whose structure gives the Gauss-Newton Hessian cheaper than ``J' W J``.  A function is made when it is
    first asked for: an engine needs either ``joint`` or the others.

    Args:
        z, p: symbols.
        cost: of them.  # (1, 1)
        gradient: its gradient.  # (nz, 1)
        hessian: upper triangle of the model, sparse  # (nz, nz); or its factors S, sparse  # (k, nz), and W,
            symmetric  # (k, k): the model is ``S' W S``, which is cheaper to multiply out in numbers.
    """

    def __init__(self, z: ca.SX, p: ca.SX, cost: ca.SX, gradient: ca.SX, hessian: ca.SX | tuple[ca.SX, ca.SX]) -> None:
        self._inputs = [z, p]
        self._outputs = [cost, gradient]
        self._hessian = hessian
        #: Whether ``joint`` gives S and W instead of the Hessian.
        self.factored = isinstance(hessian, tuple)

    def _function(self, name: str, outputs: list[ca.SX], shared: bool = True) -> ca.Function:
        return ca.Function(name, self._inputs, outputs, {"cse": shared})

    @cached_property
    def value(self) -> ca.Function:
        """(z, p) -> cost."""
        # Has next to nothing in common with itself, and looking for that takes many times the rest.
        return self._function("value", self._outputs[:1], shared=False)

    @cached_property
    def gradient(self) -> ca.Function:
        """(z, p) -> gradient."""
        return self._function("gradient", self._outputs[1:2])

    @cached_property
    def hessian(self) -> ca.Function:
        """(z, p) -> Hessian."""
        if isinstance(self._hessian, tuple):
            s, w = self._hessian
            return self._function("hessian", [ca.sparsify(ca.triu(s.T @ (w @ s)))])
        return self._function("hessian", [self._hessian])

    @cached_property
    def joint(self) -> ca.Function:
        """(z, p) -> cost, gradient, and Hessian or its factors; what they share is computed once."""
        last = list(self._hessian) if isinstance(self._hessian, tuple) else [self._hessian]
        return self._function("joint", [*self._outputs, *last])


@dataclass(frozen=True)
class FrameResidual:
    """The same nonlinear residual in K frames: ``r_k = value(x[columns_k], parameters_k)``.

    Attributes:
        name: of the term, with what it is about (``self_collision/left_hand:torso``).
        unit: of the rows, e.g. ``m``.
        rows: a name for every row.  # m
        frames: the frame each column of the arrays below belongs to.  # (K,)
        columns: indices into the variables.  # (K, nz)
        parameters: constants of each frame.  # (np, K)
        value: (z, p) -> r.  # (m,)
        jacobian: (z, p) -> dr/dz, sparse.  # (m, nz)
        lower, upper: bounds; rows with no finite bound in a frame do not exist there.  # (m, K)
        weights: weight of each row [1 / unit^2].  # (m, K)
        gauss_newton: replaces ``value`` and ``jacobian`` where the residual is used as a cost.
        scale: factor of the rows where they are constraints: it brings large derivatives to those of other rows.
    """

    name: str
    unit: str
    rows: Sequence[str]
    frames: np.ndarray
    columns: np.ndarray
    parameters: np.ndarray
    value: ca.Function
    jacobian: ca.Function | None
    lower: np.ndarray
    upper: np.ndarray
    weights: np.ndarray
    gauss_newton: GaussNewton | None = None
    scale: float = 1.0

    @classmethod
    def cost(
        cls, name: str, row: str, frames: np.ndarray, columns: np.ndarray, parameters: np.ndarray, model: GaussNewton
    ) -> FrameResidual:
        """A residual that can only be a cost, with a model of its own: one row, without bounds or weight.

        Args:
            name: of the term.
            row: what the row is about.
            frames: as above.  # (K,)
            columns: as above.  # (K, nz)
            parameters: as above.  # (np, K)
            model: the cost.
        """
        nothing = np.zeros((1, len(frames)))
        return cls(
            name=name,
            unit="1",
            rows=[row],
            frames=frames,
            columns=columns,
            parameters=parameters,
            value=model.value,
            jacobian=None,
            lower=nothing,
            upper=nothing,
            weights=nothing,
            gauss_newton=model,
        )


@dataclass(frozen=True)
class LinearResidual:
    """``r = A x + b`` with sparse A over the whole clip.

    Attributes:
        name, unit: as for :class:`FrameResidual`.
        matrix: A.  # (m, nx)
        offset: b.  # (m,)
        lower, upper: bounds.  # (m,)
        weights: weight of each row [1 / unit^2].  # (m,)
        frames: the frame each row is named after.  # (m,)
        subjects: what each row is about, an index into ``rows``.  # (m,)
        rows: names the subjects.
    """

    name: str
    unit: str
    matrix: sp.csr_matrix
    offset: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    weights: np.ndarray
    frames: np.ndarray
    subjects: np.ndarray
    rows: Sequence[str]


Residual = FrameResidual | LinearResidual


@dataclass(frozen=True)
class Used:
    """A residual and what the problem uses it as: ``cost``, ``hard`` or ``soft``."""

    residual: Residual
    use: str


def exceedance(values: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Distance of each value from its interval: ``max(0, lower - r) + max(0, r - upper)``."""
    return np.maximum(0.0, lower - values) + np.maximum(0.0, values - upper)
