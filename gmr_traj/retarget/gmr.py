"""Method ``gmr``: General Motion Retargeting as the paper describes it.

Araujo et al., "Retargeting Matters: General Motion Retargeting for Humanoid Motion Tracking", section III.  The value
that a stage watches is the one its steps minimise,

    V = sum_b (k_b |e_p|)^2 + (l_b |e_R|)^2

with the map's costs k, l.  The first frame starts at the scaled root position and its yaw, the joints in the robot's
nominal posture, and is repeated until nothing moves any more before it is recorded: what comes out depends neither on
the heading of the clip nor, but for the frames in which a person's posture has several answers, on where it starts.
Afterwards the whole clip is raised or lowered so that the lowest point of soles and collision shapes touches the floor.
"""

from __future__ import annotations

import numpy as np

from gmr_traj import resources
from gmr_traj.exceptions import ResourceError
from gmr_traj.human_motion import HumanMotion
from gmr_traj.retarget.body_map import BodyMap
from gmr_traj.retarget.frame_solver import FrameSolver, StepSettings
from gmr_traj.retarget.ground import heights
from gmr_traj.retarget.options import Options, Solved
from gmr_traj.retarget.targets import scaled_targets
from gmr_traj.robot import Robot
from gmr_traj.toml_table import read_toml

_SETTINGS = "retarget_gmr"


def solve(human: HumanMotion, robot: Robot, body_map: BodyMap, options: Options) -> Solved:
    """Retarget a clip.

    Raises:
        MapError: the map does not fit the motion.
        SolverError: a quadratic program was not solved.
    """
    table = read_toml(resources.find("configs", _SETTINGS), ResourceError)
    settings = StepSettings.read(table)
    repeats, still = table.count("first_frame_repeats", 0), table.number("first_frame_still", above=0.0)
    table.done()
    targets = scaled_targets(human, body_map)
    solver = FrameSolver(
        robot, body_map, targets, human.fps, settings, options, value=weighted_value, ended=_no_longer_changes
    )
    q = start(solver, body_map)
    notes: tuple[str, ...] = ()
    for _ in range(repeats):
        before, q = q, solver.frame(0, q)
        if np.abs(q - before).max() < still:
            break
    else:
        notes = (f"the first frame still moves by more than {still:g} after {repeats} repetitions",)
    qpos = solver.clip(q)
    found = heights(robot, qpos)
    qpos[:, 2] += found.raise_by
    return Solved(qpos, targets.raised(found.raise_by), found.raise_by, solver.steps, (*notes, *found.notes()))


def start(solver: FrameSolver, body_map: BodyMap) -> np.ndarray:
    """Where the first frame starts: the scaled root position, its yaw, the joints in the nominal posture.  # (7 + n,)

    The yaw is the turn about the vertical that comes closest to the target's orientation: of ``(w, x, y, z)`` that of
    ``(w, 0, 0, z)``.  It turns with the clip.
    """
    root = solver.targets.names.index(body_map.root_target.body)
    w, _, _, z = solver.targets.quaternions[0, root]
    # A root that is turned upside down exactly has every yaw or none.
    norm = np.hypot(w, z)
    yaw = np.array([w, 0.0, 0.0, z]) / norm if norm > 0.0 else np.array([1.0, 0.0, 0.0, 0.0])
    joints = np.clip(solver.robot.nominal[7:], solver.lower, solver.upper)
    return np.concatenate([solver.targets.positions[0, root], yaw, joints])


def weighted_value(squares: np.ndarray, squared_costs: np.ndarray) -> float:
    """V, the sum of the squared weighted errors."""
    return float(np.vdot(squares, squared_costs))


def _no_longer_changes(before: float, after: float, tolerance: float) -> bool:
    return abs(before - after) < tolerance
