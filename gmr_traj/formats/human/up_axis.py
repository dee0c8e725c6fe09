"""Which axis of a human motion is vertical: by how the person stands, or by the floor under them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gmr_traj.exceptions import ClipError
from gmr_traj.formats.human.rigs import Landmarks

_UPRIGHT = 0.8  # cosine of the largest angle between head over feet and the vertical of somebody who stands
_OFTEN = 0.15  # share of the frames in which somebody stands who is not on the floor all the time
_NEARLY_ALWAYS = 0.9  # the same, to go against what the format usually has: somebody may lie or crawl along an axis
_CLEARLY = 3.0  # how many times as much as along the other axis
_FLAT = 0.15  # how much the lowest joint's height varies, relative to the body's extent, while a floor holds it
_AWAY = 0.5  # and how much it cannot, however high the jumps


def check_up(up: str) -> None:
    """Refuse an axis that is neither ``y`` nor ``z``.

    Raises:
        ClipError: it is another.
    """
    if up not in ("y", "z"):
        raise ClipError(f"there is no vertical axis {up!r}; --up takes y or z")


def decide_up(
    names: Sequence[str], positions: np.ndarray, marks: Landmarks | None, usual: str | None
) -> tuple[str, str]:
    """The axis along which the person stands, or else the one along which the lowest joint stays at one height.

    Standing counts if the lowest joint does not travel along the axis, as it does for somebody who crawls along it.

    Args:
        names: the joints.  # J
        positions: joint positions in the file's axes.  # (T, J, 3)
        marks: head and ankles, None where they are not known.
        usual: the axis that such files usually have.  Against it, only somebody who stands nearly always counts; it is
            taken where nothing decides.

    Returns:
        ``y`` or ``z``, and a sentence that says why.

    Raises:
        ClipError: nothing decides; names ``--up``.
    """
    extent = float(np.median(np.ptp(positions, axis=1).max(axis=1)))
    lowest = positions.min(axis=1)  # (T, 3)
    spread = np.quantile(lowest, 0.9, axis=0) - np.quantile(lowest, 0.1, axis=0)
    share = np.zeros(3) if marks is None else _standing(names, positions, marks)
    for axis, other in ((1, 2), (2, 1)):
        name = "xyz"[axis]
        enough = _OFTEN if usual in (None, name) else _NEARLY_ALWAYS
        travels = spread[axis] > max(_CLEARLY * spread[other], _AWAY * extent)
        if share[axis] >= max(enough, _CLEARLY * share[other]) and not travels:
            return name, f"up is {name}: the head is over the feet along it in {share[axis]:.0%} of the frames"
        if usual is None and spread[axis] < _FLAT * extent and spread[other] > max(_CLEARLY * spread[axis], extent):
            return name, f"up is {name}: the lowest joint keeps its height along it and travels along the other"
    if usual is not None:
        return usual, f"up is {usual}, as such files have it; the posture does not tell otherwise"
    raise ClipError("neither how the person stands nor the floor tells which axis is vertical; set --up y or --up z")


def _standing(names: Sequence[str], positions: np.ndarray, marks: Landmarks) -> np.ndarray:
    """Share of the frames in which the head is over the feet along each axis.  # (3,)"""
    feet = positions[:, [names.index(name) for name in marks.ankles]].mean(axis=1)
    upward = positions[:, names.index(marks.head)] - feet
    lengths = np.maximum(np.linalg.norm(upward, axis=1, keepdims=True), 1e-12)
    share: np.ndarray = (upward > _UPRIGHT * lengths).mean(axis=0)
    return share


def to_z_up(positions: np.ndarray, quaternions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A motion whose Y is up, turned by 90 degrees about X from the left: ``(x, y, z)`` becomes ``(x, -z, y)``.

    Args:
        positions: of the joints.  # (T, J, 3)
        quaternions: their orientations, wxyz.  # (T, J, 4)
    """
    turned = np.stack([positions[..., 0], -positions[..., 2], positions[..., 1]], axis=-1)
    w, x, y, z = np.moveaxis(quaternions, -1, 0)
    # (1, 1, 0, 0) / sqrt 2 times the quaternion
    return turned, np.stack([w - x, w + x, y - z, y + z], axis=-1) * np.sqrt(0.5)
