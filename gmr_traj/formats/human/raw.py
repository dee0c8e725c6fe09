"""A human motion as a file's reader finds it, before unit, vertical axis and height are decided."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class RawHuman:
    """What a reader hands on.

    Attributes:
        names, parents: the joints.  # J
        positions: in the file's unit and axes.  # (T, J, 3)
        quaternions: joint orientations in the file's world, wxyz.  # (T, J, 4)
        fps: frame rate [Hz], None where the file has none.
        rig: the rig where the format fixes it, None to go by the names.
        offsets: where joints are in their parents' frames at zero rotation, None where not known.  # (J, 3)
        unit, up: what the format fixes, None where it does not.
        usual_up: the vertical axis that such files usually have, None where there is no telling.
        height: stature [m] where the file says it.
        contacts: joint -> whether it is in contact, where the file says it.  # (T,) each
        notes: what the reader decided.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    positions: np.ndarray
    quaternions: np.ndarray
    fps: float | None
    rig: str | None = None
    offsets: np.ndarray | None = None
    unit: str | None = None
    up: str | None = None
    usual_up: str | None = None
    height: float | None = None
    contacts: Mapping[str, np.ndarray] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
