"""Nonlinear costs and constraint rows in numbers: values, derivatives, and their shares of the condensed matrix."""

from __future__ import annotations

import numpy as np

from gmr_traj.constraints import Block
from gmr_traj.frame_costs import gauss_newton
from gmr_traj.frames import Frames, filled
from gmr_traj.residuals import FrameResidual

# Frames whose Hessians are multiplied out at a time, so that the whole matrices need no memory.
_CHUNK = 512


class Cost:
    """A nonlinear cost, with derivatives at the point of the last evaluation.

    Attributes:
        gradient_at: unknowns that entries of the gradient belong to.
    """

    def __init__(self, residual: FrameResidual) -> None:
        functions, parameters = gauss_newton(residual)
        joint, columns = functions.joint, residual.columns.T
        self._frames = Frames(joint, residual.columns, parameters)
        self.gradient_at = columns[np.array(joint.sparsity_out(1).row(), np.int64)].ravel()
        # Half the memory of long integers, for millions of pairs.
        self._columns = residual.columns.astype(np.int32)
        self._pairs = tuple(np.array(k, np.int64) for k in joint.sparsity_out(2).get_triplet())
        self._factored = functions.factored
        if self._factored:
            named, j = np.unique(self._pairs[1], return_inverse=True)
            self._factor, self._lower = (self._pairs[0], j), np.tril_indices(len(named))
            self._weight = tuple(np.array(k, np.int64) for k in joint.sparsity_out(3).get_triplet())
            self._products = np.zeros((len(residual.frames), len(self._lower[0])))
            self._pairs = tuple(named[k] for k in self._lower)

    @property
    def hessian_at(self) -> tuple[np.ndarray, np.ndarray]:
        """Pairs of unknowns that entries of the Hessian belong to; made when they are asked for, once."""
        i, j = self._pairs
        if self._factored:  # frame after frame
            return self._columns[:, i].ravel(), self._columns[:, j].ravel()
        return self._columns.T[i].ravel(), self._columns.T[j].ravel()

    def at(self, x: np.ndarray) -> float:
        """Evaluate all; returns the cost."""
        self._frames.at(x)
        return float(self._frames.outputs[0].sum())

    @property
    def gradient(self) -> np.ndarray:
        """Entries of the gradient."""
        return self._frames.outputs[1].ravel()

    @property
    def hessian(self) -> np.ndarray:
        """Entries of the Hessian's model."""
        if not self._factored:
            return self._frames.outputs[2].ravel()
        factor, weight = self._frames.outputs[2:]
        (i, j), (a, b) = self._factor, self._weight
        rows = int(a.max()) + 1
        for first in range(0, factor.shape[1], _CHUNK):
            here = slice(first, min(first + _CHUNK, factor.shape[1]))
            s = np.zeros((here.stop - first, rows, int(j.max()) + 1))
            w = np.zeros((here.stop - first, rows, rows))
            s[:, i, j], w[:, a, b] = factor[:, here].T, weight[:, here].T
            self._products[here] = np.matmul(s.transpose(0, 2, 1), w @ s)[:, *self._lower]
        return self._products.ravel()


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
        self._function = residual.value
        self._value = Frames(residual.value, residual.columns, residual.parameters)
        self._jacobian = Frames(residual.jacobian, residual.columns, residual.parameters)
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
        return values.ravel()[self._kept], self._jacobian.outputs[0].ravel()[self._entries]

    def products(self, sigma: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Entries of ``J' diag(sigma) J`` at the point of the last evaluation.

        Args:
            sigma: of these rows.
        """
        dense, weighted = self._dense, self._weighted
        dense[:, self._i, self._j] = self._jacobian.outputs[0].T
        self._sigma.reshape(-1)[self._kept] = sigma
        np.multiply(dense, self._sigma.T[:, :, None], out=weighted)
        np.matmul(weighted.transpose(0, 2, 1), dense, out=self._product)
        inner = self._product[:, self._lower[0], self._lower[1]].ravel()
        return inner, (weighted[self._slack_frame, self._slack_row] * self._slack_sign).ravel()
