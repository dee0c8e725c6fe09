"""The constraints of a program: ``l <= g(x) <= u``, with the sparse Jacobian of g."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
import scipy.sparse as sp

from gmr_traj.assembly import SparseSum, frozen, gather, mapped, nonzeros, to_dm, widen
from gmr_traj.exceptions import ProblemError
from gmr_traj.frames import evaluated
from gmr_traj.residuals import FrameResidual, LinearResidual, Residual, Used
from gmr_traj.variables import Variables

# A soft row's slack costs w (rho |s| + s^2 / 2): rho [in the row's unit] makes small violations cost, too.
SOFT_SLOPE = 1e-3


@dataclass(frozen=True)
class Block:
    """The rows of one residual that are built.

    Attributes:
        residual: where they come from.
        kept: which of its rows, counted frame after frame.  # (m,)
        scale: factor of each row: linear rows are brought to a largest coefficient of one, others to what their
            residual says.  # (m,)
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


class Constraints:
    """Linear rows with a constant Jacobian, mapped functions for the others, slacks of soft rows.

    Args:
        variables: the unknowns; slacks are appended.
        used: residuals; costs are passed over.

    Attributes:
        slack_linear, slack_quadratic: indices of slacks with the slope and the curvature of what they cost.
        bound_index, bound_lower, bound_upper: hard linear rows of one unknown, as bounds on it.
        lower, upper: bounds of all other rows.  # (m,)

    Raises:
        ProblemError: a residual that can only be a cost is used as a constraint.
    """

    def __init__(self, variables: Variables, used: Sequence[Used]) -> None:
        self.slack_linear: list[tuple[np.ndarray, np.ndarray]] = []
        self.slack_quadratic: list[tuple[np.ndarray, np.ndarray]] = []
        bounds_index, bounds_lower, bounds_upper = [], [], []
        self.blocks: list[Block] = []
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
            if isinstance(residual, FrameResidual):
                scale = np.full(low.size, residual.scale)
            else:
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
            block = Block(residual, kept, scale, *self._slacks(item, kept, low, high, variables))
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
                matrix = (sp.diags(block.scale) @ widen([residual.matrix[kept]], self.size)).tocoo()
                total.add_constant(first + matrix.row, matrix.col, matrix.data)
                row = to_dm(matrix.tocsc()) @ x
            else:
                assert residual.jacobian is not None
                count, m = len(residual.frames), len(residual.rows)
                z, parameter = gather(x, residual.columns), frozen(residual.parameters)
                row = ca.vec(ca.densify(mapped(residual.value, count)(z, parameter)))[kept.tolist()] * residual.scale
                i, j = (np.array(k) for k in residual.jacobian.sparsity_out(0).get_triplet())
                position = np.full(count * m, -1)
                position[kept] = here
                entry = position.reshape(count, m)[:, i].ravel()
                select = np.flatnonzero(entry >= 0)
                total.add(
                    entry[select],
                    residual.columns[:, j].ravel()[select],
                    nonzeros(mapped(residual.jacobian, count)(z, parameter))[select.tolist()] * residual.scale,
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
    return evaluated(residual.value, residual.columns, residual.parameters, x).ravel(order="F")


def _changeable(residual: Residual, free: np.ndarray) -> np.ndarray:
    """Rows that name a free unknown, or none at all (those are as true or false as they are)."""
    if isinstance(residual, FrameResidual):
        return np.repeat(free[residual.columns].any(axis=1), len(residual.rows))
    matrix = residual.matrix
    named = sp.csr_matrix((np.ones(len(matrix.data)), matrix.indices, matrix.indptr), shape=matrix.shape)
    return np.asarray((named @ free[: matrix.shape[1]].astype(float) > 0) | (np.diff(matrix.indptr) == 0))
