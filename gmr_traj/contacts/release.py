"""When a part of a foot that still stands in its place carries nothing any more, or nothing yet.

A heel rises before it leaves its place, and a toe comes down after its heel: a rigid foot turns about the part that
stays.  Thresholds of height and speed that are wide enough for feet that hover see such a point at rest a few frames
too long.  Held down until then, a foot has to turn at once: the ankle comes to its limit, and the load with it.
"""

from __future__ import annotations

import numpy as np

from gmr_traj.contacts.mask import owners
from gmr_traj.contacts.rest import RISEN
from gmr_traj.robot import Robot
from gmr_traj.runs import runs

_SHORTEST = 3  # frames: what is left of a stance still bears a load in one


def turning(resting: np.ndarray, height: np.ndarray, robot: Robot) -> np.ndarray:
    """Frames at the ends of stances in which a point is off the floor while the other part of its foot stands.

    The frames at the end (the beginning) of a stance are meant in which the point is higher than its median height in
    that stance by more than 1 cm, all points of the foot's other parts standing in them and in the next (the last).

    Args:
        resting: which sole point is in stance when.  # (T, K) bool
        height: of the points in the clip, over any level [m].  # (T, K)
        robot: whose sole points they are.

    Returns:
        True where a point in stance turns.  # (T, K) bool
    """
    out = np.zeros_like(resting)
    whose = owners(robot)
    for k, (sole, _, part) in enumerate(whose):
        others = [j for j, (name, _, other) in enumerate(whose) if name == sole and other != part]
        if not others:
            continue
        held = np.asarray(resting[:, others].all(axis=1))
        for start, stop in runs(resting[:, k]):
            high = np.asarray(height[:, k] > np.median(height[start:stop, k]) + RISEN)
            up = stop
            while up > start and high[up - 1] and held[up - 1 : up + 1].all():
                up -= 1
            down = start
            while down < up and high[down] and held[max(0, down - 1) : down + 1].all():
                down += 1
            if up - down >= _SHORTEST:
                out[start:down, k] = out[up:stop, k] = True
    return out
