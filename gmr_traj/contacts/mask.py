"""A schedule as a table of booleans: frames by sole points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gmr_traj.contacts.schedule import ContactSchedule, Stance
from gmr_traj.robot import Robot
from gmr_traj.runs import runs

#: Sole, index of the point in it, part of the sole.
Owner = tuple[str, int, str]


def owners(robot: Robot) -> list[Owner]:
    """Whose each of a robot's K sole points is, one sole after the other."""
    return [(sole.name, k, part) for sole in robot.soles for k, part in enumerate(sole.parts)]


def to_mask(schedule: ContactSchedule, robot: Robot) -> np.ndarray:
    """Which sole point is in stance when.  # (T, K) bool"""
    column = {owner[:2]: k for k, owner in enumerate(owners(robot))}
    resting = np.zeros((schedule.frames, len(column)), bool)
    for stance in schedule.stances:
        resting[stance.start : stance.stop, column[stance.sole, stance.point]] = True
    return resting


def from_mask(schedule: ContactSchedule, robot: Robot, resting: np.ndarray) -> ContactSchedule:
    """The schedule with other stances."""
    stances = [
        Stance(*owner, start, stop)
        for owner, on in zip(owners(robot), resting.T, strict=True)
        for start, stop in runs(on)
    ]
    return replace(schedule, stances=tuple(sorted(stances)))
