"""When points rest on the floor, by hysteresis on their height and speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: How far a point is above its usual (median) height in a stance when it is on its way up, or still down [m].
RISEN = 0.01


@dataclass(frozen=True)
class DetectionSettings:
    """Thresholds of the hysteresis.

    Attributes:
        level_quantile: quantile over the frames of the lowest sole point that is taken for the floor.
        enter_height, enter_speed: a stance begins below both [m], [m/s].
        leave_height, leave_speed: and ends above either.
        shortest: stances shorter than this are dropped [s].
        bridge: gaps up to this long between two stances of a point that stays low are closed [s],
        bridge_distance: if the point is no farther than this from where it was [m].
        source_allowance: how much higher a point may be where the source has it in stance [m].
    """

    level_quantile: float = 0.1
    enter_height: float = 0.025
    enter_speed: float = 0.25
    leave_height: float = 0.04
    leave_speed: float = 0.5
    shortest: float = 0.1
    bridge: float = 0.11
    bridge_distance: float = 0.03
    source_allowance: float = 0.02


def rest_runs(
    points: np.ndarray, height: np.ndarray, fps: float, settings: DetectionSettings
) -> list[list[tuple[int, int]]]:
    """Stretches of frames ``[start, stop)`` in which each point rests on the floor.

    Args:
        points: the points in the world [m].  # (T, K, 3)
        height: their heights above the floor they rest on [m].  # (T, K)
        fps: frames per second.
        settings: thresholds.
    """
    speed = np.linalg.norm(np.gradient(points, axis=0), axis=2) * fps if len(points) > 1 else np.zeros(height.shape)
    shortest = max(3, round(settings.shortest * fps))
    found = []
    for column in range(points.shape[1]):
        runs = hysteresis(height[:, column], speed[:, column], settings)
        bridged = _bridged(runs, points[:, column], height[:, column], fps, settings)
        found.append([(start, stop) for start, stop in bridged if stop - start >= shortest])
    return found


def hysteresis(height: np.ndarray, speed: np.ndarray, settings: DetectionSettings) -> list[tuple[int, int]]:
    """Runs of frames that enter below both lower thresholds and leave above either upper one.

    Args:
        height: over the floor [m].  # (T,)
        speed: [m/s].  # (T,)
        settings: the thresholds.

    Returns:
        First frame of each run and the one after its last.
    """
    enter = (height < settings.enter_height) & (speed < settings.enter_speed)
    leave = (height > settings.leave_height) | (speed > settings.leave_speed)
    runs, start = [], None
    for t in range(len(height)):
        if start is None and enter[t]:
            start = t
        elif start is not None and leave[t]:
            runs.append((start, t))
            start = None
    if start is not None:
        runs.append((start, len(height)))
    return runs


def _bridged(
    runs: list[tuple[int, int]], point: np.ndarray, height: np.ndarray, fps: float, settings: DetectionSettings
) -> list[tuple[int, int]]:
    """Runs joined across a fault: a gap of a few frames in which the point stays low and comes back to its place."""
    out: list[tuple[int, int]] = []
    for start, stop in runs:
        if stop - start < 2:
            continue  # the fault itself, still for the one frame in which its speeds there and back cancel
        if out:
            first, last = out[-1]
            low = (height[last:start] <= settings.leave_height).all()
            moved = float(np.linalg.norm(point[start, :2] - point[last - 1, :2]))
            if start - last <= settings.bridge * fps and low and moved <= settings.bridge_distance:
                out[-1] = (first, stop)
                continue
        out.append((start, stop))
    return out
