"""Fields written back the way they were: the type of an array, the type of a frame rate, and what is not read."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np


def like(before: Any, after: np.ndarray, default: type = np.float64) -> np.ndarray:
    """An array in the floating-point type that the file had it in.

    Args:
        before: the file's field, None where there was none.
        after: what to write.
        default: type where the file had none, or had integers.
    """
    dtype = before.dtype if isinstance(before, np.ndarray) and before.dtype.kind == "f" else np.dtype(default)
    if isinstance(before, np.ndarray) and before.shape[:-1] == after.shape and before.shape[-1] == 1:
        after = after[..., None]  # PHC keeps joints as (T, n, 1)
    return np.ascontiguousarray(after, dtype=dtype.newbyteorder("="))


def like_fps(before: Any, fps: float) -> Any:
    """A frame rate as the file had it where it is the same number, else as a number of the same kind.

    Args:
        before: the file's fps: a number, a NumPy scalar, a list or an array of one; None where there was none.
        fps: frame rate to write [Hz].
    """
    if before is None:
        return int(fps) if float(fps).is_integer() else float(fps)
    array = np.asarray(before)
    if float(array.reshape(-1)[0]) == fps:
        return before
    integral = array.dtype.kind in "iu" and float(fps).is_integer()
    if isinstance(before, np.ndarray | np.generic):
        return np.full(array.shape, fps, dtype=array.dtype if integral or array.dtype.kind == "f" else np.float64)[()]
    number = int(fps) if integral else float(fps)
    return [number] if isinstance(before, list) else number


def further(content: Iterable[Any], known: Iterable[str]) -> tuple[str, ...]:
    """Names of the fields of a file that are no part of the motion and go back unchanged."""
    understood = tuple(known)
    return tuple(str(key) for key in content if key not in understood)
