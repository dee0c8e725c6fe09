"""Method ``gmr-code``: what GMR's published code does, where it differs from the paper.

github.com/YanjieZe/GMR as of August 2025.  It starts at the model's zero configuration at the world's origin, records
the first frame as it is then, watches the norm of all errors of a stage (metres and radians together, those without
cost included), goes on while that falls by more than the tolerance, one step and ten more at most, lets a step
close 95 % of the distance to a joint limit, takes every LAFAN1 performer for 1.75 m tall, and leaves the height alone.
Newer versions pass velocity limits in a place where the solver does not see them; those of ``Options`` do reach it.
"""

from __future__ import annotations

import math

import numpy as np

from gmr_traj import resources
from gmr_traj.exceptions import ResourceError
from gmr_traj.human_motion import HumanMotion
from gmr_traj.retarget.body_map import BodyMap
from gmr_traj.retarget.frame_solver import FrameSolver, StepSettings
from gmr_traj.retarget.options import Options, Solved
from gmr_traj.retarget.targets import scaled_targets
from gmr_traj.robot import Robot
from gmr_traj.toml_table import read_toml

_SETTINGS = "retarget_gmr_code"


def solve(human: HumanMotion, robot: Robot, body_map: BodyMap, options: Options) -> Solved:
    """Retarget a clip.

    Raises:
        MapError: the map does not fit the motion.
        SolverError: a quadratic program was not solved.
    """
    table = read_toml(resources.find("configs", _SETTINGS), ResourceError)
    settings = StepSettings.read(table)
    heights = table.table("heights")
    height = heights.number(human.rig, above=0.0) if human.rig in heights.values else human.height
    targets = scaled_targets(human, body_map, height=height)
    solver = FrameSolver(robot, body_map, targets, human.fps, settings, options, value=error_norm, ended=_falls_no_more)
    q = np.array(robot.model.qpos0)
    q[:7] = 0.0, 0.0, robot.model.qpos0[2], 1.0, 0.0, 0.0, 0.0
    q[7:] = np.clip(q[7:], solver.lower, solver.upper)
    qpos = solver.clip(q)
    return Solved(qpos, targets, steps=solver.steps)


def error_norm(squares: np.ndarray, squared_costs: np.ndarray) -> float:
    """Norm of all errors, whatever their costs."""
    del squared_costs
    return math.sqrt(squares.sum())


def _falls_no_more(before: float, after: float, tolerance: float) -> bool:
    return not before - after > tolerance
