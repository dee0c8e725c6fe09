"""A formulation in numbers: values, derivatives and the condensed matrix of the interior-point method.

    A(x, sigma) = H(x) + J(x)' diag(sigma_rows) J(x) + diag(sigma_unknowns)

is symmetric, positive definite and as narrow as the residuals: a row of J is about a few neighbouring frames.  H is
the objective's Gauss-Newton model; the curvature of constraints is left out.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from gmr_traj.assembly import widen
from gmr_traj.band.blocks import Cost, Rows
from gmr_traj.band.cholesky import BlockCholesky
from gmr_traj.band.ordering import as_numbers, order
from gmr_traj.formulation import Formulation
from gmr_traj.residuals import LinearResidual


class Program:
    """A formulation, ready to be evaluated at many points.

    Attributes:
        size, rows: number of unknowns and of constraint rows.
        initial, lower, upper: starting values and bounds of the unknowns.  # (nx,)
        row_lower, row_upper: bounds of the rows.  # (m,)
        jacobian: J at the point of the last evaluation.  # (m, nx)
        factor: of A, after :meth:`condense`.
    """

    def __init__(self, formulation: Formulation) -> None:
        rows, costs = formulation.constraints, formulation.objective
        self.size = formulation.variables.size
        self.initial, self.lower, self.upper = formulation.initial, formulation.lower, formulation.upper
        self.row_lower, self.row_upper = rows.lower, rows.upper
        self.rows = len(rows.lower)
        self._costs = [Cost(residual) for residual in costs.frame_costs]
        self._quadratic, self._linear, self._constant = costs.quadratic.tocsr(), costs.linear, costs.constant
        self._blocks: list[Rows] = []
        fixed: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = [(np.zeros(0, int), np.zeros(0, int), np.zeros(0))]
        first = 0
        for block in rows.blocks:
            if isinstance(block.residual, LinearResidual):
                wide = widen([block.residual.matrix[block.kept]], self.size)
                matrix = (sp.diags_array(block.scale) @ wide).tocoo()
                fixed.append((first + matrix.row, matrix.col, matrix.data))
            else:
                self._blocks.append(Rows(block, first))
            fixed.append((first + block.slack_row, block.slack, block.slack_sign * block.scale[block.slack_row]))
            first += block.kept.size
        at_row, at_column, value = (np.concatenate([part[k] for part in fixed]) for k in range(3))
        self._fixed = sp.csr_array((value, (at_row, at_column)), shape=(self.rows, self.size))
        self._lay_out_jacobian()
        self._lay_out_matrix(formulation)

    def _lay_out_jacobian(self) -> None:
        constant = self._fixed.tocoo()
        rows = np.concatenate([constant.row, *(block.jacobian_at[0] for block in self._blocks)]).astype(np.int64)
        columns = np.concatenate([constant.col, *(block.jacobian_at[1] for block in self._blocks)]).astype(np.int64)
        self._entries = np.argsort(rows * self.size + columns)
        start = np.searchsorted(rows[self._entries], np.arange(self.rows + 1))
        data = np.zeros(len(rows))
        self.jacobian = sp.csr_array((data, columns[self._entries], start), shape=(self.rows, self.size))

    def _lay_out_matrix(self, formulation: Formulation) -> None:
        """Where the shares of A belong, in the order in which :meth:`condense` adds them."""
        n, variables = self.size, formulation.variables
        upper = sp.triu(self._quadratic).tocoo()
        self._quadratic_entries = upper.data
        one, other, row, product = _products(self._fixed)
        entries, which = np.unique(np.maximum(one, other) * n + np.minimum(one, other), return_inverse=True)
        self._fixed_products = sp.csr_array((product, (which, row)), shape=(len(entries), self.rows))
        shares = [(upper.row.astype(np.int64), upper.col.astype(np.int64))]
        shares += [cost.hessian_at for cost in self._costs]
        shares += [at for block in self._blocks for at in (block.inner_at, block.slack_at)]
        shares += [(entries // n, entries % n), (np.arange(n), np.arange(n))]
        frames = np.full(n, -1)
        frames[variables.steps] = np.arange(variables.frames)[:, None]
        couplings = as_numbers(shares)
        self.factor = BlockCholesky(order(frames, couplings), n, couplings)
        ends = np.cumsum([len(i) for i, _ in shares])
        self._values = np.zeros(ends[-1])
        self._shares = np.split(self._values, ends[:-1])

    def at(self, x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        """Objective, gradient and constraint rows; derivatives are kept.

        Args:
            x: the unknowns.  # (nx,)
        """
        product = self._quadratic @ x
        value = 0.5 * float(x @ product) + float(self._linear @ x) + self._constant
        gradient = product + self._linear
        for cost in self._costs:
            value += cost.at(x)
            gradient += np.bincount(cost.gradient_at, cost.gradient, self.size)
        rows = self._fixed @ x
        entries = [self._fixed.data]
        for block in self._blocks:
            values, jacobian = block.at(x)
            rows[block.span] += values
            entries.append(jacobian)
        np.take(np.concatenate(entries), self._entries, out=self.jacobian.data)
        return value, gradient, rows

    def condense(self, sigma_unknowns: np.ndarray, sigma_rows: np.ndarray, right: np.ndarray) -> bool:
        """Factor A at the point of the last evaluation; whether it is positive definite.

        Args:
            sigma_unknowns: weights of the unknowns.  # (nx,)
            sigma_rows: weights of the rows.  # (m,)
            right: the first right-hand side that will be asked for.  # (nx,)
        """
        shares = iter(self._shares)
        next(shares)[:] = self._quadratic_entries
        for cost in self._costs:
            cost.hessian(next(shares))
        for block in self._blocks:
            for values in block.products(sigma_rows[block.span]):
                next(shares)[:] = values
        next(shares)[:] = self._fixed_products @ sigma_rows
        next(shares)[:] = sigma_unknowns
        return self.factor.factor(self._values, right)


def _products(matrix: sp.csr_array) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Pairs of entries of the same row, each once: their columns, the row, and the product of their values."""
    counts = np.diff(matrix.indptr)
    found: list[tuple[np.ndarray, ...]] = [(np.zeros(0, np.int64),) * 3 + (np.zeros(0),)]
    for width in np.unique(counts[counts > 0]):
        rows = np.flatnonzero(counts == width)
        entry = matrix.indptr[rows].astype(np.int64)[:, None] + np.arange(width)
        a, b = np.tril_indices(width)
        columns, values = matrix.indices[entry].astype(np.int64), matrix.data[entry]
        products = values[:, a] * values[:, b]
        found.append((columns[:, a].ravel(), columns[:, b].ravel(), np.repeat(rows, len(a)), products.ravel()))
    one, other, row, product = (np.concatenate([part[k] for part in found]) for k in range(4))
    return one, other, row, product
