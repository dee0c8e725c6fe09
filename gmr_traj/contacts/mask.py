"""A schedule as a table of booleans: frames by sole points, or by the points of the other supports."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gmr_traj.contacts.schedule import LIMB, ContactSchedule, Stance
from gmr_traj.robot import Robot
from gmr_traj.runs import runs

#: Sole or other support, index of the point in it, part of the sole.
Owner = tuple[str, int, str]


def owners(robot: Robot) -> list[Owner]:
    """Whose each of a robot's K sole points is, one sole after the other."""
    return [(sole.name, k, part) for sole in robot.soles for k, part in enumerate(sole.parts)]


def limb_owners(robot: Robot) -> list[Owner]:
    """Whose each of the L points of a robot's other supports is, one support after the other."""
    return [(support.name, k, LIMB) for support in robot.supports for k in range(len(support.points))]


def to_mask(schedule: ContactSchedule, robot: Robot) -> np.ndarray:
    """Which sole point is in stance when.  # (T, K) bool"""
    return _mask(schedule, owners(robot), limbs=False)


def limbs_to_mask(schedule: ContactSchedule, robot: Robot) -> np.ndarray:
    """Which point of the other supports is in stance when.  # (T, L) bool"""
    return _mask(schedule, limb_owners(robot), limbs=True)


def from_mask(
    schedule: ContactSchedule, robot: Robot, resting: np.ndarray, limbs: np.ndarray | None = None
) -> ContactSchedule:
    """The schedule with other stances of the soles, and of the other supports where ``limbs`` (T, L) is given."""
    stances = _stances(owners(robot), resting)
    if limbs is None:
        stances += [stance for stance in schedule.stances if stance.part == LIMB]
    else:
        stances += _stances(limb_owners(robot), limbs)
    return replace(schedule, stances=tuple(sorted(stances)))


def _mask(schedule: ContactSchedule, whose: list[Owner], limbs: bool) -> np.ndarray:
    column = {owner[:2]: k for k, owner in enumerate(whose)}
    resting = np.zeros((schedule.frames, len(column)), bool)
    for stance in (s for s in schedule.stances if (s.part == LIMB) == limbs):
        resting[stance.start : stance.stop, column[stance.sole, stance.point]] = True
    return resting


def _stances(whose: list[Owner], resting: np.ndarray) -> list[Stance]:
    return [Stance(*owner, start, stop) for owner, on in zip(whose, resting.T, strict=True) for start, stop in runs(on)]
