"""What a file says, before anything about units, quaternion order and joints has been decided."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gmr_traj.exceptions import ClipError
from gmr_traj.references import BodyTargets

# The largest distance [m, or cm] and angle [rad, or deg] taken for a motion, well within what arithmetic can hold.
_LARGEST = 1e6


@dataclass(frozen=True)
class RawMotion:
    """Columns of a file with what its format defines about them.

    Attributes:
        format: name of the format.
        position: base positions in the file's unit.  # (T, 3)
        quaternion: base quaternions in the file's order.  # (T, 4)
        order: quaternion order the format defines, None where its files come in both.
        joints: joint positions in the file's unit.  # (T, n)
        joint_names: names the file gives its joints, None where it gives none.
        fps: the file's frame rate as it stands there, None where it has none.
        default_fps: frame rate the format's files have by convention, None where there is no convention.
        robot: name of the robot in the file, empty where it has none.
        contacts: text of a contact schedule, None where it has none.
        references: desired body placements.
        extras: see ``Clip``.
        notes: see ``Clip``.
        further: names of what the file holds beside the motion, which no other format can take over.
        confirmed: the reader has established the orders of quaternion and joints itself; nothing is left to test.
    """

    format: str
    position: np.ndarray
    quaternion: np.ndarray
    order: str | None
    joints: np.ndarray
    joint_names: tuple[str, ...] | None = None
    fps: Any = None
    default_fps: float | None = None
    robot: str = ""
    contacts: str | None = None
    references: BodyTargets | None = None
    extras: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    further: tuple[str, ...] = ()
    confirmed: bool = False

    def __post_init__(self) -> None:
        frames = {len(self.position), len(self.quaternion), len(self.joints)}
        if len(frames) != 1:
            counts = (
                f"{len(self.position)} positions, {len(self.quaternion)} quaternions, {len(self.joints)} joint rows"
            )
            raise ClipError(f"the fields have different numbers of frames: {counts}")
        if frames == {0}:
            raise ClipError("the clip has no frames")


def table(value: Any, name: str, *tail: int | None) -> np.ndarray:
    """A field as float64 of shape (T, *tail), where None in ``tail`` is any size.

    Raises:
        ClipError: it is not numbers, has another shape, or has a value that is not finite or absurdly large.
    """
    try:
        array = np.asarray(value)
        if array.dtype.kind not in "fiu":
            raise ClipError(f"{name} holds {array.dtype}, not numbers")
        array = array.astype(np.float64)
    except (ValueError, TypeError, OverflowError) as error:
        raise ClipError(f"{name} is not a table of numbers: {error}") from error
    expected = ", ".join("n" if k is None else str(k) for k in tail)
    shape = array.shape[1:]
    if array.ndim != len(tail) + 1 or not all(k in (None, size) for k, size in zip(tail, shape, strict=True)):
        raise ClipError(f"{name} has shape {array.shape}; expected (frames, {expected})")
    with np.errstate(invalid="ignore"):
        bad = np.flatnonzero(~(np.abs(array) < _LARGEST).all(axis=tuple(range(1, array.ndim))))
    if bad.size:
        raise ClipError(
            f"frame {bad[0]}: {name} has values that are not finite or above {_LARGEST:g} ({bad.size} such frames)"
        )
    return array


def number(value: Any, name: str) -> float:
    """A field that is one number, as a scalar, a list or an array of one.

    Raises:
        ClipError: it is anything else.
    """
    try:
        array = np.asarray(value)
        if array.size != 1 or array.dtype.kind not in "fiu":
            raise ClipError(f"{name} is {str(value)[:40]!r}; expected one number")
        return float(array.reshape(-1)[0])
    except (ValueError, TypeError, OverflowError) as error:
        raise ClipError(f"{name} is not a number: {error}") from error


def names(value: Any, field_name: str) -> tuple[str, ...]:
    """A field that is a list of names.

    Raises:
        ClipError: it is anything else.
    """
    items = value.tolist() if isinstance(value, np.ndarray) else value
    if not isinstance(items, list | tuple) or not all(isinstance(item, str) for item in items):
        raise ClipError(f"{field_name} is not a list of names")
    if len(set(items)) != len(items):
        raise ClipError(f"{field_name} names {next(n for n in items if items.count(n) > 1)!r} twice")
    return tuple(items)
