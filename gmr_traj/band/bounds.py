"""Bounds of a vector, one-sided, two-sided or none, and distances from them."""

from __future__ import annotations

import numpy as np


class Bounds:
    """``l <= w <= u``, infinite where there is none.

    Args:
        lower, upper: l and u, ``l < u``.  # (n,)
    """

    def __init__(self, lower: np.ndarray, upper: np.ndarray) -> None:
        self._lower, self._upper = lower, upper
        self._low, self._high = np.flatnonzero(np.isfinite(lower)), np.flatnonzero(np.isfinite(upper))
        ends = lower[self._low], upper[self._high]
        self._least = [np.spacing(np.maximum(1.0, np.abs(end))) for end in ends]

    def inside(self, w: np.ndarray, push: float) -> np.ndarray:
        """W moved inside by at least ``push``, or that share of a narrower interval than one."""
        margin = push * np.minimum(1.0, self._upper - self._lower)
        return np.clip(w, self._lower + margin, self._upper - margin)

    def distances(self, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """``w - l`` and ``u - w``, where there are such; at least what rounding leaves of them."""
        below, above = w[self._low] - self._lower[self._low], self._upper[self._high] - w[self._high]
        return np.maximum(below, self._least[0]), np.maximum(above, self._least[1])

    def of(self, change: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Entries of a step that belong to a lower, and to an upper bound."""
        return change[self._low], change[self._high]

    def spread(self, below: np.ndarray, above: np.ndarray) -> np.ndarray:
        """Values of the lower and of the upper bounds, summed for every entry of w.  # (n,)"""
        out = np.zeros(len(self._lower))
        out[self._low] = below
        out[self._high] += above
        return out

    def multipliers(self, w: np.ndarray, value: float, mu: float) -> tuple[np.ndarray, np.ndarray]:
        """Of lower and upper bounds at the start: ``mu`` over the distance where it is positive, else ``value``."""
        below, above = self.distances(w)
        return (mu / below, mu / above) if mu > 0.0 else (np.full(len(below), value), np.full(len(above), value))

    def longest(self, below: np.ndarray, above: np.ndarray, change: np.ndarray) -> float:
        """The largest step that stays inside.

        Args:
            below: distances from the lower bounds.
            above: distances from the upper bounds.
            change: of w.  # (n,)
        """
        down, up = self.of(change)
        falling, rising = down < 0, up > 0
        lower = np.min(-below[falling] / down[falling], initial=np.inf)
        return float(np.min(above[rising] / up[rising], initial=lower))
