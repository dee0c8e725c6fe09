"""Which feet step on the way from standing into the clip, when, and where the floor presses meanwhile."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations

import numpy as np

from gmr_traj.lead.arrival import yaw
from gmr_traj.lead.blend import minimum_jerk
from gmr_traj.lead.feet import Foot, Standing, place_of
from gmr_traj.task import HELD

# The first frames stand still: so many that position, velocity and acceleration are at rest.
REST = HELD
# A foot that stands no farther than this from its place in the clip stays where it is.
NEAR = 0.01  # [m]
TURNED = np.radians(3.0)

# Lengths of the phases at an easy pace [s].
SHIFT = 0.4  # the weight goes over to the first foot
STEP = 0.5  # a foot is in the air
DOUBLE = 0.15  # both feet are down after a step
SWING = 0.4  # a foot that is in the air in the clip has left the floor
PUSH = 0.2  # both feet are in the air in the clip, and the last one has left the floor
# The phases may be this much shorter, and as much longer as there is time, but not longer than ``EASY`` in all [s].
QUICKEST = 0.6
EASY = 1.5


@dataclass(frozen=True)
class Swing:
    """One foot in the air: from ``lifts`` to ``lands`` [s] (None: into the clip), counted from the clip's start."""

    foot: int
    lifts: float
    lands: float | None


@dataclass(frozen=True)
class Steps:
    """The steps of one way into the clip.

    Attributes:
        active: how long before the clip anything begins to move [s].
        swings: the feet that leave the floor.
    """

    active: float
    swings: tuple[Swing, ...]

    def of(self, foot: int) -> Swing | None:
        """The swing of one foot."""
        return next((swing for swing in self.swings if swing.foot == foot), None)


def shortest(feet: tuple[Foot, ...], standing: tuple[Standing, ...]) -> float:
    """The least time that the steps of one way need [s]."""
    return QUICKEST * _length(_moving(feet, standing), _airborne(feet))


def step_plans(feet: tuple[Foot, ...], standing: tuple[Standing, ...], seconds: float) -> list[Steps]:
    """The orders in which the feet may step from where they stand, timed; none where the time is too short.

    First step the feet that stand elsewhere in the clip; then lift those that are in the air there, the lowest last.

    Args:
        feet: in the clip's first frame.
        standing: where they stand before.
        seconds: how long there is.
    """
    moving, airborne = _moving(feet, standing), _airborne(feet)
    length = _length(moving, airborne)
    if seconds < QUICKEST * length:
        return []
    active = min(seconds, max(EASY, 1.5 * length))
    pace = active / length
    plans = []
    for order in permutations(moving):
        swings, now = [], -active + SHIFT * pace
        for foot in order:
            swings.append(Swing(foot, now, now + STEP * pace))
            now += (STEP + DOUBLE) * pace
        for k, foot in enumerate(airborne):
            last = k == len(airborne) - 1 and len(airborne) == len(feet)
            swings.append(Swing(foot, -PUSH * pace if last else now, None))
        plans.append(Steps(active, tuple(swings)))
    return plans


def pressed_at(
    steps: Steps, feet: tuple[Foot, ...], standing: tuple[Standing, ...], end: np.ndarray, times: np.ndarray
) -> np.ndarray:
    """Where the floor should press: amid the feet that are down, on its way from one such place to the next between.

    Args:
        steps: the steps.
        feet: in the clip's first frame.
        standing: where they stand before.
        end: where the clip has it press in its first frame, if all feet stand there [m].  # (2,)
        times: of the frames [s].  # (T,)
    """
    down = {k: foot.middle[:2] for k, foot in enumerate(standing)}
    here, out = np.mean(list(down.values()), axis=0), np.zeros((len(times), 2))
    out[:] = here
    since = -steps.active
    for swing in steps.swings:
        others = [at for k, at in down.items() if k != swing.foot]
        if not others:
            return out  # nothing is on the floor any more
        there = np.mean(others, axis=0)
        _move(out, times, since, swing.lifts, there - here)
        here = there
        if swing.lands is None:
            del down[swing.foot]
            since = swing.lifts
        else:
            down[swing.foot] = place_of(feet[swing.foot], standing[swing.foot]).middle[:2]
            since = swing.lands
    if len(down) == len(feet):
        _move(out, times, since, 0.0, end - here)
    return out


def _move(out: np.ndarray, times: np.ndarray, since: float, until: float, by: np.ndarray) -> None:
    share = (times - since) / max(until - since, 1e-6)
    out += np.multiply.outer(minimum_jerk(share), by)


def _moving(feet: tuple[Foot, ...], standing: tuple[Standing, ...]) -> list[int]:
    """Feet that stand in the clip, but elsewhere."""
    moving = []
    for k, (foot, stands) in enumerate(zip(feet, standing, strict=True)):
        if foot.stands:
            away = float(np.linalg.norm(foot.place - stands.at[:2]))
            turn = foot.heading - yaw(stands.turned.as_matrix())
            if away > NEAR or abs(np.arctan2(np.sin(turn), np.cos(turn))) > TURNED:
                moving.append(k)
    return moving


def _airborne(feet: tuple[Foot, ...]) -> list[int]:
    """Feet in swing in the clip, the highest first."""
    return sorted((k for k, foot in enumerate(feet) if not foot.stands), key=lambda k: -feet[k].at.value[2])


def _length(moving: list[int], airborne: list[int]) -> float:
    return SHIFT + len(moving) * (STEP + DOUBLE) + (SWING if airborne else 0.0)
