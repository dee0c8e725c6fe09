"""Hessians that come as factors, multiplied out in all frames: ``H = S' W S``, lower triangle."""

from __future__ import annotations

import ctypes
from functools import partial

import numpy as np

from gmr_traj.kernels.library import address, arguments, kernels
from gmr_traj.threads import parts, side_by_side

# So many frames are worth a thread.
_MANY = 512

# The Python way takes so many frames at a time.
_CHUNK = 512


class _Products(ctypes.Structure):
    """What ``Products`` is in products.c."""

    _fields_ = (
        *((name, ctypes.c_int64) for name in ("rows", "columns")),
        *((name, ctypes.c_void_p) for name in ("begin", "row", "factor", "weight")),
        ("frames", ctypes.c_int64),
        ("product", ctypes.c_void_p),
    )


class Products:
    """H in all frames.

    Args:
        factor_at: rows and columns of the entries of S, column after column, ascending; no column is empty.
        factor: these entries.  # (nnz, K)
        weight_at: rows and columns of the entries of W, both of its triangles.
        weight: these entries.  # (nnz, K)

    Attributes:
        at: rows and columns of the entries of H, row after row.
    """

    def __init__(
        self,
        factor_at: tuple[np.ndarray, np.ndarray],
        factor: np.ndarray,
        weight_at: tuple[np.ndarray, np.ndarray],
        weight: np.ndarray,
    ) -> None:
        self._row, column = (np.ascontiguousarray(index, np.int64) for index in factor_at)
        self._columns, self._rows = int(column.max()) + 1, int(max(*weight_at[0], *self._row)) + 1
        self._begin = np.searchsorted(column, np.arange(self._columns + 1))
        self._factor, self._weight = factor, weight
        self._which = np.full((self._rows, self._rows), -1)
        self._which[weight_at] = np.arange(len(weight))
        self.at = np.tril_indices(self._columns)

    def multiply(self, out: np.ndarray) -> None:
        """Compute all entries of H, of all frames.  # (e, K)"""
        count, library = self._factor.shape[1], kernels()
        if library is None:
            for first in range(0, count, _CHUNK):
                self._multiply(slice(first, first + _CHUNK), out)
            return
        # CasADi, where it computes few frames, has a frame's numbers together.
        factor, weight = np.ascontiguousarray(self._factor), np.ascontiguousarray(self._weight)
        weights = np.where(self._which >= 0, address(weight) + 8 * count * self._which, 0)
        given = (self._begin, self._row, factor, weights)
        table = _Products(self._rows, self._columns, *map(address, given), count, address(out))

        def run(begin: int, end: int) -> None:
            space = np.empty(self._rows * self._columns * int(library.products_width()))
            library.products_run(ctypes.byref(table), *arguments(begin, end, space))

        side_by_side([partial(run, *frames) for frames in parts(count, _MANY)])

    def _multiply(self, here: slice, out: np.ndarray) -> None:
        """In some frames.  Sums begin with zero and go on in the order of the rows of S."""
        factor, weight = self._factor[:, here], self._weight[:, here]
        space = np.zeros((self._columns, self._rows, factor.shape[1]))
        for j in range(self._columns):
            for e in range(self._begin[j], self._begin[j + 1]):
                which = self._which[:, self._row[e]]
                space[j, which >= 0] += weight[which[which >= 0]] * factor[e]
        first = 0
        for i in range(self._columns):
            products = out[first : first + i + 1, here]
            products[:] = 0.0
            for e in range(self._begin[i], self._begin[i + 1]):
                products += factor[e] * space[: i + 1, self._row[e]]
            first += i + 1
