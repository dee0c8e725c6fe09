"""Stances at the ends of a clip whose first or last frames say nothing."""

from __future__ import annotations

import numpy as np

from gmr_traj.contacts.mask import from_mask, limbs_to_mask, to_mask
from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.robot import Robot

# A fault spoils the speeds of the frames next to it, so that a stance seems to begin that much late.
_LATE = 2  # frames


def continued(schedule: ContactSchedule, robot: Robot, believed: np.ndarray) -> ContactSchedule:
    """Points that stand where a spoiled beginning ends have stood since the first frame; likewise at the end.

    Frame-by-frame retargeting takes a few frames to reach the motion.  What stands when it has arrived stood before:
    otherwise nothing would carry the robot in those frames, and it would fall freely through them.

    Args:
        schedule: of the clip.
        robot: whose soles and other supports it speaks of.
        believed: frames that say something about the motion.  # (T,) bool
    """
    if believed.all() or not believed.any():
        return schedule
    resting, limbs = to_mask(schedule, robot), limbs_to_mask(schedule, robot)
    for way in (slice(None), slice(None, None, -1)):
        for on in (resting, limbs):
            _from_the_start(on[way], int(np.argmax(believed[way])))
    return from_mask(schedule, robot, resting, limbs)


def _from_the_start(resting: np.ndarray, first: int) -> None:
    """Frames before ``first`` are as the first one in which a point stands soon after; changed in place.  # (T, K)"""
    for on in resting.T if first else ():
        stands = np.flatnonzero(on[first : first + _LATE + 1])
        on[: first + (int(stands[0]) if stands.size else 0)] = stands.size > 0
