"""Reading a clip together with the robot it moves, as every subcommand does."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from gmr_traj.formats import Clip, read_clip
from gmr_traj.robot import Robot
from gmr_traj.robot_loading import load_robot, reduce_robot

if TYPE_CHECKING:
    from gmr_traj.cli.arguments import Common


def load(path: Path, arguments: Common) -> tuple[Clip, Robot]:
    """Read a clip, and lock the joints of the robot that it does not move.

    Raises:
        RobotError, ResourceError: the robot cannot be loaded.
        ClipError: the clip cannot be read, or is not a motion of this robot.
    """
    robot = load_robot(arguments.robot)
    clip = read_clip(path, robot, format=arguments.input_format, fps=arguments.fps, quaternion=arguments.quaternion)
    if clip.motion.joint_names != robot.joint_names:
        robot = reduce_robot(robot, clip.motion.joint_names)
    return clip, robot
