"""The objective of a program: ``f(x) = 1/2 x'Qx + c'x + c0 + sum_k phi_k(x[cols_k])``.

All linear least squares are folded into the constant Q; every nonlinear cost brings a gradient and a Gauss-Newton
Hessian for the few unknowns it touches, which are added into one sparse matrix.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np
import scipy.sparse as sp

from gmr_traj.assembly import SparseSum, frozen, gather, mapped, nonzeros, to_dm, widen
from gmr_traj.exceptions import ProblemError
from gmr_traj.frame_costs import gauss_newton
from gmr_traj.residuals import FrameResidual, Used


class Objective:
    """One quadratic form for all linear residuals, mapped functions for the others.

    Args:
        size: number of unknowns.
        used: residuals; those that are not costs are passed over.
        slack_linear, slack_quadratic: indices of slacks with the slope and the curvature of what they cost.

    Raises:
        ProblemError: a linear residual with an interval is used as a cost.
    """

    def __init__(
        self,
        size: int,
        used: Sequence[Used],
        slack_linear: Sequence[tuple[np.ndarray, np.ndarray]],
        slack_quadratic: Sequence[tuple[np.ndarray, np.ndarray]],
    ) -> None:
        self.size = size
        matrix, weight, offset = [], [], []
        self.frame_costs = []
        self.constant_linear = np.zeros(size)
        for item in used:
            if item.use != "cost":
                continue
            if isinstance(item.residual, FrameResidual):
                self.frame_costs.append(item.residual)
                continue
            linear = item.residual
            if not np.array_equal(linear.lower, linear.upper):
                raise ProblemError(
                    f"term {linear.name}: an interval on a linear residual can be hard or soft, not a cost"
                )
            matrix.append(linear.matrix)
            weight.append(linear.weights)
            offset.append(linear.offset - linear.lower)
        stacked = widen(matrix, size)
        w = np.concatenate([*weight, np.zeros(0)])
        b = np.concatenate([*offset, np.zeros(0)])
        self.quadratic = (stacked.T @ sp.diags(w) @ stacked).tocsc()
        self.linear = stacked.T @ (w * b)
        self.constant = 0.5 * float(w @ b**2)
        for index, slope in slack_linear:
            np.add.at(self.linear, index, slope)
        diagonal = np.zeros(size)
        for index, curvature in slack_quadratic:
            np.add.at(diagonal, index, curvature)
        self.quadratic = (self.quadratic + sp.diags(diagonal)).tocsc()

    def expressions(self, x: ca.MX) -> tuple[ca.MX, ca.MX, ca.MX]:
        """Objective, gradient and Hessian (upper triangle)."""
        product = to_dm(self.quadratic) @ x
        value = 0.5 * ca.dot(x, product) + ca.dot(ca.DM(self.linear), x) + self.constant
        gradient = product + ca.DM(self.linear)
        hessian_sum = SparseSum((self.size, self.size), upper=True)
        upper = sp.triu(self.quadratic).tocoo()
        hessian_sum.add_constant(upper.row, upper.col, upper.data)
        gradient_sum = SparseSum((self.size, 1))
        for residual in self.frame_costs:
            functions, parameters = gauss_newton(residual)
            count = len(residual.frames)
            z, parameter = gather(x, residual.columns), frozen(parameters)
            value += ca.sum2(mapped(functions.value, count)(z, parameter))
            gradient_sum.add(
                residual.columns.ravel(),
                np.zeros(residual.columns.size, int),
                ca.vec(ca.densify(mapped(functions.gradient, count)(z, parameter))),
            )
            i, j = (np.array(k) for k in functions.hessian.sparsity_out(0).get_triplet())
            hessian_sum.add(
                residual.columns[:, i].ravel(),
                residual.columns[:, j].ravel(),
                nonzeros(mapped(functions.hessian, count)(z, parameter)),
            )
        return value, gradient + gradient_sum.total(), hessian_sum.total()
