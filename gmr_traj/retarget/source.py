"""The human motion that a clip is a retarget of: when its feet are in contact, where it has the robot's bodies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gmr_traj.contacts.schedule import ContactSchedule, Stance
from gmr_traj.exceptions import ScheduleError
from gmr_traj.human_motion import HumanMotion
from gmr_traj.metrics.intervals import intervals
from gmr_traj.references import BodyTargets
from gmr_traj.retarget.body_map import BodyMap
from gmr_traj.retarget.targets import scaled_targets
from gmr_traj.robot import Robot


@dataclass(frozen=True)
class Source:
    """A human motion as a robot can use it.

    Attributes:
        name: what to call it.
        schedule: its contacts, as stances of the robot's soles, at its frame rate.
        targets: where the scaled person has the robot's bodies, at its frame rate.
    """

    name: str
    schedule: ContactSchedule
    targets: BodyTargets

    @property
    def fps(self) -> float:
        """Its frame rate [Hz]."""
        return self.schedule.fps


def as_source(name: str, human: HumanMotion, robot: Robot, body_map: BodyMap) -> Source:
    """A human motion as the source of clips.

    Args:
        name: what to call it.
        human: the motion.
        robot: the robot of the clips.
        body_map: scales the person, and says which joint moves the bodies of the soles.

    Raises:
        MapError: the map does not fit the motion, or gives the body of a sole no joint.
        ScheduleError: the motion does not say when that joint is in contact.
    """
    return Source(name, person_schedule(human, robot, body_map), scaled_targets(human, body_map))


def person_schedule(human: HumanMotion, robot: Robot, body_map: BodyMap) -> ContactSchedule:
    """Stances of the robot's sole points as the person's feet have them, at the person's frames and frame rate.

    A point of the heel is in stance where the heel joint of the person's foot is in contact, a point of the toe where
    the toe joint is.

    Raises:
        ScheduleError: the map gives the body of a sole no joint, or the joint's contacts are not known.
    """
    stances = []
    for sole in robot.soles:
        joint = next((target.joint for target in body_map.targets if target.body == sole.body), None)
        if joint is None:
            raise ScheduleError(
                f"map {body_map.name} gives body {sole.body!r}, which has a sole, no joint of the person"
            )
        heel, toe = foot_joints(human, joint)
        for k, part in enumerate(sole.parts):
            touching = np.asarray(human.contacts[heel if part == "heel" else toe], dtype=bool)
            stances += [Stance(sole.name, k, part, start, stop) for start, stop in intervals(touching, 1)]
    return ContactSchedule(human.frames, human.fps, tuple(sorted(stances)))


def foot_joints(human: HumanMotion, joint: str) -> tuple[str, str]:
    """The joints at the heel and at the toe of the foot that a joint belongs to, of those with known contacts.

    The joint and the one below it; where there is none below (it is the toe), the one above it and itself; a foot with
    one joint has that twice.

    Raises:
        ClipError: the person has no such joint.
        ScheduleError: nobody says when the joint is in contact.
    """
    k = human.index(joint)
    if joint not in human.contacts:
        known = ", ".join(human.contacts) or "none"
        raise ScheduleError(f"the person's contacts of joint {joint!r} are not known; known are those of {known}")
    below = [name for name, parent in zip(human.names, human.parents, strict=True) if parent == k]
    toe = next((name for name in below if name in human.contacts), None)
    if toe is not None:
        return joint, toe
    above = human.names[human.parents[k]] if human.parents[k] >= 0 else joint
    return (above if above in human.contacts else joint), joint
