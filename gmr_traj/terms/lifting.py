"""How high the contact points of a foot in stance may come while the foot turns about its toes or its heel.

A foot that rises on its toes rests on the tip of its outline, ahead of its contact points: held down they would keep it
flat, with its ankle at the limit, until the toes leave the floor.  And the heel of a foot whose toes stand leaves the
floor before it leaves its place (:mod:`~gmr_traj.contacts.release`).  Such points may rise by a few millimetres, and
as far as they like in the frames next to the swing, as long as these are a small share of all frames in stance.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gmr_traj.robot import Robot, Sole
from gmr_traj.runs import runs

#: As high as they like [m]; an infinity would turn into NaN where it is multiplied by zero.
FREE = 1e3


def ceilings(resting: np.ndarray, turning: np.ndarray, lone: np.ndarray, rise: float, share: float) -> np.ndarray:
    """Largest height of every sole point above the floor in stance [m].  # (T, K)

    Args:
        resting: which sole point is in stance when.  # (T, K) bool
        turning: of those, see :func:`~gmr_traj.contacts.release.turning`.  # (T, K) bool
        lone: and see :func:`alone`.  # (T, K) bool
        rise: height of points that a turning foot lifts [m]; 0 for none.
        share: of all frames of all points in stance those, at most, in which such a point is ``FREE``.
    """
    out = np.zeros(resting.shape)
    if rise <= 0.0:
        return out
    lifted = turning | lone
    out[lifted] = rise
    order = _from_swing(resting, lifted)
    left = share * np.count_nonzero(resting)
    for nearest in range(1, int(order.max(initial=0)) + 1):
        for whose in (turning, ~turning):  # a heel needs it more: the ankle is at its limit for it
            its = (order == nearest) & whose
            left -= np.count_nonzero(its)
            if left < 0:
                return out
            out[its] = FREE
    return out


def alone(robot: Robot, firm: np.ndarray) -> np.ndarray:
    """Points of a part of a foot that rests on the floor as a whole, no other part of that foot resting.  # (T, K)

    A foot of which one point alone rests may be turning about that point: a tip that is held would stop it.

    Args:
        robot: whose sole points they are.
        firm: which of them are held on the floor.  # (T, K) bool
    """
    out, first = np.zeros_like(firm), 0
    for sole in robot.soles:
        mine = firm[:, first : first + len(sole.points)]
        for part in pivots(sole):
            its = np.array([name == part for name in sole.parts])
            on = np.asarray(mine[:, its].all(axis=1) & ~mine[:, ~its].any(axis=1))
            out[:, first : first + len(its)] |= on[:, None] & its
        first += len(sole.points)
    return out


def pivots(sole: Sole) -> dict[str, np.ndarray]:
    """Part of a sole -> the point of its outline that the foot turns about when that part alone is on the floor [m].

    The contact points lie inside the outline: a foot that rises on its toes rests on the outline's tip, and the toe's
    contact points rise with the foot.  Without an outline beyond them there is no other point to turn about.
    """
    parts = list(dict.fromkeys(sole.parts))
    if len(parts) < 2 or not len(sole.outline):
        return {}
    out = {}
    for part in parts:
        its = np.array([name == part for name in sole.parts])
        outward = sole.points[its].mean(axis=0) - sole.points[~its].mean(axis=0)
        tip = sole.outline[int((sole.outline @ outward).argmax())]
        if tip @ outward > (sole.points @ outward).max():
            out[part] = tip
    return out


def pivoting(firm: np.ndarray, lifted: np.ndarray, parts: Sequence[str], part: str) -> list[tuple[int, int]]:
    """Runs of frames in which all of a part of a foot rests, those in which it rests alone at times.

    Args:
        firm: which points of the foot are held on the floor.  # (T, k) bool
        lifted: see :func:`alone`, of the same points.  # (T, k) bool
        parts: their parts.
        part: the one meant.
    """
    its = np.array([name == part for name in parts])
    on, turns = np.asarray(firm[:, its].all(axis=1)), np.asarray(lifted[:, its].any(axis=1))
    return [(first, stop) for first, stop in runs(on) if turns[first:stop].any()]


def _from_swing(resting: np.ndarray, lifted: np.ndarray) -> np.ndarray:
    """Of lifted points, which frame it is counted from the end (or the beginning) of their stance, from 1 on.  # (T, K)

    0 where a point is not lifted, or not lifted throughout up to that end.
    """
    out = np.zeros(resting.shape, int)
    for k in range(resting.shape[1]):
        for start, stop in runs(resting[:, k]):
            for frames in (range(start, stop), range(stop - 1, start - 1, -1)):
                for count, t in enumerate(frames, 1):
                    if not lifted[t, k] or out[t, k]:
                        break
                    out[t, k] = count
    return out
