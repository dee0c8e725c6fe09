"""From residuals and the uses made of them to one sparse nonlinear program.

    min  f(x) = 1/2 x'Qx + c'x + c0 + sum_k phi_k(x[cols_k])    s.t.  l <= g(x) <= u,  lx <= x <= ux

All linear least squares are folded into the constant Q; every nonlinear cost brings a gradient and a Gauss-Newton
Hessian for the few unknowns it touches, which are added into one sparse matrix.  The curvature of constraints is left
out, so the Hessian is positive semidefinite by construction and never needs to be convexified.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
import scipy.sparse as sp

from gmr_traj.assembly import SparseSum, frozen, to_dm
from gmr_traj.exceptions import ProblemError
from gmr_traj.frame_costs import gauss_newton
from gmr_traj.residuals import FrameResidual, LinearResidual, Residual
from gmr_traj.variables import Variables

# A soft row's slack costs w (rho |s| + s^2 / 2): rho [in the row's unit] makes small violations cost, too.
SOFT_SLOPE = 1e-3


@dataclass(frozen=True)
class Used:
    """A residual and what the problem uses it as: ``cost``, ``hard`` or ``soft``."""

    residual: Residual
    use: str


@dataclass(frozen=True)
class Nlp:
    """A nonlinear program in the form Ipopt wants, all derivatives given.

    Attributes:
        problem: ``x``, ``p`` (empty), ``f`` and ``g`` as CasADi expressions.
        gradient: (x, p) -> (f, grad f).
        jacobian: (x, p) -> (g, dg/dx).
        hessian: (x, p, lam_f, lam_g) -> upper triangle of lam_f times the Gauss-Newton Hessian.
        initial, lower, upper: starting values and bounds of x.  # (nx,)
        row_lower, row_upper: bounds of g.  # (m,)
    """

    problem: dict[str, ca.MX]
    gradient: ca.Function
    jacobian: ca.Function
    hessian: ca.Function
    initial: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    row_lower: np.ndarray
    row_upper: np.ndarray


def transcribe(variables: Variables, used: Sequence[Used]) -> Nlp:
    """Assemble the program.

    Unknowns that are held stay where they are held, whatever bounds the constraints ask of them, and constraint rows
    about nothing but held unknowns are left out: no solution could change them, and a rounding error in what is held
    would leave the program without one.

    Raises:
        ProblemError: on a use a residual cannot have.
    """
    rows = _Rows(variables, used)
    costs = _Costs(variables.size, used, rows.slack_linear, rows.slack_quadratic)
    x, p = ca.MX.sym("x", variables.size), ca.MX.sym("p", 0)
    value, gradient, hessian = costs.expressions(x)
    g, jacobian = rows.expressions(x)
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", g.numel())
    lower, upper = variables.bounds()
    np.maximum.at(lower, rows.bound_index, rows.bound_lower)
    np.minimum.at(upper, rows.bound_index, rows.bound_upper)
    crossed = np.flatnonzero(lower > upper)
    if crossed.size:
        raise ProblemError(
            f"hard constraints leave no value to unknown {crossed[0]}: it must be at least {lower[crossed[0]]:g} and "
            f"at most {upper[crossed[0]]:g} ({crossed.size} such unknowns)"
        )
    return Nlp(
        problem={"x": x, "p": p, "f": value, "g": g},
        gradient=ca.Function("grad_f", [x, p], [value, gradient], ["x", "p"], ["f", "grad_f_x"]),
        jacobian=ca.Function("jac_g", [x, p], [g, jacobian], ["x", "p"], ["g", "jac_g_x"]),
        hessian=ca.Function(
            "hess_lag",
            [x, p, lam_f, lam_g],
            [lam_f * hessian],
            ["x", "p", "lam_f", "lam_g"],
            ["triu_hess_gamma_x_x"],
        ),
        initial=np.clip(variables.initial(), lower, upper),
        lower=lower,
        upper=upper,
        row_lower=rows.lower,
        row_upper=rows.upper,
    )


class _Costs:
    """The objective: one quadratic form for all linear residuals, mapped functions for the others."""

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
        stacked = _widen(matrix, size)
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
            value += ca.sum2(functions.value.map(count)(z, parameter))
            gradient_sum.add(
                residual.columns.ravel(),
                np.zeros(residual.columns.size, int),
                ca.vec(ca.densify(functions.gradient.map(count)(z, parameter))),
            )
            i, j = (np.array(k) for k in functions.hessian.sparsity_out(0).get_triplet())
            hessian_sum.add(
                residual.columns[:, i].ravel(),
                residual.columns[:, j].ravel(),
                nonzeros(functions.hessian.map(count)(z, parameter)),
            )
        return value, gradient + gradient_sum.total(), hessian_sum.total()


@dataclass(frozen=True)
class _Block:
    """The rows of one residual that are built.

    Attributes:
        residual: where they come from.
        kept: which of its rows, counted frame after frame.  # (m,)
        scale: factor of each row: linear rows are brought to a largest coefficient of one.  # (m,)
        slack: the slacks' indices among the unknowns.  # (s,)
        slack_row: the row each slack belongs to, an index into ``kept``.  # (s,)
        slack_sign: 1 where it lifts the row to its lower bound, -1 where it lowers it to its upper one.  # (s,)
    """

    residual: Residual
    kept: np.ndarray
    scale: np.ndarray
    slack: np.ndarray
    slack_row: np.ndarray
    slack_sign: np.ndarray


class _Rows:
    """The constraints: linear rows with a constant Jacobian, and mapped functions for the others."""

    def __init__(self, variables: Variables, used: Sequence[Used]) -> None:
        self.slack_linear: list[tuple[np.ndarray, np.ndarray]] = []
        self.slack_quadratic: list[tuple[np.ndarray, np.ndarray]] = []
        bounds_index, bounds_lower, bounds_upper = [], [], []
        self.blocks: list[_Block] = []
        lower, upper = [], []
        free = np.less(*variables.bounds())
        for item in used:
            if item.use == "cost":
                continue
            residual = item.residual
            if isinstance(residual, FrameResidual) and residual.jacobian is None:
                raise ProblemError(f"term {residual.name} can only be a cost, not {item.use}")
            low, high = residual.lower.ravel(order="F"), residual.upper.ravel(order="F")
            keep = (np.isfinite(low) | np.isfinite(high)) & _changeable(residual, free)
            scale = np.ones(low.size)
            if isinstance(residual, LinearResidual):
                low, high = low - residual.offset, high - residual.offset
                scale = 1.0 / np.maximum(abs(residual.matrix).max(axis=1).toarray().ravel(), 1e-300)
                if item.use == "hard":
                    single = np.diff(residual.matrix.indptr) == 1
                    index = residual.matrix.indices[residual.matrix.indptr[:-1][single & keep]]
                    factor = residual.matrix.data[residual.matrix.indptr[:-1][single & keep]]
                    ends = np.stack([low[single & keep] / factor, high[single & keep] / factor])
                    bounds_index.append(index)
                    bounds_lower.append(ends.min(0))
                    bounds_upper.append(ends.max(0))
                    keep &= ~single
            kept = np.flatnonzero(keep)
            if not kept.size:
                continue
            low, high, scale = low[kept], high[kept], scale[kept]
            block = _Block(residual, kept, scale, *self._slacks(item, kept, low, high, variables))
            self.blocks.append(block)
            lower.append(low * scale)
            upper.append(high * scale)
        self.size = variables.size
        self.bound_index = np.concatenate([*bounds_index, np.zeros(0, int)])
        self.bound_lower = np.concatenate([*bounds_lower, np.zeros(0)])
        self.bound_upper = np.concatenate([*bounds_upper, np.zeros(0)])
        self.lower = np.concatenate([*lower, np.zeros(0)])
        self.upper = np.concatenate([*upper, np.zeros(0)])

    def _slacks(
        self, item: Used, kept: np.ndarray, low: np.ndarray, high: np.ndarray, variables: Variables
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """One slack for each finite bound of a soft row, starting from what the row is off by."""
        if item.use != "soft":
            return np.zeros(0, int), np.zeros(0, int), np.zeros(0)
        below, above = np.flatnonzero(np.isfinite(low)), np.flatnonzero(np.isfinite(high))
        row = np.concatenate([below, above])
        value = _values(item.residual, variables.initial())[kept]
        off = np.concatenate([low[below] - value[below], value[above] - high[above]])
        slack = variables.add(np.maximum(0.0, off), lower=0.0)
        weight = item.residual.weights.ravel(order="F")[kept][row]
        self.slack_linear.append((slack, SOFT_SLOPE * weight))
        self.slack_quadratic.append((slack, weight))
        return slack, row, np.repeat([1.0, -1.0], [below.size, above.size])

    def expressions(self, x: ca.MX) -> tuple[ca.MX, ca.MX]:
        """Constraint values and their sparse Jacobian."""
        total = SparseSum((len(self.lower), self.size))
        values = []
        first = 0
        for block in self.blocks:
            residual, kept = block.residual, block.kept
            here = first + np.arange(kept.size)
            if isinstance(residual, LinearResidual):
                matrix = (sp.diags(block.scale) @ _widen([residual.matrix[kept]], self.size)).tocoo()
                total.add_constant(first + matrix.row, matrix.col, matrix.data)
                row = to_dm(matrix.tocsc()) @ x
            else:
                assert residual.jacobian is not None
                count, m = len(residual.frames), len(residual.rows)
                z, parameter = gather(x, residual.columns), frozen(residual.parameters)
                row = ca.vec(ca.densify(residual.value.map(count)(z, parameter)))[kept.tolist()]
                i, j = (np.array(k) for k in residual.jacobian.sparsity_out(0).get_triplet())
                position = np.full(count * m, -1)
                position[kept] = here
                entry = position.reshape(count, m)[:, i].ravel()
                select = np.flatnonzero(entry >= 0)
                total.add(
                    entry[select],
                    residual.columns[:, j].ravel()[select],
                    nonzeros(residual.jacobian.map(count)(z, parameter))[select.tolist()],
                )
            if block.slack.size:
                factor = block.slack_sign * block.scale[block.slack_row]
                slack = sp.csc_matrix((factor, (block.slack_row, block.slack)), shape=(kept.size, self.size))
                row = row + to_dm(slack) @ x
                total.add_constant(here[block.slack_row], block.slack, factor)
            values.append(row)
            first += kept.size
        return ca.vertcat(*values) if values else ca.MX(0, 1), total.total()


def _values(residual: Residual, x: np.ndarray) -> np.ndarray:
    """Rows of a residual at x, frame after frame; linear ones without their offset."""
    if isinstance(residual, LinearResidual):
        return np.asarray(residual.matrix @ x[: residual.matrix.shape[1]])
    z = x[residual.columns].T
    return np.array(residual.value.map(len(residual.frames))(z, residual.parameters)).ravel(order="F")


def gather(x: ca.MX, columns: np.ndarray) -> ca.MX:
    """Unknowns of each frame, a column a frame, ``(nz, K)``."""
    return ca.reshape(x[columns.ravel().tolist()], columns.shape[1], columns.shape[0])


def nonzeros(matrix: ca.MX) -> ca.MX:
    """Nonzeros of a matrix as a column, in column-major order."""
    return ca.vec(matrix.nz[:])


def _changeable(residual: Residual, free: np.ndarray) -> np.ndarray:
    """Rows that name a free unknown, or none at all (those are as true or false as they are)."""
    if isinstance(residual, FrameResidual):
        return np.repeat(free[residual.columns].any(axis=1), len(residual.rows))
    matrix = residual.matrix
    named = sp.csr_matrix((np.ones(len(matrix.data)), matrix.indices, matrix.indptr), shape=matrix.shape)
    return np.asarray((named @ free[: matrix.shape[1]].astype(float) > 0) | (np.diff(matrix.indptr) == 0))


def _widen(blocks: Sequence[sp.csr_matrix], size: int) -> sp.csr_matrix:
    """Stack matrices that were built before the last unknowns were added."""
    wide = [sp.csr_matrix((b.data, b.indices, b.indptr), shape=(b.shape[0], size)) for b in blocks]
    return sp.vstack(wide).tocsr() if wide else sp.csr_matrix((0, size))
