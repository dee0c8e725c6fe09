"""A clip made ready to be looked at: where everything is, what it measures, what is wrong with it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gmr_traj.contacts.detect import detect
from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.exceptions import ClipError
from gmr_traj.metrics.artefact import Artefact
from gmr_traj.metrics.artefacts import find_artefacts
from gmr_traj.metrics.observation import Observation, observe
from gmr_traj.metrics.signals import Signal, signals
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot


@dataclass(frozen=True)
class ContactForces:
    """Forces of the floor on a robot, as a simulation gives them; a force of zero is a contact that is not there.

    Attributes:
        points: where they act, in the world [m].  # (T, K, 3)
        forces: in the world [N].  # (T, K, 3)

    Raises:
        ClipError: the two differ in shape, are not (T, K, 3), or hold values that are not finite.
    """

    points: np.ndarray
    forces: np.ndarray

    def __post_init__(self) -> None:
        shapes = (np.shape(self.points), np.shape(self.forces))
        if shapes[0] != shapes[1] or len(shapes[0]) != 3 or shapes[0][2] != 3:
            raise ClipError(f"contact forces: points have shape {shapes[0]}, forces {shapes[1]}; expected (T, K, 3)")
        if not (np.isfinite(self.points).all() and np.isfinite(self.forces).all()):
            raise ClipError("contact forces: a point or a force is not finite")


@dataclass(frozen=True)
class Track:
    """One clip, as it is shown.

    Attributes:
        name: what it is called: ``raw``, ``refined``, ``rollout``, or the name of its file.
        raised: how far it was raised to stand on the floor [m].
        observation: the clip, raised.
        schedule: its stances; nothing is left to raise.
        signals: what the plots show.
        artefacts: what is wrong with it, worst first.
        forces: contact forces, where it comes from a simulation.
    """

    name: str
    raised: float
    observation: Observation
    schedule: ContactSchedule
    signals: tuple[Signal, ...]
    artefacts: tuple[Artefact, ...]
    forces: ContactForces | None = None

    @property
    def motion(self) -> RobotMotion:
        """The clip, raised."""
        return self.observation.motion

    @property
    def robot(self) -> Robot:
        """Its robot, reduced to the clip's joints."""
        return self.observation.robot

    @property
    def time(self) -> np.ndarray:
        """Seconds from the start, one a frame.  # (T,)"""
        return np.arange(self.motion.frames) / self.motion.fps

    def frame(self, time: float) -> int:
        """The frame shown at ``time`` [s]: the latest that has begun; the first before, the last after the clip."""
        return int(np.clip(np.floor(time * self.motion.fps + 1e-6), 0, self.motion.frames - 1))

    def worst(self, around: float | None = None, within: float = 1.0) -> Artefact | None:
        """The worst artefact (of those that do not last all the clip), or the worst near a time.

        Args:
            around: time [s]; None for anywhere.
            within: how far from it an artefact may be [s].
        """
        for artefact in self.artefacts:
            if artefact.kind == "height":
                continue
            if around is None or artefact.begin - within <= around <= artefact.end + within:
                return artefact
        return None


def track(
    name: str,
    motion: RobotMotion,
    robot: Robot,
    schedule: ContactSchedule | None = None,
    *,
    level: bool = True,
    forces: ContactForces | None = None,
) -> Track:
    """Observe a clip for showing.

    Args:
        name: what to call it.
        motion: the clip.
        robot: its robot.
        schedule: its stances; detected where none is given.
        level: whether to raise the clip by the schedule's height, so that it stands on the floor.
        forces: contact forces, where there are any; they are raised with the clip.

    Raises:
        ClipError: the clip's joints are not the robot's, or the forces have another number of frames.
        ScheduleError: the schedule does not fit the clip or the robot.
    """
    schedule = detect(motion, robot) if schedule is None else schedule
    height = schedule.height if level else 0.0
    if forces is not None:
        if len(forces.points) != motion.frames:
            raise ClipError(f"the contact forces have {len(forces.points)} frames, the clip {motion.frames}")
        forces = replace(forces, points=forces.points + np.array([0.0, 0.0, height]))
    seen = observe(motion, robot)
    artefacts = find_artefacts(seen, schedule)
    if height:
        seen = seen.raised(height)
    return Track(
        name=name,
        raised=height,
        observation=seen,
        schedule=replace(schedule, height=0.0),
        signals=signals(seen, schedule),
        artefacts=artefacts,
        forces=forces,
    )
