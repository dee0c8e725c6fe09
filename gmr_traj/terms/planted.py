"""Feet that come close once they stand where the schedule has them.

The feet of a retargeted clip skate.  Planted at the middle of where each slides they may come down in one another,
although in the clip they are decimetres apart; a row that is built only then sees the two from the wrong side.
"""

from __future__ import annotations

import itertools

import numpy as np

from gmr_traj.collision.segments import distance
from gmr_traj.contacts.mask import owners, to_mask
from gmr_traj.kinematics.mujoco_kinematics import body_points
from gmr_traj.robot import Robot
from gmr_traj.runs import runs
from gmr_traj.terms.context import Context


def planted_close(context: Context, within: float) -> dict[tuple[int, int], np.ndarray]:
    """Pairs of capsules of two feet that stand, and the frames in which they are closer than this.

    A planted foot is the foot moved horizontally so that its resting points are, in the mean, where they stand: at
    the middle of their places in their stances.

    Args:
        context: motion and schedule.
        within: clearance of the planted feet [m].
    """
    robot, resting = context.robot, to_mask(context.schedule, context.robot)
    names = np.array([name for name, _, _ in owners(robot)])
    found = {}
    for one, other in itertools.combinations(robot.soles, 2):
        feet = [resting[:, names == sole.name] for sole in (one, other)]
        both = np.flatnonzero(feet[0].any(axis=1) & feet[1].any(axis=1))
        if not both.size:
            continue
        shifts = {}
        for sole, on in zip((one, other), feet, strict=True):
            points = body_points(context.placements, robot.body_names.index(sole.body), sole.points)
            shifts[sole.body] = _shift(points[..., :2], on, both)
        for pair in _pairs(robot, one.body, other.body):
            (a0, a1), (b0, b1) = (_ends(context, k, both, shifts) for k in pair)
            reach = sum(robot.capsules[k].radius for k in pair)
            close = distance(a0, a1, b0, b1)[0] - reach < within
            if close.any():
                found[pair] = both[close]
    return found


def _pairs(robot: Robot, one: str, other: str) -> list[tuple[int, int]]:
    """The collision pairs of two bodies."""
    return [
        pair for pair in robot.collision_pairs if sorted(robot.capsules[k].body for k in pair) == sorted((one, other))
    ]


def _shift(points: np.ndarray, resting: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """From where a foot is to where its stances have it, in frames in which it stands [m].  # (F, 2)"""
    away = np.zeros(points.shape)
    for k, on in enumerate(resting.T):
        for start, stop in runs(on):
            own = points[start:stop, k]
            away[start:stop, k] = own.mean(axis=0) - own
    return np.asarray(away[frames].sum(axis=1) / resting[frames].sum(axis=1, keepdims=True))


def _ends(context: Context, k: int, frames: np.ndarray, shifts: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """End points of a foot's capsule, planted [m].  # (F, 3) each"""
    capsule = context.robot.capsules[k]
    positions, rotations = context.placements
    slot = context.robot.body_names.index(capsule.body)
    origin = positions[frames, slot] + np.pad(shifts[capsule.body], ((0, 0), (0, 1)))
    return origin + rotations[frames, slot] @ capsule.start, origin + rotations[frames, slot] @ capsule.end
