"""What `tools/segments_table.py` does with one clip: which audits and rollouts there are, and doing one of them."""

from __future__ import annotations

import argparse
import hashlib
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from segment_results import Line

from gmr_traj.cli.clip_files import clip_files
from gmr_traj.contacts.detect import detect
from gmr_traj.exceptions import GmrTrajError
from gmr_traj.formats import read_clip
from gmr_traj.formats.clip import CLIP_SUFFIXES
from gmr_traj.lead.lead_in import spoiled
from gmr_traj.robot import Robot
from gmr_traj.robot_loading import load_robot, reduce_robot
from gmr_traj.verify.audit import audit
from gmr_traj.verify.conditions import load_conditions
from gmr_traj.verify.trials import Choice, Job, run_job

AFTER = 0.2  # [s] where the rollouts of a clip begin whose first frames are a transient
SHORTEST = 3.0  # [s] of a stretch of its own


@dataclass(frozen=True)
class Work:
    """One audit or one rollout.

    Attributes:
        id: hash of all that its result depends on.
        clip, variant: what it is of.
        segment: first frame and the one after the last; the whole clip for an audit.
        job: the rollout; its motion is what is audited.
        audited: whether it is an audit.
    """

    id: str
    clip: str
    variant: str
    segment: tuple[int, int]
    job: Job
    audited: bool


def inputs(given: Sequence[str]) -> Iterator[tuple[Path, float | None]]:
    """Raw clips, and how much of each [s].

    Raises:
        ClipError: there are none where one is named.
    """
    for text in given:
        path, sign, seconds = text.rpartition("@")
        numeric = sign and seconds.replace(".", "", 1).isdecimal()
        for clip in clip_files([Path(path if numeric else text)]):
            yield clip, float(seconds) if numeric else None


def clip_work(
    path: Path, seconds: float | None, variants: dict[str, Path], arguments: argparse.Namespace
) -> Iterator[Work]:
    """Audits and rollouts of one clip in all variants.

    Raises:
        GmrTrajError: a clip is missing, cannot be read, or is of another length or rate than the raw one.
    """
    robot = load_robot(arguments.robot)
    whole = read_clip(path, robot).motion
    if whole.joint_names != robot.joint_names:
        robot = reduce_robot(robot, whole.joint_names)
    frames = whole.frames if seconds is None else min(whole.frames, round(seconds * whole.fps))
    raw = whole.with_qpos(whole.qpos[:frames])
    motions, own = {"raw": raw}, True
    for name, folder in variants.items():
        place = refined_clip(path, folder)
        motion = read_clip(place, robot, fps=whole.fps).motion
        if motion.frames not in (frames, whole.frames) or motion.joint_names != whole.joint_names:
            raise GmrTrajError(
                f"{place}: has {motion.frames} frames and {len(motion.joint_names)} joints; expected {frames} frames"
                f" (or {whole.frames}) and {len(whole.joint_names)} joints, as {path} has"
            )
        own = own and motion.frames == whole.frames
        motions[name] = motion.with_qpos(motion.qpos[:frames])
    motions["raw"] = raw.shifted(detect(whole if own else raw, robot).height)
    parts = segments(frames, whole.fps, arguments.seconds, AFTER if spoiled(raw) else 0.0)
    presets = ("A", "B") if arguments.preset == "auto" else (arguments.preset,)
    choice, conditions = Choice(presets=presets), load_conditions(arguments.conditions)
    name = f"{path.parent.name}/{path.stem}"
    for kind, motion in motions.items():
        job = Job(robot.path, motion, conditions, choice, (0, 0))
        yield Work(identity(job, robot, True), name, kind, (0, frames), job, True)
        for first, stop in [] if arguments.audits else parts:
            cut = replace(job, motion=motion.with_qpos(motion.qpos[first:stop]))
            yield Work(identity(cut, robot, False), name, kind, (first, stop), cut, False)


def refined_clip(raw: Path, folder: Path) -> Path:
    """The refined clip of a raw one in the folder of a variant.

    Raises:
        GmrTrajError: there is none, or more than one.
    """
    stems = (raw.stem, f"{raw.stem}_refined", raw.name.replace(".", "_"))
    for place in (folder / raw.parent.name, folder):
        found = [place / f"{stem}{suffix}" for stem in stems for suffix in CLIP_SUFFIXES]
        found = [path for path in found if path.is_file() and not path.samefile(raw)]
        if len(found) > 1:
            raise GmrTrajError(f"{raw}: more than one refined clip of it: {', '.join(map(str, found))}; keep one")
        if found:
            return found[0]
    raise GmrTrajError(f"{raw}: no refined clip of it in {folder}; expected {', '.join(f'{stem}.*' for stem in stems)}")


def segments(frames: int, fps: float, seconds: float, begin: float) -> list[tuple[int, int]]:
    """First frame and the one after the last of stretches that follow one another.

    Consecutive ones share no frame.  What is left at the end is a stretch of its own from ``SHORTEST`` on, else it
    belongs to the one before.
    """
    first, length = round(begin * fps), round(seconds * fps)
    starts = list(range(first, frames, length))
    if len(starts) > 1 and frames - starts[-1] < SHORTEST * fps:
        starts.pop()
    return list(zip(starts, [*starts[1:], frames], strict=True))


def identity(job: Job, robot: Robot, audited: bool) -> str:
    """Hash of what a result depends on."""
    motion = job.motion
    digest = hashlib.sha256(np.ascontiguousarray(motion.qpos).tobytes())
    settled = (audited, motion.fps, motion.joint_names, robot.name, job.conditions, job.choice, job.seed)
    digest.update(repr(settled[:4] if audited else settled).encode())
    return digest.hexdigest()[:20]


def result(one: Work) -> Line:
    """The result of one audit or rollout.

    Raises:
        SolverError: the contact forces of a frame could not be found.
    """
    begun = time.process_time()
    motion = one.job.motion
    line: Line = {"id": one.id, "clip": one.clip, "variant": one.variant, "segment": list(one.segment)}
    if one.audited:
        robot = load_robot(one.job.robot)
        robot = robot if robot.joint_names == motion.joint_names else reduce_robot(robot, motion.joint_names)
        return line | {"frames": motion.frames} | audit(motion, robot).summary()
    rollout = run_job(one.job)
    line |= {"controller": rollout.controller, "conditions": one.job.conditions.name}
    return line | rollout.tracking.to_json() | {"cpu": round(time.process_time() - begun, 3)}
