"""How freed memory is kept: the factorisations of one solve ask for the same large blocks again and again."""

from __future__ import annotations

import ctypes

_M_TRIM_THRESHOLD, _M_TOP_PAD, _M_MMAP_THRESHOLD = -1, -2, -3
_KEPT, _PAD = 1 << 30, 1 << 26  # bytes


def keep_freed() -> bool:
    """Have glibc keep freed blocks for the next request instead of giving them back to the system.

    By default it maps every block above some size afresh and unmaps it when it is freed, and the system clears each
    page again: a tenth to a fifth of the time of a long clip.  Results do not depend on it.

    Returns:
        whether the C library has these settings (glibc has; others are left as they are).
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is None:
        return False
    settings = ((_M_MMAP_THRESHOLD, _KEPT), (_M_TRIM_THRESHOLD, _KEPT), (_M_TOP_PAD, _PAD))
    return all([mallopt(option, value) == 1 for option, value in settings])
