"""Which unknowns are eliminated together, and which they couple with later on, from both ends of time to the middle.

A *front* is a block's pivots and its *rest*.  The rest is in the order of the next front: unknowns that are carried on,
those that end last first, then the next front's pivots.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gmr_traj.band.ordering import Ordering


@dataclass(frozen=True)
class Front:
    """One block's unknowns.

    Attributes:
        pivots: unknowns that are eliminated; carried ones that end here, then the block's own.  # (p,)
        rest: those that they couple with later.  # (r,)
        begin: the first pivot that each of the rest couples with, ascending; p where there is none.  # (r,)
    """

    pivots: np.ndarray
    rest: np.ndarray
    begin: np.ndarray


def two_ended(ordering: Ordering, size: int) -> tuple[list[Front], list[Front], np.ndarray, np.ndarray]:
    """Fronts from the first block and from the last, each up to the middle one, which is eliminated at the end.

    Args:
        ordering: blocks of unknowns.
        size: number of unknowns.

    Returns:
        fronts of both chains; the pivots of the middle block as the rest of the first chain's last front has them,
        and as that of the second chain has them.
    """
    middle = len(ordering.local) // 2
    ahead = _fronts(_until(ordering, middle), size)
    back = _fronts(_until(_mirrored(ordering), len(ordering.local) - 1 - middle), size)
    return ahead[:-1], back[:-1], ahead[-1].pivots, back[-1].pivots


def _mirrored(ordering: Ordering) -> Ordering:
    """The same with time running backwards."""
    end = len(ordering.local) - 1
    return Ordering(
        ordering.local[::-1], ordering.carried, end - ordering.last, end - ordering.first, ordering.across[::-1]
    )


def _until(ordering: Ordering, end: int) -> Ordering:
    """Blocks 0 to ``end``; what is carried beyond ends there, and what is carried from there is one of its own."""
    begun, starting = ordering.first < end, ordering.first == end
    local = ordering.local[: end + 1]
    starting &= ordering.last >= end
    local[end] = np.concatenate([local[end], ordering.carried[starting]])
    last = np.minimum(ordering.last, end)
    return replace(
        ordering,
        local=local,
        carried=ordering.carried[begun],
        first=ordering.first[begun],
        last=last[begun],
    )


def _fronts(ordering: Ordering, size: int) -> list[Front]:
    """The fronts of the blocks in turn.

    Local unknowns are sorted by the first pivot of the block before that they couple with.
    """
    by = np.lexsort((ordering.carried, -ordering.last))
    carried, first, last = ordering.carried[by], ordering.first[by], ordering.last[by]
    starts = np.argsort(first, kind="stable")
    begun = np.searchsorted(first[starts], np.arange(len(ordering.local)), side="right")
    block_of = np.full(size, len(ordering.local))
    for block, local in enumerate(ordering.local):
        block_of[local] = block
    across = ordering.across[:, block_of[ordering.across[1]] < len(ordering.local)]
    across = across[:, np.argsort(block_of[across[1]], kind="stable")]
    parts = np.searchsorted(block_of[across[1]], np.arange(len(ordering.local) + 1))
    column, earliest = np.zeros(size, np.int64), np.full(size, size)
    fronts: list[Front] = []
    alive, known = np.zeros(0, np.int64), 0
    for block, local in enumerate(ordering.local):
        ending, staying = alive[last[alive] == block], alive[last[alive] > block]
        alive = np.union1d(staying, starts[known : begun[block]])
        known = int(begun[block])
        if block:
            before, here = across[:, parts[block] : parts[block + 1]]
            np.minimum.at(earliest, here, column[before])
            local = local[np.argsort(earliest[local], kind="stable")]
            p, rest = len(fronts[-1].pivots), np.concatenate([fronts[-1].rest, local])
            begin = np.zeros(len(rest), np.int64)
            begin[len(fronts[-1].rest) :] = np.minimum(earliest[local], p)
            fronts[-1] = Front(fronts[-1].pivots, rest, begin)
        pivots = np.concatenate([carried[ending], local]).astype(np.int64)
        column[pivots] = np.arange(len(pivots))
        fronts.append(Front(pivots, carried[alive].astype(np.int64), np.zeros(len(alive), np.int64)))
    return fronts
