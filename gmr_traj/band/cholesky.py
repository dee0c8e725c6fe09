"""Cholesky factors of a symmetric matrix that is narrow along time, from both of its ends to the middle.

The first half of the blocks is eliminated from the first on, the second half from the last on; neither knows of the
other, so they run side by side.  What both leave is added to the block in the middle, which comes last.  A clip of T
frames costs ``O(T b^2 d)`` for d unknowns a frame and a bandwidth of b, nearly all of it in BLAS.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np

from gmr_traj.band import lapack
from gmr_traj.band.chain import Chain
from gmr_traj.band.entries import Entries
from gmr_traj.band.fronts import two_ended
from gmr_traj.band.ordering import Couplings, Ordering, as_numbers
from gmr_traj.kernels.library import address, arguments, kernels
from gmr_traj.threads import side_by_side

# Entries whose places are looked up at a time.
_CHUNK = 1 << 18

# So many fronts are worth a thread.
_MANY = 60


class _Fronts(ctypes.Structure):
    """What ``Fronts`` is in layout.c."""

    _fields_ = (
        *((name, ctypes.c_int64) for name in ("fronts", "size", "known")),
        *((name, ctypes.c_void_p) for name in ("pivots", "height", "ahead", "keys", "row")),
    )


class BlockCholesky:
    """Analysed once, factored as often as the numbers change.

    Args:
        ordering: of the unknowns.
        size: number of unknowns.
        couplings: where the values that :meth:`factor` will be given belong, on either side of the diagonal; values
            of the same place are summed.
    """

    def __init__(self, ordering: Ordering, size: int, couplings: Couplings) -> None:
        self.size = size
        ahead, back, middle, seen = two_ended(ordering, size)
        members = [np.concatenate([front.pivots, front.rest]) for front in (*ahead, *back)]
        members.append(middle)
        heights = np.array([len(member) for member in members])
        widths = np.array([len(front.pivots) for front in (*ahead, *back)] + [len(middle)])
        self._offsets = np.concatenate([[0], np.cumsum(heights * widths)])
        starts = np.concatenate([[0], np.cumsum(heights)])
        self._store = np.zeros(self._offsets[-1])
        self._heights = heights
        self._work = np.zeros(starts[-1])
        self._split = len(ahead)
        self._chains = []
        for fronts, first in ((ahead, 0), (back, len(ahead))):
            here = slice(first, first + len(fronts))
            self._chains.append(Chain(fronts, self._store, self._offsets[here], self._work, starts[here]))
        p = len(middle)
        self._panel = self._store[self._offsets[-2] :].reshape(p, p).T
        self._vector = self._work[starts[-2] :]
        at, x, self._info = self._panel.ctypes.data, self._vector.ctypes.data, ctypes.c_int(0)
        self._factoring = lapack.cholesky(p, at, p, ctypes.addressof(self._info))
        self._solving = [lapack.solve_triangle(p, at, p, x, transposed) for transposed in (False, True)]
        # rows of the middle block, in the order of what each chain leaves for it
        order = np.argsort(middle, kind="stable")
        self._rows = np.arange(p), order[np.searchsorted(middle[order], seen)]
        self._pivots = np.concatenate([*(front.pivots for front in (*ahead, *back)), middle])
        self._slots = np.concatenate([s + np.arange(w) for s, w in zip(starts, widths, strict=False)])
        self._entries = Entries(*self._all_places(members, widths, couplings), self._offsets)

    def _all_places(
        self, members: list[np.ndarray], widths: np.ndarray, couplings: Couplings
    ) -> tuple[np.ndarray, np.ndarray]:
        """The front that has each value, and where in its panel.  # (v,), (v,)"""
        fronts, size, library = len(members), self.size, kernels()
        # the front where each unknown is a pivot, which pivot, and which row it is in the fronts that know it
        pivots = np.zeros((size, 2), np.int32)
        pivots[self._pivots, 0] = np.repeat(np.arange(fronts), widths)
        pivots[self._pivots, 1] = np.concatenate([np.arange(width) for width in widths])
        # the row of a front at which the pivots of the next begin, with which it ends; only within a chain
        ahead = self._heights - np.append(widths[1:], 0)
        keys = np.repeat(np.arange(fronts), self._heights) * size + np.concatenate(members)
        by = np.argsort(keys)
        keys, row = keys[by], np.concatenate([np.arange(height) for height in self._heights])[by]
        given = (pivots, self._heights, ahead, keys, row)
        table = _Fronts(fronts, size, len(keys), *map(address, given))
        front, place = np.empty((2, sum(len(rows) for rows, _ in couplings)), np.int32)
        first = 0
        for rows, columns in as_numbers(couplings):
            for part in range(0, len(rows), _CHUNK):  # or the steps in between would need gigabytes
                one, other = rows[part : part + _CHUNK], columns[part : part + _CHUNK]
                here = slice(first, first + len(one))
                first += len(one)
                if library is None:
                    front[here], place[here] = _places(one, other, *given)
                else:
                    out = arguments(len(one), one, other, front[here], place[here])
                    library.layout_places(ctypes.byref(table), *out)
        return front, place

    def factor(self, values: np.ndarray, right: np.ndarray) -> bool:
        """Factor the matrix; whether it was positive definite.

        Args:
            values: in the order of the couplings.  # (v,)
            right: b, for :meth:`finish`: its forward substitution is done on the way, while a block is in the cache.
        """
        self._load(right)
        library = kernels()
        if library is None:
            self._entries.fill(self._store, values)
        else:
            self._entries.assemble(library, len(self._offsets) - 2, values, self._panel)
        first = (0, self._split)
        done = self._each(lambda k: self._chains[k].factor(self._entries, first[k], values))
        if not all(done):
            return False
        for chain, rows in self._left():
            update = chain.left
            self._panel[rows[:, None], rows] += update + np.tril(update, -1).T
        self._info.value = 0
        self._factoring[0](*self._factoring[1])
        self._substitute()
        return self._info.value == 0

    def solve(self, right: np.ndarray) -> np.ndarray:
        """X of ``A x = b``.

        Args:
            right: b.  # (nx,)
        """
        self._load(right)
        self._each(lambda k: self._chains[k].forward())
        self._substitute()
        return self.finish()

    def finish(self) -> np.ndarray:
        """X, by back substitution, of the right-hand side that :meth:`factor` was given."""
        call, arguments = self._solving[1]
        call(*arguments)
        for chain, rows in self._left():
            chain.tail[:] = self._vector[rows]
        self._each(lambda k: self._chains[k].backward())
        out = np.empty(self.size)
        out[self._pivots] = self._work[self._slots]
        return out

    def _load(self, right: np.ndarray) -> None:
        self._work[:] = 0.0
        self._work[self._slots] = right[self._pivots]

    def _left(self) -> list[tuple[Chain, np.ndarray]]:
        """Chains that leave something for the middle block, and the rows it belongs to."""
        return [(chain, rows) for chain, rows in zip(self._chains, self._rows, strict=True) if len(chain)]

    def _substitute(self) -> None:
        """Forward substitution in the middle block, after those of the chains."""
        for chain, rows in self._left():
            self._vector[rows] += chain.tail
        call, arguments = self._solving[0]
        call(*arguments)

    def _each(self, action: Callable[[int], bool | None]) -> list[bool | None]:
        """Results of an action on both chains; side by side where that is worth it."""
        tasks = [lambda: action(0), lambda: action(1)]
        if len(self._offsets) < _MANY or kernels() is None:
            return [task() for task in tasks]
        return side_by_side(tasks)


def _places(
    rows: np.ndarray,
    columns: np.ndarray,
    pivots: np.ndarray,
    heights: np.ndarray,
    ahead: np.ndarray,
    keys: np.ndarray,
    row_of: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """See `BlockCholesky._all_places`."""
    # Of two unknowns the one that is eliminated first has the column.
    (ranks, column), (others, other_column) = pivots[rows].T.astype(np.int64), pivots[columns].T.astype(np.int64)
    swap = (ranks > others) | ((ranks == others) & (column > other_column))
    other = np.where(swap, rows, columns)
    rank, beyond = np.minimum(ranks, others), np.abs(ranks - others)
    # The other is a pivot of the same front, of the next, which the rest ends with, or carried on from there.
    row = np.where(swap, column, other_column)
    following = (beyond == 1) & (rank + 1 < len(heights) - 1)
    row[following] += ahead[rank[following]]
    far = (beyond > 0) & ~following
    row[far] = row_of[np.searchsorted(keys, rank[far] * len(pivots) + other[far])]
    return rank, np.where(swap, other_column, column) * heights[rank] + row
