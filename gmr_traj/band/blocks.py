"""Nonlinear costs and constraint rows in numbers: values, derivatives, and their shares of the condensed matrix."""

from __future__ import annotations

import casadi as ca
import numpy as np

from gmr_traj.band.products import Products
from gmr_traj.constraints import Block
from gmr_traj.frame_costs import gauss_newton
from gmr_traj.frames import Frames, filled
from gmr_traj.residuals import FrameResidual

# About how often a program is evaluated.
_EVALUATIONS = 10


class Cost:
    """A nonlinear cost, with derivatives at the point of the last evaluation.

    Attributes:
        gradient_at: unknowns that entries of the gradient belong to.
    """

    def __init__(self, residual: FrameResidual) -> None:
        functions, parameters = gauss_newton(residual)
        joint, columns = functions.joint, residual.columns.T
        self._frames = Frames(joint, residual.columns, parameters, _EVALUATIONS)
        self.gradient_at = columns[np.array(joint.sparsity_out(1).row(), np.int64)].ravel()
        # Half the memory of long integers, for millions of pairs.
        self._columns = np.ascontiguousarray(columns, np.int32)
        self._pairs = _places(joint, 2)
        self._products: Products | None = None
        if functions.factored:
            named, j = np.unique(self._pairs[1], return_inverse=True)
            factor, weight = self._frames.outputs[2:]
            self._products = Products((self._pairs[0], j), factor, _places(joint, 3), weight)
            i, j = self._products.at
            self._pairs = named[i], named[j]

    @property
    def hessian_at(self) -> tuple[np.ndarray, np.ndarray]:
        """Pairs of unknowns that entries of the Hessian belong to; made when they are asked for, once."""
        i, j = self._pairs
        return self._columns[i].ravel(), self._columns[j].ravel()

    def at(self, x: np.ndarray) -> float:
        """Evaluate all; returns the cost."""
        self._frames.at(x)
        return float(self._frames.outputs[0].sum())

    @property
    def gradient(self) -> np.ndarray:
        """Entries of the gradient."""
        return self._frames.outputs[1].ravel()

    def hessian(self, out: np.ndarray) -> None:
        """Write the entries of the Hessian's model.  # (e,)"""
        if self._products is None:
            out[:] = self._frames.outputs[2].ravel()
        else:
            self._products.multiply(out.reshape(len(self._pairs[0]), -1))


def _places(function: ca.Function, output: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of an output's nonzeros."""
    rows, columns = function.sparsity_out(output).get_triplet()
    return np.array(rows, np.int64), np.array(columns, np.int64)


class Rows:
    """Nonlinear constraint rows of one residual.

    Args:
        block: the rows that are built.
        first: index of the first of them.

    Attributes:
        span: their indices.
        jacobian_at: rows and unknowns that entries of the Jacobian belong to.
        inner_at, slack_at: pairs of unknowns that entries of ``J' diag(sigma) J`` belong to: among those of a frame,
            and slacks with those of their rows.
    """

    def __init__(self, block: Block, first: int) -> None:
        residual = block.residual
        assert isinstance(residual, FrameResidual) and residual.jacobian is not None
        count, m = len(residual.frames), len(residual.rows)
        self.span = slice(first, first + block.kept.size)
        # Rows are kept frame after frame, arrays of the frames row after row.
        frame, row = np.divmod(block.kept, m)
        self._kept = row * count + frame
        self._function, self._scale = residual.value, residual.scale
        self._value = Frames(residual.value, residual.columns, residual.parameters, _EVALUATIONS)
        self._jacobian = Frames(residual.jacobian, residual.columns, residual.parameters, _EVALUATIONS)
        self._i, j = (np.array(k, np.int64) for k in residual.jacobian.sparsity_out(0).get_triplet())
        named, self._j = np.unique(j, return_inverse=True)
        position = np.full((m, count), -1)
        position.reshape(-1)[self._kept] = first + np.arange(block.kept.size)
        entry = position[self._i].ravel()
        self._entries = np.flatnonzero(entry >= 0)
        self.jacobian_at = entry[self._entries], residual.columns.T[j].ravel()[self._entries]
        self._dense = np.zeros((count, m, len(named)))
        self._weighted = np.zeros_like(self._dense)
        self._sigma = np.zeros((m, count))
        self._product = np.zeros((count, len(named), len(named)))
        self._lower = np.tril_indices(len(named))
        mine = residual.columns[:, named]
        self.inner_at = mine[:, self._lower[0]].ravel(), mine[:, self._lower[1]].ravel()
        self._slack_frame, self._slack_row = frame[block.slack_row], row[block.slack_row]
        self._slack_sign = block.slack_sign[:, None]
        self.slack_at = np.repeat(block.slack, len(named)), mine[self._slack_frame].ravel()

    def at(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Evaluate: the rows without their slacks, and the Jacobian's entries."""
        self._value.at(x)
        self._jacobian.at(x)
        values = filled(self._function, self._value.outputs[0])
        return self._scale * values.ravel()[self._kept], self._scale * self._jacobian.outputs[0].ravel()[self._entries]

    def products(self, sigma: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Entries of ``J' diag(sigma) J`` at the point of the last evaluation.

        Args:
            sigma: of these rows.
        """
        dense, weighted = self._dense, self._weighted
        dense[:, self._i, self._j] = self._jacobian.outputs[0].T
        # Rows, slacks included, are scaled, and these derivatives are not.
        self._sigma.reshape(-1)[self._kept] = self._scale**2 * sigma
        np.multiply(dense, self._sigma.T[:, :, None], out=weighted)
        np.matmul(weighted.transpose(0, 2, 1), dense, out=self._product)
        inner = self._product[:, self._lower[0], self._lower[1]].ravel()
        return inner, (weighted[self._slack_frame, self._slack_row] * self._slack_sign).ravel()
