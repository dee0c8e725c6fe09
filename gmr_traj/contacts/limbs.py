"""When hands, knees, elbows and hips rest on the floor: supports that a robot declares besides its soles.

A support touches the floor with the balls at the ends of its collision shapes.  A ball rests where its lowest point is
on the floor and its centre is still: the material that touches changes as the limb turns over it, the centre does not
move by more than the radius times the turn.
"""

from __future__ import annotations

import numpy as np

from gmr_traj.contacts.rest import RISEN, DetectionSettings, rest_runs
from gmr_traj.kinematics.mujoco_kinematics import body_points, lowest_points
from gmr_traj.robot import Robot

#: Slower and longer than for feet: a hand that swings low past the floor does not rest there.
LIMBS = DetectionSettings(enter_speed=0.2, leave_speed=0.4, shortest=0.2)
# A limb that is not flat rests on its lowest ball: what another is higher than that counts so many times.
_TILTED = 4.0
# A stance is of one place: a ball that is farther from its mean place at any time is dragged or rolls [m].
_FARTHEST = 0.05
# A foot no higher than this above a lower limb stands on the tip or the side of its shapes [m]; else it is in the air.
_FOOT = 0.1


def limb_points(robot: Robot, placed: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """The balls of all supports but the soles, one support after the other.

    Args:
        robot: the robot.
        placed: placements of its bodies.

    Returns:
        centres in the world [m]  # (T, L, 3), and radii [m]  # (L,).
    """
    slots = [robot.body_names.index(body) for support in robot.supports for body in support.bodies]
    own = np.concatenate([np.zeros((0, 3)), *(support.points for support in robot.supports)])
    points = [body_points(placed, slot, point[None]) for slot, point in zip(slots, own, strict=True)]
    centres = np.concatenate(points, axis=1) if points else np.zeros((len(placed[0]), 0, 3))
    return centres, np.concatenate([np.zeros(0), *(support.radii for support in robot.supports)])


def resting_limbs(
    robot: Robot, centres: np.ndarray, height: np.ndarray, fps: float, settings: DetectionSettings = LIMBS
) -> np.ndarray:
    """Which balls of the supports rest on the floor when.  # (T, L) bool

    Args:
        robot: the robot.
        centres: of the balls [m].  # (T, L, 3)
        height: of their lowest points above the floor [m].  # (T, L)
        fps: frames per second.
        settings: thresholds.
    """
    counted, last = height.copy(), 0
    for support in robot.supports:
        own = slice(last, last := last + len(support.points))
        lowest = height[:, own].min(axis=1, keepdims=True)
        counted[:, own] = lowest + _TILTED * (height[:, own] - lowest)
    shortest = max(3, round(settings.shortest * fps))
    out = np.zeros(height.shape, bool)
    for k, found in enumerate(rest_runs(centres, counted, fps, settings)):
        for start, stop in found:
            low = np.flatnonzero(height[start:stop, k] <= np.median(height[start:stop, k]) + RISEN)
            start, stop = start + int(low[0]), start + int(low[-1]) + 1
            place = centres[start:stop, k, :2]
            away = np.linalg.norm(place - place.mean(axis=0), axis=1)
            out[start:stop, k] = stop - start >= shortest and away.max() <= _FARTHEST
    return out


def lowest_of_feet(
    robot: Robot, placed: tuple[np.ndarray, np.ndarray], soles: np.ndarray, limbs: np.ndarray
) -> np.ndarray:
    """How low the robot stands in every frame, by its feet [m].  # (T,)

    That is the lowest point of its soles, unless a limb is lower.  On all fours feet stand on the tips of their toes,
    or on the backs of them, and the lowest points of their shapes count; where these are in the air, too, the limb.

    Args:
        robot: the robot.
        placed: placements of its bodies.
        soles: height of the lowest sole point [m].  # (T,)
        limbs: heights of the lowest points of the limbs' balls [m].  # (T, L)
    """
    if not limbs.shape[1]:
        return soles
    limb = limbs.min(axis=1)
    below = limb < soles
    if not below.any():
        return soles
    feet, bodies = soles.copy(), {sole.body for sole in robot.soles}
    for capsule in (c for c in robot.capsules if c.body in bodies):
        np.minimum(feet, lowest_points(placed, robot.body_names.index(capsule.body), capsule), out=feet)
    return np.where(below, np.where(feet < limb + _FOOT, feet, limb), soles)
