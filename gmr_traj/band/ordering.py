"""Unknowns in blocks along time, such that blocks couple with the next one alone, but for a few that are carried.

Jerk couples four frames, so a block is three frames with all unknowns that belong to them: only neighbouring blocks
couple.  An unknown that many frames couple with, such as the place of a stance, is *carried* from the first block that
knows it to the last, and eliminated there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gmr_traj.kernels.library import arguments, kernels

#: Rows and columns of a symmetric matrix' entries, on either side of the diagonal, once or more often.
Couplings = Sequence[tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class Ordering:
    """Blocks of unknowns.

    Attributes:
        local: the unknowns of each block.  # N of (p,)
        carried: unknowns that are in more than two blocks' reach.  # (c,)
        first, last: the blocks between which each is carried, both included; first < last.  # (c,)
        across: pairs of local unknowns that couple from one block (row 0) to the next (row 1).  # (2, m)
    """

    local: list[np.ndarray]
    carried: np.ndarray
    first: np.ndarray
    last: np.ndarray
    across: np.ndarray


def as_numbers(couplings: Couplings) -> Couplings:
    """The same as arrays that the kernels can read."""
    return [(np.ascontiguousarray(i, np.int32), np.ascontiguousarray(j, np.int32)) for i, j in couplings]


def order(frames: np.ndarray, couplings: Couplings) -> Ordering:
    """Blocks for a symmetric matrix.

    Args:
        frames: the frame of each unknown, -1 where it belongs to none in particular: it then gets one from the
            unknowns it couples with.  # (n,)
        couplings: places of the matrix' entries.
    """
    n = len(frames)
    couplings = as_numbers(couplings)
    known = frames >= 0
    size, pairs = _reach_of_frames(frames, couplings)
    distinct = np.sort(pairs)
    distinct = distinct[np.flatnonzero(np.diff(distinct, prepend=-1))]
    rows, columns = distinct // n, distinct % n
    place = np.where(known, frames // size, -1)
    low, high = np.full(n, np.iinfo(np.int64).max), np.full(n, -1)
    while True:  # blocks spread from the unknowns that have one to their neighbours
        for one, other in ((rows, columns), (columns, rows)):
            seen = (place[other] >= 0) & ~known[one]
            np.minimum.at(low, one[seen], place[other[seen]])
            np.maximum.at(high, one[seen], place[other[seen]])
        new = (place < 0) & (high >= 0)
        if not new.any():
            break
        place[new] = low[new]
    place[place < 0] = 0  # coupled with nothing
    # Both ends must be in the block or next to it: those that reach farther are carried.
    far = np.abs(place[rows] - place[columns]) > 1
    carried = np.zeros(n, bool)
    carried[rows[far & ~known[rows]]] = True
    carried[columns[far & ~known[columns]]] = True
    first, last = _reach(place, carried, rows, columns)
    settled = carried & (first == last)
    carried &= ~settled
    place[settled] = first[settled]
    who = np.flatnonzero(carried)
    inside = np.flatnonzero(~carried)
    inside = inside[np.argsort(place[inside], kind="stable")]
    count = int(place[inside].max(initial=0)) + 1
    borders = np.searchsorted(place[inside], np.arange(1, count))
    return Ordering(np.split(inside, borders), who, first[who], last[who], _across(place, carried, couplings))


def _reach_of_frames(frames: np.ndarray, couplings: Couplings) -> tuple[int, np.ndarray]:
    """How far couplings reach.

    Returns:
        the largest distance in frames of two unknowns that couple, at least 1; all couplings with unknowns of no
        frame, the greater index times n plus the other.
    """
    n, size, library = len(frames), 1, kernels()
    pairs = [np.zeros(0, np.int64)]
    for one, other in couplings:
        if library is not None:
            most = np.array([size])
            count = library.layout_reach(*arguments(len(one), one, other, frames, n, most, None))
            if count:
                pairs.append(np.empty(count, np.int64))
                library.layout_reach(*arguments(len(one), one, other, frames, n, most, pairs[-1]))
            size = int(most[0])
            continue
        both = (frames[one] >= 0) & (frames[other] >= 0)
        size = max(size, int(np.abs(frames[one[both]] - frames[other[both]]).max(initial=0)))
        loose = ~both & (one != other)
        ends = one[loose].astype(np.int64), other[loose].astype(np.int64)
        pairs.append(np.maximum(*ends) * n + np.minimum(*ends))
    return size, np.concatenate(pairs)


def _across(block: np.ndarray, carried: np.ndarray, couplings: Couplings) -> np.ndarray:
    """Pairs of local unknowns in neighbouring blocks, the earlier one first.  # (2, m)"""
    library = kernels()
    pairs = [np.zeros((2, 0), np.int64)]
    for one, other in couplings:
        if library is not None:
            given = arguments(len(one), one, other, block, carried)
            count = library.layout_across(*given, *arguments(None, None))
            if count:
                pairs.append(np.empty((2, count), np.int64))
                library.layout_across(*given, *arguments(*pairs[-1]))
            continue
        apart = (block[one] != block[other]) & ~carried[one] & ~carried[other]
        rows, columns = one[apart], other[apart]
        forth = block[rows] < block[columns]
        pairs.append(np.stack([np.where(forth, rows, columns), np.where(forth, columns, rows)]))
    return np.concatenate(pairs, axis=1)


def _reach(
    place: np.ndarray, carried: np.ndarray, rows: np.ndarray, columns: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """First and last block that each carried unknown couples with; two that couple must meet.  # (n,) each"""
    first, last = place.copy(), place.copy()
    first[carried], last[carried] = np.iinfo(np.int64).max, -1
    for one, other in ((rows, columns), (columns, rows)):
        here = carried[one] & ~carried[other]
        np.minimum.at(first, one[here], place[other[here]])
        np.maximum.at(last, one[here], place[other[here]])
    lonely = carried & (last < 0)
    first[lonely] = last[lonely] = place[lonely]
    pairs = carried[rows] & carried[columns]
    for i, j in zip(rows[pairs].tolist(), columns[pairs].tolist(), strict=True):
        i, j = (i, j) if last[i] <= last[j] else (j, i)
        first[j] = min(first[j], last[i])
    return first, last
