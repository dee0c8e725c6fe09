"""Runs of frames."""

from __future__ import annotations

import numpy as np


def runs(mask: np.ndarray) -> list[tuple[int, int]]:
    """Half-open runs ``[start, stop)`` of true frames.

    Args:
        mask: one truth value a frame.  # (T,) bool
    """
    ends = np.flatnonzero(np.diff(mask, prepend=False, append=False)).reshape(-1, 2)
    return [(int(start), int(stop)) for start, stop in ends]
