"""What the clips of a batch share, made once before their processes are forked.

The functions of a robot and of a problem's terms, 0.3 s to make, belong to one object, its kinematics, and do not
depend on the clip.  A forked process has whatever was made before the fork.  Nobody ends what takes too long there, so
this is done for robots and problems that ship alone.
"""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from gmr_traj import resources
from gmr_traj.exceptions import GmrTrajError
from gmr_traj.kinematics.casadi_kinematics import CasadiKinematics
from gmr_traj.motion import RobotMotion
from gmr_traj.problem import load_problem
from gmr_traj.refine import refine
from gmr_traj.robot import Robot
from gmr_traj.robot_loading import load_robot

FRAMES, FPS = 12, 30.0  # of the clip that is refined for what is made on the way

_made: dict[tuple[str, str], CasadiKinematics | None] = {}


def prepare(robot: str, problem: str) -> None:
    """Make what clips of a robot and a problem share, where both ship and it has not been made.

    What goes wrong goes wrong for the clips as well, in processes that report it.
    """
    key = robot, problem
    if key in _made or robot not in resources.names("models") or problem not in resources.names("problems"):
        return
    _made[key] = None
    with suppress(GmrTrajError):
        kinematics = CasadiKinematics(load_robot(robot))
        own = kinematics.robot
        still = RobotMotion(np.tile(own.nominal, (FRAMES, 1)), FPS, own.joint_names, own.name)
        refine(still, own, load_problem(problem), kinematics=kinematics)
        _made[key] = kinematics


def prepared(robot: Robot, name: str, problem: str) -> CasadiKinematics | None:
    """The kinematics that were made for a robot of that name; None for one with fewer joints, and where none were."""
    kinematics = _made.get((name, problem))
    return kinematics if kinematics is not None and kinematics.robot.joint_names == robot.joint_names else None
