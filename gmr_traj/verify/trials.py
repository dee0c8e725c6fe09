"""Many rollouts of a clip, in parallel, the same whatever the number of workers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot
from gmr_traj.robot_loading import load_robot, reduce_robot
from gmr_traj.verify.conditions import Conditions
from gmr_traj.verify.controller import Controller, OpenLoop
from gmr_traj.verify.mpc import PRESETS, Mpc
from gmr_traj.verify.policy import load_policy
from gmr_traj.verify.processes import in_processes
from gmr_traj.verify.reference import Reference, reference
from gmr_traj.verify.rollout import Rollout, Start, roll_out

Kind = Literal["mpc", "policy", "pd"]


@dataclass(frozen=True)
class Choice:
    """Which controller to try.

    Attributes:
        kind: ``mpc``, ``policy`` or ``pd``.
        presets: of ``mpc``, tried in this order until one does not fall.
        policy: the ONNX file of ``policy``.
        steer: of ``policy``: gain by which the velocity command is turned toward the reference's place [1/s].
    """

    kind: Kind = "mpc"
    presets: tuple[str, ...] = ("A", "B")
    policy: Path | None = None
    steer: float = 0.0


@dataclass(frozen=True)
class Job:
    """One trial.

    Attributes:
        robot: path of the robot.toml.
        motion: what to follow.
        conditions: under which.
        choice: by which controller.
        seed: of everything random in it.
        start: where the rollout begins.
        threads: for the rollouts within the controller.
    """

    robot: Path
    motion: RobotMotion
    conditions: Conditions
    choice: Choice
    seed: tuple[int, ...]
    start: Start = "clip"
    threads: int = 1


@dataclass(frozen=True)
class Trials:
    """What became of the trials of one clip under one set of conditions.

    Attributes:
        conditions: name of the conditions.
        start: where the rollouts began.
        start_frame: frame of the clip at which they began.
        rollouts: one a trial: the first that did not fall, else that of the last controller tried.
        stop_frame: frame of the clip before which they were to end; None for the clip's end.
    """

    conditions: str
    start: Start
    start_frame: int
    rollouts: tuple[Rollout, ...]
    stop_frame: int | None = None

    @property
    def success(self) -> float:
        """Share of the trials that reached the end by the paper's rule."""
        return float(np.mean([rollout.tracking.success for rollout in self.rollouts]))

    def mean(self, name: str) -> float:
        """Mean of one figure of the trackings over the trials."""
        return float(np.mean([getattr(rollout.tracking, name) for rollout in self.rollouts]))

    def to_json(self) -> dict[str, Any]:
        """Everything, ready for ``json.dumps``."""
        names = ("g_mpbpe", "mpbpe", "mpjpe", "mpjpe_norm", "alive", "saturated", "over_speed")
        return {
            "conditions": self.conditions,
            "start": self.start,
            "start_frame": self.start_frame,
            "stop_frame": self.stop_frame,
            "success": self.success,
            "success_full": self.mean("success_full"),
            **{name: self.mean(name) for name in names},
            "trials": [{"controller": r.controller, **r.tracking.to_json()} for r in self.rollouts],
        }


Report = Callable[[str, int, int], None]


def run_jobs(jobs: Sequence[Job], workers: int, report: Report | None = None) -> list[Rollout]:
    """Run trials in order, several at a time in processes of their own.

    The results do not depend on the number of workers: every trial has its own seed and its own simulation.

    Args:
        jobs: the trials.
        workers: how many processes.
        report: called with what is going on, how much of it is done and how much there is.

    Raises:
        RolloutError: a process was killed.
    """
    if workers == 1 or len(jobs) == 1:
        return [run_job(job, report, f" {k + 1} of {len(jobs)}" if len(jobs) > 1 else "") for k, job in enumerate(jobs)]
    done: dict[int, Rollout] = {}
    for index, future in in_processes(run_job, jobs, workers):
        done[index] = future.result()
        if report is not None:
            report("rollouts", len(done), len(jobs))
    return [done[index] for index in range(len(jobs))]


def run_job(job: Job, report: Report | None = None, which: str = "") -> Rollout:
    """Run one trial: every controller of the choice in turn, until one does not fall.

    Args:
        job: the trial.
        report: as in ``run_jobs``; it counts control ticks.
        which: trial of how many, for the report.
    """
    robot = _robot(job.robot, job.motion.joint_names)
    wanted: Reference = reference(job.motion, robot)
    rollout: Rollout | None = None
    for controller in _controllers(job, robot):
        ticked = None if report is None else partial(report, f"rollout{which} ({controller.name})")
        rollout = roll_out(wanted, controller, job.conditions, seed=job.seed, start=job.start, progress=ticked)
        if rollout.tracking.success:
            break
    assert rollout is not None
    return rollout


def _controllers(job: Job, robot: Robot) -> list[Controller]:
    choice = job.choice
    if choice.kind == "pd":
        return [OpenLoop()]
    if choice.kind == "policy":
        assert choice.policy is not None
        return [load_policy(choice.policy, robot, choice.steer)]
    return [Mpc(robot, PRESETS[name], job.threads) for name in choice.presets]


@lru_cache(maxsize=4)
def _robot(path: Path, joint_names: tuple[str, ...]) -> Robot:
    robot = load_robot(path)
    return robot if robot.joint_names == joint_names else reduce_robot(robot, joint_names)
