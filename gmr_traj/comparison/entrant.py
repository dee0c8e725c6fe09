"""One clip of a comparison, and several cut to what they have in common."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gmr_traj.exceptions import ClipError
from gmr_traj.metrics.observation import Observation, observe
from gmr_traj.motion import RobotMotion
from gmr_traj.references import BodyTargets
from gmr_traj.resampling import frames_within, resample, same_rate
from gmr_traj.robot import Robot
from gmr_traj.robot_loading import reduce_robot


@dataclass(frozen=True)
class Entrant:
    """A clip that is compared.

    Attributes:
        name: what to call it.
        motion: its motion.
        references: where its bodies should be, where its file says so.
    """

    name: str
    motion: RobotMotion
    references: BodyTargets | None = None


@dataclass(frozen=True)
class Aligned:
    """A clip on the seconds that all clips have.

    Attributes:
        name: what it is called.
        own: at its own frame rate, with the joints of any of the clips (those it lacks are at zero).
        shared: at the frame rate that all share.
        joints: at its own frame rate, with the joints that all clips have.
    """

    name: str
    own: Observation
    shared: Observation
    joints: Observation


@dataclass(frozen=True)
class Field:
    """All clips of a comparison, aligned.

    Attributes:
        clips: the clips.
        robot: their robot, with the joints of any of them.
        bodies: bodies that are moved by joints which all clips have.
        fps: the lowest of the clips' frame rates [Hz].
        frames: number of frames at that rate.
        notes: what was done to align them, one sentence each.
    """

    clips: tuple[Aligned, ...]
    robot: Robot
    bodies: tuple[str, ...]
    fps: float
    frames: int
    notes: tuple[str, ...]


def align(
    entrants: Sequence[Entrant],
    robot: Robot,
    seconds: tuple[float, float] | None = None,
    source_end: float | None = None,
) -> Field:
    """Cut clips to the seconds they share; all are taken to begin at the same moment.

    Args:
        entrants: the clips, at least one.
        robot: their robot, with all its joints.
        seconds: stretch of every clip to compare, from and to [s]; all of it by default.
        source_end: time of the last frame of the human motion, counted from the same beginning [s]; None without one.

    Raises:
        ClipError: there are no clips, two have one name, a clip is of another robot, or nothing is left of one.
    """
    if not entrants:
        raise ClipError("there are no clips to compare")
    twice = next((e.name for k, e in enumerate(entrants) if e.name in [o.name for o in entrants[:k]]), None)
    if twice is not None:
        raise ClipError(f"two clips are called {twice!r}; give each a name of its own (--names)")
    other = next((e for e in entrants if e.motion.robot not in ("", robot.name)), None)
    if other is not None:
        raise ClipError(
            f"{other.name} is a motion of {other.motion.robot}, not of {robot.name}; only one robot's can be compared"
        )
    notes: list[str] = []
    if seconds is not None:
        entrants = [_cut(entrant, *seconds) for entrant in entrants]
        notes.append(f"compared from {seconds[0]:g} s to {seconds[1]:g} s of each clip")
    lasts = [(e.motion.frames - 1) / e.motion.fps for e in entrants]
    rates = [e.motion.fps for e in entrants]
    shortest, slowest = min(lasts), min(rates)
    if max(lasts) - shortest > 0.5 / max(rates):
        listed = ", ".join(f"{e.name} {e.motion.duration:.2f} s" for e in entrants)
        notes.append(f"the clips differ in length ({listed}); compared over the first {shortest:.2f} s of each")
    if source_end is not None and source_end < shortest:
        if source_end < shortest - 0.5 / max(rates):
            notes.append(f"the human motion ends before the clips; compared over the first {source_end:.2f} s")
        shortest = source_end
    if not same_rate(max(rates), slowest):
        listed = ", ".join(f"{e.name} {e.motion.fps:g} Hz" for e in entrants)
        notes.append(f"frame rates differ ({listed}); what is compared frame by frame is at {slowest:g} Hz")
    everything, common = _joints(entrants, robot)
    if everything != common:
        absent = ", ".join(name for name in everything if name not in common)
        notes.append(f"not all clips have {absent}; joints are compared on the {len(common)} that all have")
    full, least = _with_joints(robot, everything), _with_joints(robot, common)
    # Rates that are as good as equal count the same frames, or the last one may be missing from some of the clips.
    frames = min(
        frames_within(shortest, slowest), *(e.motion.frames for e in entrants if same_rate(e.motion.fps, slowest))
    )
    return Field(
        clips=tuple(_aligned(entrant, full, least, shortest, slowest, frames) for entrant in entrants),
        robot=full,
        bodies=_moved_by(full, frozenset(common)),
        fps=slowest,
        frames=frames,
        notes=tuple(notes),
    )


def cut_frames(seconds: tuple[float, float], fps: float, frames: int, name: str) -> slice:
    """The frames of a stretch of a clip.

    Raises:
        ClipError: there are none.
    """
    start, stop = (round(s * fps) for s in seconds)
    if not 0 <= start < min(stop, frames):
        raise ClipError(
            f"{name}: has no frames from {seconds[0]:g} s to {seconds[1]:g} s; it lasts {frames / fps:.2f} s"
        )
    return slice(start, min(stop, frames))


def cut_targets(targets: BodyTargets, span: slice) -> BodyTargets:
    """Body targets of some of the frames."""
    return replace(targets, positions=targets.positions[span], quaternions=targets.quaternions[span])


def _cut(entrant: Entrant, start: float, stop: float) -> Entrant:
    motion, references = entrant.motion, entrant.references
    span = cut_frames((start, stop), motion.fps, motion.frames, entrant.name)
    if references is not None:
        references = cut_targets(references, span)
    return replace(entrant, motion=motion.with_qpos(motion.qpos[span]), references=references)


def _joints(entrants: Sequence[Entrant], robot: Robot) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The joints any of the clips has, and those all have."""
    sets = [set(entrant.motion.joint_names) for entrant in entrants]
    any_of, all_of = set.union(*sets), set.intersection(*sets)
    return tuple(n for n in robot.joint_names if n in any_of), tuple(n for n in robot.joint_names if n in all_of)


def _with_joints(robot: Robot, names: tuple[str, ...]) -> Robot:
    return robot if names == robot.joint_names else reduce_robot(robot, names)


def _moved_by(robot: Robot, joints: frozenset[str]) -> tuple[str, ...]:
    """The bodies between which and the base there is no joint but these."""
    found = []
    for b in range(1, robot.model.nbody):
        body, good = b, True
        while body > 1 and good:
            first, count = int(robot.model.body_jntadr[body]), int(robot.model.body_jntnum[body])
            good = not count or robot.model.joint(first).name in joints
            body = int(robot.model.body_parentid[body])
        if good:
            found.append(robot.body_names[b - 1])
    return tuple(found)


def _aligned(entrant: Entrant, full: Robot, least: Robot, last: float, fps: float, frames: int) -> Aligned:
    whole = entrant.motion
    cut = whole.with_qpos(whole.qpos[: min(whole.frames, frames_within(last, whole.fps))])
    own = observe(_in_joints(cut, full), full)
    if same_rate(cut.fps, fps) and cut.frames == frames:
        shared = own
    else:  # of the whole clip: what it was cut to may end before the last frame that is shared
        slow = resample(_in_joints(whole, full), fps)
        shared = observe(slow.with_qpos(slow.qpos[:frames]), full)
    joints = own if full.joint_names == least.joint_names else observe(_in_joints(cut, least), least)
    return Aligned(entrant.name, own, shared, joints)


def _in_joints(motion: RobotMotion, robot: Robot) -> RobotMotion:
    """A motion of the robot's joints; those that it does not have are at zero, as they are when locked."""
    qpos = np.zeros((motion.frames, 7 + robot.dof))
    qpos[:, :7] = motion.qpos[:, :7]
    for k, name in enumerate(robot.joint_names):
        if name in motion.joint_names:
            qpos[:, 7 + k] = motion.qpos[:, 7 + motion.joint_names.index(name)]
    return RobotMotion(qpos, motion.fps, robot.joint_names, robot.name)
