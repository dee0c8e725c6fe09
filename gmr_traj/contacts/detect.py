"""Which sole points rest on the floor in which frames, read off a robot clip."""

from __future__ import annotations

import numpy as np

from gmr_traj.contacts.rest import DetectionSettings, rest_runs
from gmr_traj.contacts.schedule import ContactSchedule, Stance
from gmr_traj.exceptions import ScheduleError
from gmr_traj.kinematics.mujoco_kinematics import body_points, placements
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot


def detect(
    motion: RobotMotion,
    robot: Robot,
    settings: DetectionSettings | None = None,
    source: ContactSchedule | None = None,
) -> ContactSchedule:
    """Stances of every sole point.

    Args:
        motion: the clip.
        robot: the robot.
        settings: thresholds; the default ones where none are given.
        source: when the same points are in stance in what the clip is a retarget of: retargeted feet hover over the
            floor by centimetres, and there they may.

    Raises:
        ScheduleError: the source's stances are of another number of frames than the clip.
    """
    settings = settings or DetectionSettings()
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


def sole_points(motion: RobotMotion, robot: Robot) -> tuple[np.ndarray, list[tuple[str, int, str]]]:
    """World positions of all contact points [m], ``(T, K, 3)``, and (sole, point, part) of each."""
    placed = placements(robot, motion.qpos)
    blocks, owners = [], []
    for sole in robot.soles:
        slot = robot.body_names.index(sole.body)
        blocks.append(body_points(placed, slot, sole.points))
        owners += [(sole.name, k, part) for k, part in enumerate(sole.parts)]
    return np.concatenate(blocks, axis=1), owners
