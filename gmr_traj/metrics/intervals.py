"""Stretches of frames."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np


def intervals(mask: np.ndarray, gap: int) -> list[tuple[int, int]]:
    """Half-open stretches ``[start, stop)`` of true frames, those with fewer than ``gap`` false frames between joined.

    Args:
        mask: one truth value a frame.  # (T,)
        gap: frames; 1 joins nothing.
    """
    frames = np.flatnonzero(mask)
    if not frames.size:
        return []
    breaks = np.flatnonzero(np.diff(frames) > max(gap, 1))  # a difference of d leaves d - 1 frames between
    starts, stops = frames[np.r_[0, breaks + 1]], frames[np.r_[breaks, frames.size - 1]] + 1
    return list(zip(starts.tolist(), stops.tolist(), strict=True))


def near(stretches: Iterable[tuple[int, int]], frames: int, margin: int) -> np.ndarray:
    """For each of ``frames`` frames, whether it is in one of the stretches or at most ``margin`` frames from it."""
    mask = np.zeros(frames, dtype=bool)
    for start, stop in stretches:
        mask[max(0, start - margin) : stop + margin] = True
    return mask
