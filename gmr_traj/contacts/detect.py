"""Which sole points, and which other supports, rest on the floor in which frames, read off a robot clip."""

from __future__ import annotations

import numpy as np

from gmr_traj.contacts.limbs import limb_points, lowest_of_feet, resting_limbs
from gmr_traj.contacts.mask import from_mask, to_mask
from gmr_traj.contacts.rest import DetectionSettings, rest_runs
from gmr_traj.contacts.schedule import ContactSchedule
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
    """Stances of every sole point, and of the other supports that the robot declares.

    Args:
        motion: the clip.
        robot: the robot.
        settings: thresholds of the soles; the default ones where none are given.
        source: when the same points are in stance in what the clip is a retarget of: retargeted feet hover over the
            floor by centimetres, and there they may.

    Raises:
        ScheduleError: the source's stances are of another number of frames than the clip.
    """
    settings = settings or DetectionSettings()
    placed = placements(robot, motion.qpos)
    points, (centres, radii) = placed_sole_points(robot, placed), limb_points(robot, placed)
    limbs = centres[..., 2] - radii
    lowest = lowest_of_feet(robot, placed, points[:, :, 2].min(axis=1), limbs)
    level = float(np.quantile(lowest, settings.level_quantile))
    height = points[:, :, 2] - level
    if source is not None:
        if source.frames != motion.frames:
            raise ScheduleError(f"the source's stances are of {source.frames} frames, the clip has {motion.frames}")
        height = height - settings.source_allowance * to_mask(source, robot)
    resting = np.zeros(height.shape, bool)
    for on, found in zip(resting.T, rest_runs(points, height, motion.fps, settings), strict=True):
        for start, stop in found:
            on[start:stop] = True
    on_limbs = resting_limbs(robot, centres, limbs - level, motion.fps)
    return from_mask(ContactSchedule(motion.frames, motion.fps, (), height=-level), robot, resting, on_limbs)


def sole_points(motion: RobotMotion, robot: Robot) -> np.ndarray:
    """World positions of all contact points [m], one sole after the other.  # (T, K, 3)"""
    return placed_sole_points(robot, placements(robot, motion.qpos))


def placed_sole_points(robot: Robot, placed: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """The same from placements of the bodies.  # (T, K, 3)"""
    slots = [robot.body_names.index(sole.body) for sole in robot.soles]
    return np.concatenate(
        [body_points(placed, slot, sole.points) for slot, sole in zip(slots, robot.soles, strict=True)], axis=1
    )
