"""Feet as a whole: when each is in stance, how fast it slides then, how high it is."""

from __future__ import annotations

import numpy as np

from gmr_traj.contacts.schedule import LIMB, ContactSchedule
from gmr_traj.metrics.observation import Observation
from gmr_traj.robot import Robot


def stance_mask(schedule: ContactSchedule, robot: Robot) -> np.ndarray:
    """Whether each foot is in stance, in the order of ``robot.soles``: whether any point of its sole is.  # (T, S)"""
    index = {sole.name: s for s, sole in enumerate(robot.soles)}
    mask = np.zeros((schedule.frames, len(index)), dtype=bool)
    for stance in (s for s in schedule.stances if s.part != LIMB):
        mask[stance.start : stance.stop, index[stance.sole]] = True
    return mask


def sole_heights(observation: Observation) -> np.ndarray:
    """Height of the lowest point of each sole, outline included [m].  # (T, S)"""
    pairs = zip(observation.soles, observation.outlines, strict=True)
    return np.stack([np.concatenate(pair, axis=1)[..., 2].min(axis=1) for pair in pairs], axis=1)


def slide_speeds(observation: Observation, mask: np.ndarray) -> np.ndarray:
    """Horizontal speed of the foot over all steps within stances [m/s].

        v_f(t) = min over sole points k of ||p_xy,k(t+1) - p_xy,k(t)|| fps,    c_f(t) = c_f(t+1) = 1

    The slowest point counts, so a foot that rolls over its toe or turns on its heel does not slide.

    Args:
        observation: the clip.
        mask: c, see ``stance_mask``.  # (T, S)

    Returns:
        Speeds, foot after foot.  # (N,)
    """
    speeds = [
        np.linalg.norm(np.diff(points[..., :2], axis=0), axis=2).min(axis=1)[mask[1:, s] & mask[:-1, s]]
        for s, points in enumerate(observation.soles)
    ]
    return np.concatenate(speeds) * observation.motion.fps if speeds else np.zeros(0)


def contact_shares(heights: np.ndarray, mask: np.ndarray, near: float) -> tuple[float | None, float | None]:
    """How well contacts are preserved: the share that is kept, and the share of the clip's own that are added.

    A foot is in contact where a point of its sole is lower than ``near``.  Kept: of the feet's frames in stance those
    in contact.  Added: of the frames in contact those not in stance.  None where there are no such frames.

    Args:
        heights: height of each foot's lowest sole point [m].  # (T, S)
        mask: where each foot should be in stance.  # (T, S)
        near: bar [m].
    """
    touching = heights < near
    kept = float(touching[mask].mean()) if mask.any() else None
    added = float((~mask)[touching].mean()) if touching.any() else None
    return kept, added
