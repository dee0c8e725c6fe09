"""`gmr-traj verify`: can the robot follow a clip?"""

from __future__ import annotations

import json
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from gmr_traj.cli import verify_tables
from gmr_traj.cli.clip_files import clip_files
from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.cli.loading import load
from gmr_traj.cli.terminal import console, progress
from gmr_traj.cli.verify_arguments import Verify
from gmr_traj.cli.verify_plan import Plan, make_plan
from gmr_traj.comparison.entrant import cut_frames
from gmr_traj.exceptions import ClipError, GmrTrajError
from gmr_traj.formats import Clip, write_clip
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
        clip: what it held.
        motion: the stretch that was verified.
        audit: of its dynamics.
        stable: where to begin and to end, where that was asked for.
        trials: rollouts, one entry for each of the conditions and start frames.
    """

    path: Path
    clip: Clip
    motion: RobotMotion
    audit: Audit
    stable: StableSpan | None
    trials: tuple[Trials, ...]

    @property
    def passed(self) -> bool:
        """Whether the audit passes and no rollout fell."""
        return self.audit.passed and all(trials.success == 1.0 for trials in self.trials)

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
            **({"stable": asdict(self.stable)} if self.stable is not None else {}),
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
    # A robot or a policy that cannot be loaded is one error, not one for each clip.
    robot = load_robot(arguments.robot)
    if arguments.policy is not None:
        load_policy(arguments.policy, robot, arguments.steer)
    found: list[Verified] = []
    unreadable: list[tuple[Path, str]] = []
    for path in clip_files(list(arguments.clips)):
        try:
            clip, robot = load(path, arguments)
            verified = verify_clip(path, clip, robot, arguments, plan)
            if arguments.save is not None:
                save(verified, robot, arguments.save, arguments.force)
            if arguments.rerun is not None:
                record(verified, robot, arguments.rerun)
            found.append(verified)
        except (GmrTrajError, OSError) as error:
            line = " ".join(str(error).split())
            unreadable.append((path, line if str(path) in line else f"{path}: {line}"))
    if arguments.json:
        report = {
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


def verify_clip(path: Path, clip: Clip, robot: Robot, arguments: Verify, plan: Plan) -> Verified:
    """Verify one clip that was read.

    Raises:
        ClipError: it has no frames in the stretch that is asked for, or from a start frame on.
        SolverError: the contact forces of a frame could not be found.
    """
    motion = clip.motion
    if arguments.seconds is not None:
        motion = motion.with_qpos(motion.qpos[cut_frames(arguments.seconds, motion.fps, motion.frames, str(path))])
    audited = audit(motion, robot)
    stable, starts = None, plan.starts
    if starts is None:
        stable = stable_span(audited)
        if stable is None:
            raise ClipError("there is nowhere to begin: no stretch of it is stable")
        starts = (stable.start,)
    if plan.choice is None:
        return Verified(path, clip, motion, audited, stable, ())
    late = next((frame for frame in starts if frame > motion.frames - 2), None)
    if late is not None:
        raise ClipError(f"has {motion.frames} frames; a rollout cannot begin at frame {late}")
    cases = [(conditions, frame) for conditions in plan.conditions for frame in starts]
    jobs, counts = [], []
    for conditions, frame in cases:
        counts.append(arguments.trials if conditions.random else 1)
        for trial in range(counts[-1]):
            rest = motion.with_qpos(motion.qpos[frame:])
            seed = (arguments.seed, trial)
            jobs.append((conditions, rest, seed))
    threads = max(1, plan.workers // len(jobs))
    work = [
        Job(robot.path, rest, conditions, plan.choice, seed, arguments.start, threads)
        for conditions, rest, seed in jobs
    ]
    with progress(not arguments.json) as report:
        done = run_jobs(work, plan.workers, report)
    trials, first = [], 0
    for (conditions, frame), count in zip(cases, counts, strict=True):
        trials.append(Trials(conditions.name, arguments.start, frame, tuple(done[first : first + count])))
        first += count
    return Verified(path, clip, motion, audited, stable, tuple(trials))


def save(verified: Verified, robot: Robot, folder: Path, force: bool) -> None:
    """Write what the robot did in each rollout.

    Raises:
        GmrTrajError: a file exists and may not be overwritten.
    """
    for trials in verified.trials:
        for k, rollout in enumerate(trials.rollouts):
            name = f"{verified.path.stem}_{trials.conditions}_frame{trials.start_frame}_trial{k}.npz"
            target = folder / name
            if target.exists() and not force:
                raise GmrTrajError(f"{target}: this file exists; overwrite it with --force")
            write_clip(Clip(rollout.motion, "gmr-traj"), target, robot=robot)


def record(verified: Verified, robot: Robot, path: Path) -> None:
    """Write a recording: the clip, and beside it the first rollout under each of the conditions."""
    from gmr_traj.track import track
    from gmr_traj.viewer import Scene
    from gmr_traj.viewer import save as save_recording

    begun = verified.trials[0].start_frame
    clip = verified.motion.with_qpos(verified.motion.qpos[begun:])
    tracks = [track("clip", clip, robot, level=False)]
    for trials in verified.trials:
        if trials.start_frame == begun:
            first = trials.rollouts[0]
            name = f"rollout {trials.conditions}"
            tracks.append(track(name, first.motion, robot, level=False, forces=first.forces))
    save_recording(Scene(title=path.stem, tracks=tuple(tracks)), path)
