"""A file's further fields for a clip that became longer: what a format's writer hands back has to last as long."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

# Where the readers keep fields of the file, see ``Clip.extras``.
_FIELDS = ("content", "others")
_ROWS, _HEADER, _COUNTER = "rows", "header", "Frame"


def longer(extras: Mapping[str, Any], frames: int, before: int, after: int) -> dict[str, Any]:
    """Extras of a clip that has frames added at its ends: everything else in them stands still there.

    Numbers with one row a frame keep their first and last row, velocities are zero; frame counters count on.

    Args:
        extras: of the clip as it was read.
        frames: how many frames it had.
        before: how many were added before it.
        after: how many after it.
    """
    out = dict(extras)
    for key in _FIELDS:
        if isinstance(extras.get(key), Mapping):
            out[key] = {name: _padded(name, value, frames, before, after) for name, value in extras[key].items()}
    if _ROWS in extras:
        rows = _padded(_ROWS, np.asarray(extras[_ROWS], dtype=np.float64), frames, before, after)
        if _COUNTER in extras[_HEADER]:
            counter = list(extras[_HEADER]).index(_COUNTER)
            rows[:, counter] = rows[0, counter] + np.arange(len(rows))
        out[_ROWS] = rows
    return out


def _padded(name: str, value: Any, frames: int, before: int, after: int) -> Any:
    if not isinstance(value, np.ndarray) or value.ndim == 0 or len(value) != frames or value.dtype.kind not in "fiub":
        return value
    width = [(before, after)] + [(0, 0)] * (value.ndim - 1)
    return np.pad(value, width) if "vel" in name else np.pad(value, width, mode="edge")
