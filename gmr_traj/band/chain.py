"""Fronts that are eliminated one after the other, each leaving what the next one starts from.

With the pivots of a front (D) and the rows of its rest (E),

    [D E']   [L  0] [L' X']
    [E C ] = [X  I] [0  S ],    D = L L',  X = E L^-T,  S = C - X X'.

S is added to what the next front has.  A frame couples with the next three, so that E, and X with it, is a staircase:
its rows are sorted by where they begin and worked on in a few steps.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise

import numpy as np

from gmr_traj.band import lapack
from gmr_traj.band.entries import Entries
from gmr_traj.band.fronts import Front
from gmr_traj.band.lapack import Call
from gmr_traj.kernels.library import address, kernels

# Steps that a staircase is worked on in; with more of them BLAS gets pieces that are too small.
_STEPS = 3


class _Panels(ctypes.Structure):
    """What ``Chain`` is in band.c."""

    _fields_ = (
        ("count", ctypes.c_int64),
        ("steps", ctypes.c_int64),
        ("fronts", ctypes.c_void_p),
        ("onward", ctypes.c_void_p),
        ("staircases", ctypes.c_void_p),
        ("store", ctypes.c_void_p),
        ("work", ctypes.c_void_p),
        ("call", ctypes.c_void_p),
    )


class Chain:
    """Fronts in the order of their elimination.

    Args:
        fronts: the fronts; what the last one leaves is for the caller.
        store: where panels are.
        panels: where each panel, ``[L; X]`` in Fortran's order, begins in the store.  # (F,)
        work: where vectors are: pivots and rest of every front.
        vectors: where each vector begins.  # (F,)
    """

    def __init__(
        self,
        fronts: Sequence[Front],
        store: np.ndarray,
        panels: np.ndarray,
        work: np.ndarray,
        vectors: np.ndarray,
    ) -> None:
        self._fronts, self._store, self._work = fronts, store, work
        onward = _onward(fronts)
        self._table = np.zeros((len(fronts), 6), np.int64)
        self._table[:, 0] = [len(front.pivots) for front in fronts]
        self._table[:, 1] = [len(front.rest) for front in fronts]
        self._table[:, 2], self._table[:, 3] = panels, vectors
        self._table[:, 4] = counts = np.array([len(rows) for rows in onward], np.int64)
        self._table[:, 5] = np.cumsum(counts) - counts
        self._onward = np.concatenate([*onward, np.zeros(0, np.int64)])
        self._stairs = np.array([_staircase(front) for front in fronts], np.int64).reshape(len(fronts), _STEPS, 4)
        largest = int(self._table[:, 1].max(initial=0))
        self._spaces = np.zeros((2, largest * largest))
        self._panels = _Panels(
            len(fronts),
            _STEPS,
            *map(address, (self._table, self._onward, self._stairs, store, work)),
            lapack.addresses(),
        )

    def __len__(self) -> int:
        return len(self._fronts)

    @property
    def left(self) -> np.ndarray:
        """The lower triangle of S that the last front leaves, after :meth:`factor`.  # (r, r)"""
        r = int(self._table[-1, 1])
        return self._spaces[(len(self) - 1) % 2][: r * r].reshape(r, r).T

    @property
    def tail(self) -> np.ndarray:
        """The rest of the last front's vector: what a forward substitution leaves, where a backward one begins."""
        p, r, start = self._table[-1, [0, 1, 3]]
        return self._work[start + p : start + p + r]

    def factor(self, entries: Entries, first: int, values: np.ndarray) -> bool:
        """Factor, with a forward substitution on the way; whether all pivots were positive definite.

        Args:
            entries: of the matrix; without kernels, they are in the store already.
            first: index of this chain's first front among those of the entries.
            values: that they are sums of.
        """
        library = kernels()
        if library is None:
            return self._factor()
        shares = entries.shares(first, values)
        spaces = (ctypes.c_void_p * 2)(*map(address, self._spaces))
        done = library.band_factor(ctypes.byref(self._panels), ctypes.byref(shares), spaces)
        return int(done) == len(self)

    def forward(self) -> None:
        """Substitute forward in the vectors."""
        library = kernels()
        if library is not None:
            library.band_forward(ctypes.byref(self._panels))
            return
        for k in range(len(self)):
            self._substitute(k)

    def backward(self) -> None:
        """Substitute backward in the vectors; the last one's rest is known."""
        library = kernels()
        if library is not None:
            library.band_backward(ctypes.byref(self._panels))
            return
        for k in reversed(range(len(self))):
            if k + 1 < len(self):
                p, q, count = self._table[k, 0], self._table[k + 1, 0], self._table[k, 4]
                vector, after = self._vectors[k], self._vectors[k + 1]
                vector[p + count :] = after[:q]
                if count:
                    vector[p : p + count] = after[q + self._rows(k)]
            for call, arguments in self._calls[k][2]:
                call(*arguments)

    # The same in Python, one routine of BLAS at a time.

    def _factor(self) -> bool:
        info, before = self._info, np.zeros((0, 0))
        info.value = 0
        for k in range(len(self)):
            p, (panel, update) = self._table[k, 0], self._matrices[k]
            update[:] = 0.0
            if k:
                rows, count = self._rows(k - 1), self._table[k - 1, 4]
                panel[:p] += before[count:, count:]
                if count:
                    panel[p + rows] += before[count:, :count].T
                    update[rows[:, None], rows] = before[:count, :count]
            for call, arguments in self._calls[k][0]:
                call(*arguments)
            if info.value:
                return False
            self._substitute(k)
            before = update
        return True

    def _substitute(self, k: int) -> None:
        if k:
            q, count, vector = self._table[k - 1, 0], self._table[k - 1, 4], self._vectors[k]
            done, p = self._vectors[k - 1][q:], self._table[k, 0]
            vector[:p] += done[count:]
            if count:
                vector[p + self._rows(k - 1)] += done[:count]
        for call, arguments in self._calls[k][1]:
            call(*arguments)

    def _rows(self, k: int) -> np.ndarray:
        """Rows of the rest of front k + 1 that front k carries on."""
        count, start = self._table[k, 4], self._table[k, 5]
        return self._onward[start : start + count]

    @cached_property
    def _info(self) -> ctypes.c_int:
        return ctypes.c_int(0)

    @cached_property
    def _matrices(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Panel and update of every front."""
        out = []
        for k, (p, r, offset) in enumerate(self._table[:, :3].tolist()):
            panel = self._store[offset : offset + (p + r) * p].reshape(p, p + r).T
            out.append((panel, self._spaces[k % 2][: r * r].reshape(r, r).T))
        return out

    @cached_property
    def _vectors(self) -> list[np.ndarray]:
        return [self._work[start : start + p + r] for p, r, start in self._table[:, [0, 1, 3]].tolist()]

    @cached_property
    def _calls(self) -> list[tuple[list[Call], list[Call], list[Call]]]:
        """What factors, and what substitutes forward and backward, front after front."""
        out = []
        for (panel, update), vector, (p, r), stairs in zip(
            self._matrices, self._vectors, self._table[:, :2].tolist(), self._stairs.tolist(), strict=True
        ):
            h, at, x = p + r, panel.ctypes.data, vector.ctypes.data
            below, later = at + 8 * p, x + 8 * p
            factoring = [lapack.cholesky(p, at, h, ctypes.addressof(self._info))]
            forward, backward = [lapack.solve_triangle(p, at, h, x, False)], []
            if r:
                factoring += _steps(stairs, p, at, h, update.ctypes.data, r)
                forward.append(lapack.subtract_product(r, p, below, h, x, later, False))
                backward.append(lapack.subtract_product(r, p, below, h, later, x, True))
            backward.append(lapack.solve_triangle(p, at, h, x, True))
            out.append((factoring, forward, backward))
        return out


def _onward(fronts: Sequence[Front]) -> list[np.ndarray]:
    """The first rows of each rest, which are not the next front's pivots, as rows of the next one's rest."""
    out = []
    for one, two in pairwise(fronts):
        row = {int(unknown): k for k, unknown in enumerate(two.rest)}
        carried = one.rest[: len(one.rest) - len(two.pivots)]
        out.append(np.array([row[int(unknown)] for unknown in carried], np.int64))
    return [*out, *([np.zeros(0, np.int64)] if fronts else [])]


def _staircase(front: Front) -> list[tuple[int, int, int, int]]:
    """Steps: first and last column, and the rows of the rest that begin before the first and before the last."""
    p, out, done = len(front.pivots), [], 0
    for first, stop in pairwise(round(p * step / _STEPS) for step in range(_STEPS + 1)):
        rows = int(np.searchsorted(front.begin, stop))
        out.append((first, stop, done, rows))
        done = max(done, rows)
    return out


def _steps(stairs: list[list[int]], p: int, at: int, height: int, update: int, r: int) -> list[Call]:
    """The calls that give X and S, step by step.

    Args:
        stairs: see :func:`_staircase`.
        p: number of pivots.
        at: address of the panel.
        height: its leading dimension.
        update: address of S.
        r: its size.
    """
    solving, updating = [], []
    for first, stop, done, rows in stairs:
        panel = at + 8 * (p + height * first)
        if rows > done:
            triangle = at + 8 * (first + height * first)
            solving.append(lapack.solve_right(rows - done, p - first, triangle, height, panel + 8 * done, height))
        if rows and stop > first:
            updating.append(lapack.downdate(rows, stop - first, panel, height, update, r))
    return solving + updating
