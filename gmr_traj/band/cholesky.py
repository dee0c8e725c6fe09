"""Cholesky factors of a symmetric matrix, block after block along time.

With the pivots of a block (D) and the rows that they couple with later on (E),

    [D E']   [L  0] [L' X']
    [E C ] = [X  I] [0  S ],    D = L L',  X = E L^-T,  S = C - X X'.

The later rows are unknowns that are carried on, then the next block's pivots; S is added to what the next block has.
A frame couples with the next three, so that E, and X with it, is a staircase: its rows are sorted by where they begin
and worked on in a few steps.  A clip of T frames costs ``O(T b^2 d)`` for d unknowns a frame and a bandwidth of b,
nearly all of it in BLAS.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gmr_traj.band import lapack
from gmr_traj.band.lapack import Call
from gmr_traj.band.ordering import Ordering

# Steps that a staircase is worked on in; with more of them BLAS gets pieces that are too small.
_STEPS = 3

# Entries whose places are looked up at a time.
_CHUNK = 1 << 20


@dataclass(frozen=True)
class _Front:
    """One block's part of the factor.

    Attributes:
        pivots: unknowns that are eliminated; those that they couple with later are the front's rest.  # (p,)
        onward: the first rows of the rest, which are not the next block's pivots, as rows of the next one's rest.
        panel: [L; X], a view of the store.  # (p + r, p)
        update: S.  # (r, r)
        vector: pivots and rest of a right-hand side.  # (p + r,)
        factoring, forward, backward: the routines to call.
    """

    pivots: np.ndarray
    onward: np.ndarray
    panel: np.ndarray
    update: np.ndarray
    vector: np.ndarray
    factoring: list[Call]
    forward: list[Call]
    backward: list[Call]

    def substitute(self, before: _Front | None) -> None:
        """Forward substitution, after that of the block before."""
        if before is not None:
            p, k, done = len(self.pivots), len(before.onward), before.vector[len(before.pivots) :]
            self.vector[:p] += done[k:]
            if k:
                self.vector[p + before.onward] += done[:k]
        for call, arguments in self.forward:
            call(*arguments)


class BlockCholesky:
    """Analysed once, factored as often as the numbers change.

    Args:
        ordering: of the unknowns.
        size: number of unknowns.

    Attributes:
        store: fill it at :meth:`places` with the matrix' entries, zero elsewhere, then call :meth:`factor`.
    """

    def __init__(self, ordering: Ordering, size: int) -> None:
        self.size = size
        members, begins = _members(ordering, size)
        heights = np.array([len(pivots) + len(rest) for pivots, rest in members])
        widths = np.array([len(pivots) for pivots, _ in members])
        self._offsets = np.concatenate([[0], np.cumsum(heights * widths)])
        starts = np.concatenate([[0], np.cumsum(heights)])
        self.store = np.zeros(self._offsets[-1])
        self._heights = heights
        # the row of a front at which the pivots of the next begin, with which it ends
        self._ahead = heights[:-1] - widths[1:]
        self._work = np.zeros(starts[-1])
        largest = int((heights - widths).max())
        spaces = np.zeros((2, largest * largest))
        self._info = ctypes.c_int(0)
        self._fronts = [
            self._front(pivots, rest, begin, following, int(offset), int(start), spaces[k % 2])
            for k, ((pivots, rest), begin, following, offset, start) in enumerate(
                zip(members, begins, [*members[1:], None], self._offsets, starts, strict=False)
            )
        ]
        self._pivots = np.concatenate([front.pivots for front in self._fronts])
        self._slots = np.concatenate([s + np.arange(w) for s, w in zip(starts, widths, strict=False)])
        # where each unknown is a pivot, and which row it is in the fronts that know it
        self._rank, self._column = np.zeros(size, np.int64), np.zeros(size, np.int64)
        self._rank[self._pivots] = np.repeat(np.arange(len(widths)), widths)
        self._column[self._pivots] = np.concatenate([np.arange(width) for width in widths])
        known = np.concatenate([np.concatenate(pair) for pair in members])
        keys = np.repeat(np.arange(len(heights)), heights) * size + known
        by = np.argsort(keys)
        self._keys, self._rows = keys[by], np.concatenate([np.arange(height) for height in heights])[by]

    def _front(
        self,
        pivots: np.ndarray,
        rest: np.ndarray,
        begin: np.ndarray,
        following: tuple[np.ndarray, np.ndarray] | None,
        offset: int,
        start: int,
        space: np.ndarray,
    ) -> _Front:
        p, r, h = len(pivots), len(rest), len(pivots) + len(rest)
        onward = np.zeros(0, np.int64)
        if following is not None:
            row = {int(unknown): k for k, unknown in enumerate(following[1])}
            onward = np.array([row[int(unknown)] for unknown in rest[: len(rest) - len(following[0])]], np.int64)
        panel = self.store[offset : offset + h * p].reshape(p, h).T
        update = space[: r * r].reshape(r, r).T
        vector = self._work[start : start + h]
        at, x = panel.ctypes.data, vector.ctypes.data
        below, later = at + 8 * p, x + 8 * p
        factoring = [lapack.cholesky(p, at, h, ctypes.addressof(self._info))]
        forward, backward = [lapack.solve_triangle(p, at, h, x, False)], []
        if r:
            factoring += _staircase(begin, p, at, h, update.ctypes.data)
            forward.append(lapack.subtract_product(r, p, below, h, x, later, False))
            backward.append(lapack.subtract_product(r, p, below, h, later, x, True))
        backward.append(lapack.solve_triangle(p, at, h, x, True))
        return _Front(pivots, onward, panel, update, vector, factoring, forward, backward)

    def places(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Where in the store entries of the matrix are, given on either side of the diagonal."""
        out = np.empty(len(rows), np.int64)
        for first in range(0, len(rows), _CHUNK):  # or the steps in between would need gigabytes
            here = slice(first, first + _CHUNK)
            out[here] = self._places(rows[here], columns[here])
        return out

    def _places(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        # Of two unknowns the one that is eliminated first has the column.
        ranks, others = self._rank[rows], self._rank[columns]
        swap = (ranks > others) | ((ranks == others) & (self._column[rows] > self._column[columns]))
        pivot, other = np.where(swap, columns, rows), np.where(swap, rows, columns)
        rank, beyond = np.minimum(ranks, others), np.abs(ranks - others)
        # The other is a pivot of the same block, of the next, which the rest ends with, or carried on from there.
        row = self._column[other]
        following = beyond == 1
        row[following] += self._ahead[rank[following]]
        far = beyond > 1
        found = np.searchsorted(self._keys, rank[far] * self.size + other[far])
        row[far] = self._rows[found]
        return np.asarray(self._offsets[rank] + self._column[pivot] * self._heights[rank] + row)

    def factor(self, right: np.ndarray) -> bool:
        """Factor what is in the store; whether it was positive definite.

        Args:
            right: b, for :meth:`finish`: its forward substitution is done on the way, while a block is in the cache.
        """
        self._info.value = 0
        self._load(right)
        before: _Front | None = None
        for front in self._fronts:
            update, p = front.update, len(front.pivots)
            update[:] = 0.0
            if before is not None:
                done, onward = before.update, before.onward
                k = len(onward)
                front.panel[:p] += done[k:, k:]
                if k:
                    front.panel[p + onward] += done[k:, :k].T
                    update[onward[:, None], onward] = done[:k, :k]
            for call, arguments in front.factoring:
                call(*arguments)
            if self._info.value:
                return False
            front.substitute(before)
            before = front
        return True

    def solve(self, right: np.ndarray) -> np.ndarray:
        """X of ``A x = b``.

        Args:
            right: b.  # (nx,)
        """
        self._load(right)
        before: _Front | None = None
        for front in self._fronts:
            front.substitute(before)
            before = front
        return self.finish()

    def _load(self, right: np.ndarray) -> None:
        self._work[:] = 0.0
        self._work[self._slots] = right[self._pivots]

    def finish(self) -> np.ndarray:
        """X, by back substitution, of the right-hand side that :meth:`factor` was given."""
        after: _Front | None = None
        for front in reversed(self._fronts):
            if after is not None:
                p, q, k = len(front.pivots), len(after.pivots), len(front.onward)
                front.vector[p + k :] = after.vector[:q]
                if k:
                    front.vector[p : p + k] = after.vector[q + front.onward]
            for call, arguments in front.backward:
                call(*arguments)
            after = front
        out = np.empty(self.size)
        out[self._pivots] = self._work[self._slots]
        return out


def _staircase(begin: np.ndarray, p: int, at: int, height: int, update: int) -> list[Call]:
    """The calls that give X and S, step by step.

    Args:
        begin: the first pivot that each row of E couples with, ascending; p where there is none.  # (r,)
        p: number of pivots.
        at: address of the panel.
        height: its leading dimension.
        update: address of S.
    """
    r = len(begin)
    columns = sorted({round(p * step / _STEPS) for step in range(_STEPS + 1)})
    solving, updating, done = [], [], 0
    for first, stop in pairwise(columns):
        rows = int(np.searchsorted(begin, stop))
        panel = at + 8 * (p + height * first)
        if rows > done:
            triangle = at + 8 * (first + height * first)
            solving.append(lapack.solve_right(rows - done, p - first, triangle, height, panel + 8 * done, height))
        if rows:
            updating.append(lapack.downdate(rows, stop - first, panel, height, update, r))
        done = max(done, rows)
    return solving + updating


def _members(ordering: Ordering, size: int) -> tuple[list[tuple[np.ndarray, np.ndarray]], list[np.ndarray]]:
    """Pivots and rest of every block, and the first pivot that each row of the rest couples with.

    Carried unknowns are pivots where they end, before the local ones.  The rest of a block ends with the next one's
    pivots; what is carried on is in the order of its ends, the last first, in every block.  Local unknowns are sorted
    by the first pivot of the block before that they couple with.
    """
    by = np.lexsort((ordering.carried, -ordering.last))
    carried, first, last = ordering.carried[by], ordering.first[by], ordering.last[by]
    starts = np.argsort(first, kind="stable")
    begun = np.searchsorted(first[starts], np.arange(len(ordering.local)), side="right")
    block_of = np.zeros(size, np.int64)
    for block, local in enumerate(ordering.local):
        block_of[local] = block
    across = ordering.across[:, np.argsort(block_of[ordering.across[1]], kind="stable")]
    parts = np.searchsorted(block_of[across[1]], np.arange(len(ordering.local) + 1))
    column, earliest = np.zeros(size, np.int64), np.full(size, size)
    members: list[tuple[np.ndarray, np.ndarray]] = []
    begins: list[np.ndarray] = []
    alive, known = np.zeros(0, np.int64), 0
    for block, local in enumerate(ordering.local):
        ending, staying = alive[last[alive] == block], alive[last[alive] > block]
        alive = np.union1d(staying, starts[known : begun[block]])
        known = int(begun[block])
        if block:
            before, here = across[:, parts[block] : parts[block + 1]]
            np.minimum.at(earliest, here, column[before])
            local = local[np.argsort(earliest[local], kind="stable")]
            pivots_before, rest_before = members[-1][0], members[-1][1]
            rest = np.concatenate([rest_before, local])
            begin = np.zeros(len(rest), np.int64)
            begin[len(rest_before) :] = np.minimum(earliest[local], len(pivots_before))
            members[-1] = pivots_before, rest
            begins.append(begin)
        pivots = np.concatenate([carried[ending], local]).astype(np.int64)
        column[pivots] = np.arange(len(pivots))
        members.append((pivots, carried[alive].astype(np.int64)))
    begins.append(np.zeros(len(members[-1][1]), np.int64))
    return members, begins
