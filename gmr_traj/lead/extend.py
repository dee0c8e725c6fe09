"""A clip with its leads: the motion, its stances and its references, longer at one end or both."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.contacts.schedule import ContactSchedule, Stance
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.lead.blend import minimum_jerk
from gmr_traj.lead.lead_in import Lead, lead_in
from gmr_traj.lead.steps import REST
from gmr_traj.motion import RobotMotion
from gmr_traj.references import BodyTargets
from gmr_traj.robot import Robot


@dataclass(frozen=True)
class Added:
    """What was added at one end of a clip.

    Attributes:
        frames: how many frames.
        replaced: how many of the clip's own frames beside them, a transient, are part of the lead now.
    """

    frames: int
    replaced: int


@dataclass(frozen=True)
class Extended:
    """A clip with its leads.

    Attributes:
        motion: in the input's world.
        schedule: stances of all of it; its height is the input's.
        references: where the bodies should be in all of it; None where the clip has none.
        before, after: what was added at either end; None where nothing was.
    """

    motion: RobotMotion
    schedule: ContactSchedule
    references: BodyTargets | None
    before: Added | None = None
    after: Added | None = None

    @property
    def held(self) -> np.ndarray:
        """The frames in which the robot stands as it does by default, at rest: none at an end that has no lead."""
        frames = np.arange(self.motion.frames)
        first = frames[: REST if self.before is not None else 0]
        return np.concatenate([first, frames[self.motion.frames - (REST if self.after is not None else 0) :]])


@dataclass(frozen=True)
class Leads:
    """How long the leads are [s]: ``before`` the clip and ``after`` it; None for no lead."""

    before: float | None = None
    after: float | None = None


def extend(
    motion: RobotMotion, robot: Robot, schedule: ContactSchedule, leads: Leads, references: BodyTargets | None = None
) -> Extended:
    """Put leads before and after a clip.

    A lead-out is the lead-in of the clip played backwards, which asks the same forces of the floor.

    Args:
        motion: the clip.
        robot: its robot.
        schedule: its stances; its height puts the clip on the floor.
        leads: how long they are.
        references: where the source has the bodies, in the clip's world; in the leads they go over to where the lead
            has them.

    Raises:
        ClipError: a lead is too short for the steps that it takes, or for a joint's limits.
    """
    known = None if references is None else references.of(robot.body_names)
    clip = Extended(motion.shifted(schedule.height), schedule, known and known.raised(schedule.height))
    if leads.before is not None:
        clip = _before(clip, robot, leads.before, "--lead-in")
    if leads.after is not None:
        turned = _before(_backwards(clip), robot, leads.after, "--lead-out")
        clip = replace(_backwards(turned), before=clip.before, after=turned.before)
    return replace(
        clip,
        motion=clip.motion.shifted(-schedule.height),
        references=clip.references and clip.references.raised(-schedule.height),
    )


def _before(clip: Extended, robot: Robot, seconds: float, option: str) -> Extended:
    lead = lead_in(clip.motion, robot, clip.schedule, seconds, option)
    count = len(lead.qpos)
    added = count - lead.replaced
    return Extended(
        motion=clip.motion.with_qpos(np.concatenate([lead.qpos, clip.motion.qpos[lead.replaced :]])),
        schedule=_joined(clip.schedule, lead, added),
        references=None if clip.references is None else _references(clip.references, clip.motion, robot, lead),
        before=Added(added, lead.replaced),
    )


def _joined(schedule: ContactSchedule, lead: Lead, added: int) -> ContactSchedule:
    """The stances of lead and clip; those of one point that meet are one."""
    end = len(lead.qpos)
    stances = list(lead.stances)
    for stance in schedule.stances:
        moved = replace(stance, start=max(stance.start + added, end), stop=stance.stop + added)
        if moved.stop <= moved.start:
            continue
        meets = next((s for s in stances if _same(s, moved) and s.stop == moved.start), None)
        if meets is not None:
            stances.remove(meets)
            moved = replace(moved, start=meets.start)
        stances.append(moved)
    return replace(schedule, frames=schedule.frames + added, stances=tuple(sorted(stances)))


def _same(one: Stance, other: Stance) -> bool:
    return (one.sole, one.point) == (other.sole, other.point)


def _references(references: BodyTargets, motion: RobotMotion, robot: Robot, lead: Lead) -> BodyTargets:
    """The targets with those of the lead: where it has the bodies, moved and turned more and more as the clip's differ.

    A retargeted robot is beside its source's targets by a misfit; it grows from nothing to that of the first frame.
    """
    first = lead.replaced
    slots = [robot.body_names.index(name) for name in references.names]
    positions, rotations = placements(robot, np.concatenate([lead.qpos, motion.qpos[first : first + 1]]))
    reached = references.reached(robot.body_names, positions, rotations)
    share = minimum_jerk(np.arange(len(lead.qpos)) / len(lead.qpos))
    at = reached[:-1] + np.multiply.outer(share, references.positions[first] - reached[-1])
    quaternions = np.empty((len(lead.qpos), len(slots), 4))
    for b, slot in enumerate(slots):
        here = Rotation.from_matrix(rotations[:, slot])
        misfit = (Rotation.from_quat(references.quaternions[first, b], scalar_first=True) * here[-1].inv()).as_rotvec()
        turned = Rotation.from_rotvec(np.multiply.outer(share, misfit)) * here[:-1]
        quaternions[:, b] = turned.as_quat(scalar_first=True)
    return replace(
        references,
        positions=np.concatenate([at, references.positions[first:]]),
        quaternions=np.concatenate([quaternions, references.quaternions[first:]]),
    )


def _backwards(clip: Extended) -> Extended:
    """The clip from its last frame to its first."""
    schedule, references = clip.schedule, clip.references
    stances = [replace(s, start=schedule.frames - s.stop, stop=schedule.frames - s.start) for s in schedule.stances]
    if references is not None:
        references = replace(references, positions=references.positions[::-1], quaternions=references.quaternions[::-1])
    return Extended(
        motion=clip.motion.with_qpos(clip.motion.qpos[::-1]),
        schedule=replace(schedule, stances=tuple(sorted(stances))),
        references=references,
    )
