"""When a person's ankles and toes are at rest on the floor, read off the motion itself."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gmr_traj.contacts.rest import DetectionSettings, hysteresis

#: Wider than for a robot's sole points: an ankle rises and turns while the foot under it stays.
HUMAN = DetectionSettings(
    level_quantile=0.1, enter_height=0.03, enter_speed=0.3, leave_height=0.06, leave_speed=0.6, shortest=0.1
)
_SPAN = 1.0 / 30.0  # time over which speeds are taken [s]: shorter spans show the markers' noise


def human_contacts(
    names: Sequence[str],
    positions: np.ndarray,
    fps: float,
    pairs: Sequence[tuple[str, str]],
    settings: DetectionSettings = HUMAN,
) -> dict[str, np.ndarray]:
    """Stance flags of foot joints.

    A joint is in stance from when it is below ``enter_height`` and ``enter_speed`` until it is above ``leave_height``
    or ``leave_speed``; stances shorter than ``shortest`` are dropped.  Heights count from the pair's own level: the
    ``level_quantile`` of the heights of both joints in the frames in which they are slow, which is how high the joint
    is over the sole plus wherever the clip has its floor.  A foot that never comes down thus shares the other's level.

    Args:
        names: the joints.  # J
        positions: joint positions, Z up [m].  # (T, J, 3)
        fps: frame rate [Hz].
        pairs: left and right joint at the same place of the foot, e.g. the ankles and the toes.
        settings: the thresholds.

    Returns:
        Joint -> whether it is in stance.  # (T,) bool
    """
    shortest = max(2, round(settings.shortest * fps))
    flags = {}
    for pair in pairs:
        points = positions[:, [names.index(name) for name in pair]]  # (T, 2, 3)
        speed = _speed(points, fps)
        slow = points[..., 2][speed < settings.leave_speed]
        heights = slow if slow.size else points[..., 2]
        level = float(np.quantile(heights, settings.level_quantile))
        for k, name in enumerate(pair):
            flags[name] = np.zeros(len(points), dtype=bool)
            for start, stop in hysteresis(points[:, k, 2] - level, speed[:, k], settings):
                if stop - start >= shortest:
                    flags[name][start:stop] = True
    return flags


def _speed(points: np.ndarray, fps: float) -> np.ndarray:
    """Speed over about ``_SPAN``, central, one-sided at the ends [m/s].  # (T, K)"""
    reach = max(1, round(_SPAN * fps / 2))
    at = np.arange(len(points))
    after, before = np.minimum(at + reach, len(points) - 1), np.maximum(at - reach, 0)
    lasted = np.maximum(after - before, 1) / fps
    speed: np.ndarray = np.linalg.norm(points[after] - points[before], axis=2) / lasted[:, None]
    return speed
