"""The compiled kernels, or none."""

from __future__ import annotations

import ctypes
import os
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from gmr_traj.c_compiler import COMPILER
from gmr_traj.kernels.build import cached

_COUNTING = (
    "band_factor",
    "frames_width",
    "layout_reach",
    "layout_across",
    "layout_sort",
    "products_width",
    "segments_close",
    "segments_pairs",
)
_SOURCES = tuple(sorted(Path(__file__).parent.glob("*.c")))


def kernels() -> ctypes.CDLL | None:
    """The library; None where there is no compiler to make it."""
    return _loaded(os.environ.get(COMPILER))


def description() -> str:
    """Which inner loops run, in a word or two: for reports."""
    return "python" if kernels() is None else "compiled"


@cache
def _loaded(wanted: str | None) -> ctypes.CDLL | None:
    """With a compiler of that name, ``none`` or any."""
    if wanted == "none":
        return None
    path = cached("kernels", _SOURCES)
    if path is None:
        return None
    try:
        library = ctypes.CDLL(str(path))
    except OSError:
        return None  # such as a cache on a file system that nothing may be run from
    for name in _COUNTING:
        getattr(library, name).restype = ctypes.c_int64
    return library


def arguments(*values: Any) -> list[Any]:
    """What ctypes hands on: addresses of arrays, NULL for None, numbers of 64 bits, and the rest as it is."""
    return [_argument(value) for value in values]


def _argument(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return ctypes.c_void_p(address(value))
    if isinstance(value, int):
        return ctypes.c_int64(value)
    if isinstance(value, float):
        return ctypes.c_double(value)
    return ctypes.c_void_p(None) if value is None else value


def address(array: np.ndarray) -> int:
    """Where the numbers of an array are, one after the other."""
    assert array.flags.forc, "the kernels read arrays without gaps"
    return int(array.ctypes.data)
