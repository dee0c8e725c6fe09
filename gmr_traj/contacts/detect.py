"""Which sole points rest on the floor in which frames, read off a robot clip."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gmr_traj.contacts.schedule import ContactSchedule, Stance
from gmr_traj.exceptions import ScheduleError
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot


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


def detect(
    motion: RobotMotion,
    robot: Robot,
    settings: DetectionSettings = DetectionSettings(),
    source: ContactSchedule | None = None,
) -> ContactSchedule:
    """Stances of every sole point.

    Args:
        motion: the clip.
        robot: the robot.
        settings: thresholds.
        source: when the same points are in stance in what the clip is a retarget of: retargeted feet hover over the
            floor by centimetres, and there they may.

    Raises:
        ScheduleError: the source's stances are of another number of frames than the clip.
    """
    points, owners = sole_points(motion, robot)
    level = float(np.quantile(points[:, :, 2].min(axis=1), settings.level_quantile))
    height = points[:, :, 2] - level
    if source is not None:
        if source.frames != motion.frames:
            raise ScheduleError(f"the source's stances are of {source.frames} frames, the clip has {motion.frames}")
        allowed = np.zeros(height.shape)
        of_point = {(sole, point): column for column, (sole, point, _) in enumerate(owners)}
        for stance in source.stances:
            allowed[stance.start : stance.stop, of_point[stance.sole, stance.point]] = settings.source_allowance
        height = height - allowed
    runs = rest_runs(points, height, motion.fps, settings)
    stances = [
        Stance(sole, point, part, start, stop)
        for (sole, point, part), own in zip(owners, runs, strict=True)
        for start, stop in own
    ]
    return ContactSchedule(motion.frames, motion.fps, tuple(sorted(stances)), height=-level)


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


def sole_points(motion: RobotMotion, robot: Robot) -> tuple[np.ndarray, list[tuple[str, int, str]]]:
    """World positions of all contact points [m], ``(T, K, 3)``, and (sole, point, part) of each."""
    positions, rotations = placements(robot, motion.qpos)
    blocks, owners = [], []
    for sole in robot.soles:
        slot = robot.body_names.index(sole.body)
        blocks.append(positions[:, slot, None] + np.einsum("tij,kj->tki", rotations[:, slot], sole.points))
        owners += [(sole.name, k, part) for k, part in enumerate(sole.parts)]
    return np.concatenate(blocks, axis=1), owners


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
