"""GMR's loop, frame by frame, written plainly with mink and daqp: what retargeting is measured against.

In every frame two stages of inverse kinematics, the second with the costs of the map's second stage, each of at least
one step and of further ones, ten at most, as long as a step lowers the tasks' error by more than 0.001.

Source: J. P. Araujo et al., Retargeting Matters: General Motion Retargeting for Humanoid Motion Tracking (2025).
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np

from gmr_traj.exceptions import BenchError
from gmr_traj.references import BodyTargets
from gmr_traj.retarget.body_map import BodyMap
from gmr_traj.robot import Robot

_PROGRESS, _MORE = 0.001, 10
_DAMPING = 0.5

MINK_IS_MISSING = "GMR's loop is run by mink, which is not installed: pip install 'gmr-traj[bench]'"


@dataclass(frozen=True)
class Loop:
    """What the loop gave.

    Attributes:
        qpos: a configuration a frame.  # (T, 7 + n)
        steps: inverse kinematics steps, all frames together.
    """

    qpos: np.ndarray
    steps: int


def has_mink() -> bool:
    """Whether the loop can be run."""
    return find_spec("mink") is not None


def gmr_loop(robot: Robot, body_map: BodyMap, targets: BodyTargets, *, published: bool = False) -> Loop:
    """Run the loop, in a model with the map's joint ranges.

    Args:
        robot: the robot.
        body_map: bodies (their origins only), costs, joint ranges.
        targets: what to follow.
        published: hand the limits over as GMR's code does, where mink does not see them and makes its own in each step:
            the same limits, but slower.

    Raises:
        BenchError: mink is not installed.
    """
    if not has_mink():
        raise BenchError(MINK_IS_MISSING)
    import mink

    model = copy.copy(robot.model)
    for joint, ends in body_map.joint_ranges.items():
        model.jnt_range[model.joint(joint).id] = ends
    limits = [mink.ConfigurationLimit(model)]
    stages = [
        [mink.FrameTask(t.body, "body", *(t.stage_one, t.stage_two)[k], lm_damping=1.0) for t in body_map.targets]
        for k in (0, 1)
    ]
    configuration = mink.Configuration(model)
    start = np.zeros(model.nq)
    start[:7] = 0.0, 0.0, model.qpos0[2], 1.0, 0.0, 0.0, 0.0
    configuration.update(start)

    def error(tasks: list[Any]) -> float:
        return float(np.linalg.norm(np.concatenate([task.compute_error(configuration) for task in tasks])))

    def solve(tasks: list[Any]) -> None:
        dt = model.opt.timestep
        handed = (limits,) if published else (False, limits)
        velocity = mink.solve_ik(configuration, tasks, dt, "daqp", _DAMPING, *handed)
        configuration.integrate_inplace(velocity, dt)

    out, steps = [], 0
    for t in range(targets.frames):
        for tasks in stages:
            for task, p, q in zip(tasks, targets.positions[t], targets.quaternions[t], strict=True):
                task.set_target(mink.SE3(np.concatenate([q, p])))
        for tasks in stages:
            before = error(tasks)
            solve(tasks)
            after, more = error(tasks), 0
            while before - after > _PROGRESS and more < _MORE:
                before = after
                solve(tasks)
                after, more = error(tasks), more + 1
            steps += 1 + more
        out.append(configuration.q.copy())
    return Loop(np.stack(out), steps)
