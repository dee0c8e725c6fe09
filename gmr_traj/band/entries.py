"""The entries of a symmetric matrix, each the sum of shares from many sources, in the order of where they are kept."""

from __future__ import annotations

import ctypes
from functools import cached_property

import numpy as np

from gmr_traj.kernels.library import address, arguments, kernels


class Shares(ctypes.Structure):
    """What ``Entries`` is in band.c."""

    _fields_ = tuple((name, ctypes.c_void_p) for name in ("front", "place", "first", "share", "values"))


class Entries:
    """Sums of values at places, from the first value to the last.

    Args:
        fronts: the front that each value belongs to.  # (v,) int32
        places: where in the front's panel; a place may be named more than once.  # (v,) int32
        panels: where each front's panel begins in the store, and where the last one ends, ascending.  # (F + 1,)

    Attributes:
        front: the first entry of each front, and their number.  # (F + 1,)
        place: of each entry in its front's panel, ascending there.  # (e,)
        first: the first share of each entry, and their number.  # (e + 1,)
        share: values, entry after entry.  # (v,)
    """

    def __init__(self, fronts: np.ndarray, places: np.ndarray, panels: np.ndarray) -> None:
        self._panels = panels
        count, library = len(fronts), kernels()
        if library is not None:
            begin, self.share = np.empty(len(panels), np.int64), np.empty(count, np.int32)
            given, sizes, sorted_places = (count, fronts, places, len(panels) - 1), np.diff(panels), self.share.copy()
            entries = library.layout_sort(*arguments(*given, sizes, begin, self.share, sorted_places))
            if entries < 0:
                raise MemoryError
            self.front, self.place = np.empty(len(panels), np.int64), np.empty(entries, np.int32)
            self.first = np.empty(entries + 1, np.int32)
            out = self.front, self.place, self.first
            library.layout_entries(*arguments(len(panels) - 1, begin, sorted_places, *out))
            return
        # Sorted as one number, place before index: faster than sorting the indices by place.
        bits = max(1, count).bit_length()
        order = (panels[fronts] + places) << bits
        order |= np.arange(count)
        order.sort()
        self.share = order.astype(np.int32)
        self.share &= (1 << bits) - 1
        order >>= bits
        new = np.diff(order, prepend=-1).nonzero()[0]
        self.first = np.append(new, count).astype(np.int32)
        self.front = np.searchsorted(order[new], panels)
        self.place = (order[new] - self._begin).astype(np.int32)

    @property
    def _begin(self) -> np.ndarray:
        """Where the panel of each entry begins.  # (e,)"""
        return np.repeat(self._panels[:-1], np.diff(self.front))

    @cached_property
    def _entry(self) -> np.ndarray:
        """Which entry each value is a share of.  # (v,)"""
        out = np.empty(len(self.share), np.int64)
        out[self.share] = np.repeat(np.arange(len(self.place)), np.diff(self.first))
        return out

    def fill(self, store: np.ndarray, values: np.ndarray) -> None:
        """Write the sums into the store, zero elsewhere."""
        store[:] = 0.0
        store[self._begin + self.place] = np.bincount(self._entry, values, len(self.place))

    def shares(self, first: int, values: np.ndarray) -> Shares:
        """For the kernels: the fronts from one on, and the values."""
        arrays = (self.front[first:], self.place, self.first, self.share, values)
        return Shares(*map(address, arrays))

    def assemble(self, library: ctypes.CDLL, front: int, values: np.ndarray, panel: np.ndarray) -> None:
        """Write the sums of one front into its panel, zero elsewhere, with the kernels."""
        library.band_assemble(ctypes.byref(self.shares(0, values)), *arguments(front, panel, panel.size))
