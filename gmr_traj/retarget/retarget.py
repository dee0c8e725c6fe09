"""Retargeting a human motion to a robot."""

from __future__ import annotations

from dataclasses import dataclass

from gmr_traj.exceptions import GmrTrajError
from gmr_traj.human_motion import HumanMotion
from gmr_traj.motion import RobotMotion
from gmr_traj.references import BodyTargets
from gmr_traj.retarget.body_map import BodyMap
from gmr_traj.retarget.methods import METHODS
from gmr_traj.retarget.options import Options, Progress
from gmr_traj.robot import Robot


@dataclass(frozen=True)
class Retargeted:
    """A retargeted clip.

    Attributes:
        motion: the robot's motion, with the frame rate of the human's unless the method thins it out.
        references: the scaled human targets, in the motion's world.
        raised: by how much the method raised the clip as a whole [m].
        steps: inverse kinematics steps, all frames together.
        notes: what the user should know, one sentence each.
    """

    motion: RobotMotion
    references: BodyTargets
    raised: float
    steps: int
    notes: tuple[str, ...]


def retarget(
    human: HumanMotion,
    robot: Robot,
    body_map: BodyMap,
    *,
    method: str = "gmr",
    velocity_limit: float | None = None,
    progress: Progress | None = None,
) -> Retargeted:
    """Retarget a human motion to a robot.

    Args:
        human: the motion.
        robot: the robot, with joints locked where that is wanted.
        body_map: which joint tells which body; see ``load_map`` and ``default_map_name``.
        method: one of ``METHODS``: ``gmr`` as the paper says, ``gmr-code`` as the published code does;
            ``phc`` and ``protomotions``, and variants of them.
        velocity_limit: no joint moves faster than this factor times its velocity limit; None for no limit.
        progress: ``(stage, done, total)``, called as the work goes on.

    Raises:
        MapError: the map does not fit the motion.
        SolverError: the inverse kinematics could not be solved.
        GmrTrajError: there is no such method, or the velocity limit is not a positive factor.
    """
    if method not in METHODS:
        raise GmrTrajError(f"there is no retargeting method {method!r}; there are {', '.join(METHODS)}")
    solved = METHODS[method](human, robot, body_map, Options(velocity_limit, progress))
    return Retargeted(
        motion=RobotMotion(solved.qpos, solved.fps or human.fps, robot.joint_names, robot.name),
        references=solved.targets,
        raised=solved.raised,
        steps=solved.steps,
        notes=solved.notes,
    )
