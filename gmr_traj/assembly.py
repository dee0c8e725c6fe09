"""Sums of sparse contributions, as one CasADi matrix with a fixed sparsity."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np
import scipy.sparse as sp

from gmr_traj.threads import threads

_WORTHWHILE = 400  # frames


def to_dm(matrix: sp.spmatrix) -> ca.DM:
    """A SciPy matrix as a CasADi constant of the same sparsity."""
    csc = sp.csc_matrix(matrix)
    csc.sum_duplicates()
    csc.sort_indices()
    rows, columns = csc.shape
    sparsity = ca.Sparsity(rows, columns, csc.indptr.tolist(), csc.indices.tolist())
    return ca.DM(sparsity, csc.data)


def frozen(parameters: np.ndarray) -> ca.DM:
    """Parameters of a mapped function, ``(np, K)``, as a dense constant."""
    return ca.densify(ca.DM(parameters)) if parameters.size else ca.DM.zeros(*parameters.shape)


class SparseSum:
    """Adds entries (row, column, value) of many blocks; entries at the same place are summed.

    Args:
        shape: of the result.
        upper: entries of a symmetric matrix: those below the diagonal are moved to their mirror place.
    """

    def __init__(self, shape: tuple[int, int], upper: bool = False) -> None:
        self.shape = shape
        self.upper = upper
        self._rows: list[np.ndarray] = []
        self._columns: list[np.ndarray] = []
        self._values: list[ca.MX | np.ndarray] = []

    def add(self, rows: np.ndarray, columns: np.ndarray, values: ca.MX) -> None:
        """Entries whose values are expressions."""
        if self.upper:
            rows, columns = np.minimum(rows, columns), np.maximum(rows, columns)
        self._rows.append(rows)
        self._columns.append(columns)
        self._values.append(values)

    def add_constant(self, rows: np.ndarray, columns: np.ndarray, values: np.ndarray) -> None:
        """Entries whose values are numbers."""
        self.add(rows, columns, np.asarray(values, float))  # type: ignore[arg-type]

    def total(self) -> ca.MX:
        """The sum."""
        rows = np.concatenate([*self._rows, np.zeros(0, int)]).astype(np.int64)
        columns = np.concatenate([*self._columns, np.zeros(0, int)]).astype(np.int64)
        places, position = np.unique(columns * self.shape[0] + rows, return_inverse=True)
        indptr = np.searchsorted(places, np.arange(self.shape[1] + 1, dtype=np.int64) * self.shape[0])
        sparsity = ca.Sparsity(*self.shape, indptr.tolist(), (places % self.shape[0]).tolist())
        constant = np.zeros(len(places))
        expressions, slots = [], []
        first = 0
        for values, count in zip(self._values, (len(r) for r in self._rows), strict=True):
            here = position[first : first + count]
            first += count
            if isinstance(values, np.ndarray):
                np.add.at(constant, here, values)
            else:
                expressions.append(values)
                slots.append(here)
        nonzeros: ca.MX | ca.DM = ca.DM(constant)
        if expressions:
            slot = np.concatenate(slots)
            adder = sp.csc_matrix((np.ones(len(slot)), (slot, np.arange(len(slot)))), shape=(len(places), len(slot)))
            nonzeros = nonzeros + to_dm(adder) @ ca.vertcat(*expressions)
        return ca.MX(sparsity, ca.densify(ca.MX(nonzeros)))


def mapped(function: ca.Function, count: int) -> ca.Function:
    """A function of one frame for ``count`` frames, side by side where it is worth a thread.

    Every frame is computed by itself, so that the result does not depend on the number of threads.
    """
    many = threads()
    return function.map(count, "thread", many) if count >= _WORTHWHILE and many > 1 else function.map(count)


def gather(x: ca.MX, columns: np.ndarray) -> ca.MX:
    """Unknowns of each frame, a column a frame, ``(nz, K)``."""
    return ca.reshape(x[columns.ravel().tolist()], columns.shape[1], columns.shape[0])


def nonzeros(matrix: ca.MX) -> ca.MX:
    """Nonzeros of a matrix as a column, in column-major order."""
    return ca.vec(matrix.nz[:])


def widen(blocks: Sequence[sp.csr_matrix], size: int) -> sp.csr_matrix:
    """Stack matrices that were built before the last unknowns were added."""
    wide = [sp.csr_matrix((b.data, b.indices, b.indptr), shape=(b.shape[0], size)) for b in blocks]
    return sp.vstack(wide).tocsr() if wide else sp.csr_matrix((0, size))
