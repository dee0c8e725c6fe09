"""`gmr-traj verify`: can the robot follow a clip?"""

from __future__ import annotations

import json
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from gmr_traj._version import __version__
from gmr_traj.cli import verify_tables
from gmr_traj.cli.clip_files import clip_files
from gmr_traj.cli.compare import short_names
from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.cli.loading import load
from gmr_traj.cli.terminal import console, progress
from gmr_traj.cli.verify_arguments import Verify
from gmr_traj.cli.verify_plan import Plan, make_plan
from gmr_traj.cli.verify_saving import check_free, record, save
from gmr_traj.comparison.entrant import cut_frames
from gmr_traj.exceptions import ClipError, GmrTrajError
from gmr_traj.formats import Clip
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot
from gmr_traj.robot_loading import load_robot
from gmr_traj.verify.audit import Audit, audit
from gmr_traj.verify.policy import load_policy
from gmr_traj.verify.stable import StableSpan, stable_span
from gmr_traj.verify.trials import Job, Trials, run_jobs


@dataclass(frozen=True)
class Verified:
    """What is known of one clip.

    Attributes:
        path: the file.
        name: what to call it: as short as tells it from the others.
        clip: what it held.
        motion: the stretch that was verified.
        audit: of its dynamics.
        sought: whether it was asked where to begin and to end.
        stable: where that is; None where there is no such place.
        trials: rollouts, one entry for each of the conditions and start frames.
    """

    path: Path
    name: str
    clip: Clip
    motion: RobotMotion
    audit: Audit
    sought: bool
    stable: StableSpan | None
    trials: tuple[Trials, ...]

    @property
    def passed(self) -> bool:
        """Whether the audit passes, no rollout fell, and there is where to begin where that was asked for."""
        begun = self.stable is not None or not self.sought
        return self.audit.passed and begun and all(trials.success == 1.0 for trials in self.trials)

    def to_json(self, frames: bool) -> dict[str, Any]:
        """Everything, ready for ``json.dumps``."""
        return {
            "clip": str(self.path),
            "format": self.clip.format,
            "robot": self.clip.motion.robot,
            "notes": list(self.clip.notes),
            "frames": self.motion.frames,
            "fps": self.motion.fps,
            "passed": self.passed,
            "audit": self.audit.to_json(frames),
            **({"stable": None if self.stable is None else asdict(self.stable)} if self.sought else {}),
            "rollouts": [trials.to_json() for trials in self.trials],
        }


def run(arguments: Verify) -> int:
    """Verify every clip and print what was found.

    A file that cannot be read is reported on stderr, one line each, and the others still are verified.

    Returns:
        The exit code: 0 where every clip passes, 5 where one fails, that of bad input where a file cannot be read.

    Raises:
        GmrTrajError: the robot cannot be loaded, a path does not exist, an argument is out of range.
    """
    plan = make_plan(arguments)
    paths = tuple({path.absolute(): path for path in clip_files(list(arguments.clips))}.values())
    # A robot or a policy that cannot be loaded is one error, not one for each clip.
    robot = load_robot(arguments.robot)
    if arguments.policy is not None:
        load_policy(arguments.policy, robot, arguments.steer)
    found: list[Verified] = []
    unreadable: list[tuple[Path, str]] = []
    for path, name in zip(paths, short_names(paths), strict=True):
        try:
            clip, robot = load(path, arguments)
            verified = verify_clip(path, clip, robot, arguments, plan, name)
            if arguments.save is not None:
                save(name, verified.trials, robot, arguments.save)
            if arguments.rerun is not None and verified.trials:
                record(path.stem, verified.motion, verified.trials, robot, arguments.rerun)
            found.append(verified)
        except (GmrTrajError, OSError) as error:
            line = " ".join(str(error).split())
            unreadable.append((path, line if str(path) in line else f"{path}: {line}"))
    if arguments.json:
        report = {
            **_how(arguments),
            "clips": [verified.to_json(arguments.frames) for verified in found],
            "unreadable": [{"clip": str(path), "error": line} for path, line in unreadable],
        }
        print(json.dumps(report, indent=2, allow_nan=False))
    elif found:
        verify_tables.show(console(), found, arguments.top)
    for _, line in unreadable:
        print(f"gmr-traj: error: {line}", file=sys.stderr)
    if unreadable:
        return ExitCode.BAD_INPUT
    return ExitCode.OK if all(verified.passed for verified in found) else ExitCode.NOT_FOLLOWED


def _how(arguments: Verify) -> dict[str, Any]:
    """What the rollouts depend on beside the clips and the conditions."""
    import mujoco

    return {
        "gmr_traj": __version__,
        "mujoco": mujoco.__version__,
        "controller": arguments.controller,
        "preset": arguments.preset if arguments.controller == "mpc" else None,
        "policy": None if arguments.policy is None else str(arguments.policy),
        "steer": arguments.steer,
        "seed": arguments.seed,
    }


def verify_clip(path: Path, clip: Clip, robot: Robot, arguments: Verify, plan: Plan, name: str = "") -> Verified:
    """Verify one clip that was read.

    Raises:
        ClipError: it has no frames in the stretch that is asked for, or from a start frame on.
        GmrTrajError: a file that is to be written exists.
        RolloutError: a process was killed.
        SolverError: the contact forces of a frame could not be found.
    """
    motion = clip.motion
    if arguments.seconds is not None:
        motion = motion.with_qpos(motion.qpos[cut_frames(arguments.seconds, motion.fps, motion.frames, str(path))])
    audited = audit(motion, robot)
    sought, stop = plan.starts is None, motion.frames
    stable, starts = (stable_span(audited) if sought else None), plan.starts or ()
    if stable is not None:
        starts, stop = (stable.start,), stable.stop
    if plan.choice is None or not starts:
        return Verified(path, name, clip, motion, audited, sought, stable, ())
    late = next((frame for frame in starts if frame > motion.frames - 2), None)
    if late is not None:
        raise ClipError(f"has {motion.frames} frames; a rollout cannot begin at frame {late}")
    cases = [(conditions, frame) for conditions in plan.conditions for frame in starts]
    counts = [arguments.trials if conditions.random else 1 for conditions, _ in cases]
    if arguments.save is not None and not arguments.force:
        check_free(name, arguments.save, [(c.name, f, n) for (c, f), n in zip(cases, counts, strict=True)])
    jobs = [
        (conditions, motion.with_qpos(motion.qpos[frame:stop]), (arguments.seed, trial))
        for (conditions, frame), count in zip(cases, counts, strict=True)
        for trial in range(count)
    ]
    threads = max(1, plan.workers // len(jobs))
    work = [
        Job(robot.path, rest, conditions, plan.choice, seed, arguments.start, threads)
        for conditions, rest, seed in jobs
    ]
    with progress(not arguments.json) as report:
        done = run_jobs(work, plan.workers, report)
    trials, first = [], 0
    for (conditions, frame), count in zip(cases, counts, strict=True):
        own = tuple(done[first : first + count])
        trials.append(Trials(conditions.name, arguments.start, frame, own, stop))
        first += count
    return Verified(path, name, clip, motion, audited, sought, stable, tuple(trials))
