"""Where the feet are in the clip's first frame, and how each gets there from where it stands by default."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.contacts.schedule import Stance
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.lead.arrival import Arrival, Moving, fitted, yaw
from gmr_traj.lead.blend import blend, blend_rotation, bump, minimum_jerk
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot, Sole

# How high a step lifts the foot [m].
LIFT = 0.06
# A foot that stands turns from flat to its orientation in the clip about its resting points, within this [s].
SETTLE = 0.25
# A foot lower and slower than this stands, even where it hovers too high for a stance: no robot could stand otherwise.
LOW = 0.05  # [m]
SLOW = 0.5  # [m/s]


@dataclass(frozen=True)
class Foot:
    """A foot in the clip's first frame.

    Attributes:
        sole: its sole.
        slot: its body among the robot's.
        pivot: the point that its placement is given by, in the body's frame: the middle of the sole points at rest, of
            all of them in swing [m].  # (3,)
        middle: of all sole points, in the body's frame [m].  # (3,)
        at: the pivot in the world [m].  # (3,)
        turned: the body's orientation.
        turning: rotation vector in world axes from ``turned``.  # (3,)
        resting: indices of the sole points that the clip's contact schedule has at rest.
        stands: whether it is on the floor, or meant to be: at rest, or low and slow.
        place, heading: where it stands then: at the mean of its stance, over which feet of clips creep, and where it
            is planted; in the first frame where it has no stance [m], [rad].  # (2,)
    """

    sole: Sole
    slot: int
    pivot: np.ndarray
    middle: np.ndarray
    at: Moving
    turned: Rotation
    turning: Moving
    resting: tuple[int, ...]
    stands: bool
    place: np.ndarray
    heading: float


@dataclass(frozen=True)
class Standing:
    """A foot as it stands before the clip: its pivot [m]  # (3,), the middle of its sole [m]  # (3,), and its turn."""

    at: np.ndarray
    middle: np.ndarray
    turned: Rotation


@dataclass(frozen=True)
class FootPath:
    """A foot on its way, times [s] counted from the clip's first frame, so negative.

    Attributes:
        at: the pivot in every frame [m].  # (T, 3)
        turned: the orientation in every frame.
        lifts: when it leaves the floor; None if it does not.
        lands: when it is back; None if it does not leave the floor, or is in swing in the clip.
        settles: when it begins to turn away from flat to where the clip has it.
    """

    at: np.ndarray
    turned: Rotation
    lifts: float | None
    lands: float | None
    settles: float


def feet_of(arrival: Arrival, motion: RobotMotion, robot: Robot, stances: tuple[Stance, ...]) -> tuple[Foot, ...]:
    """The robot's feet in a clip's first frame.

    Args:
        arrival: that frame.
        motion: the clip.
        robot: the robot.
        stances: those in the clip's first frame, in its frames.
    """
    feet, fps = [], motion.fps
    for sole in robot.soles:
        own = [stance for stance in stances if stance.sole == sole.name]
        slot, points = robot.body_names.index(sole.body), tuple(sorted(stance.point for stance in own))
        pivot = sole.points[list(points) or slice(None)].mean(axis=0)
        path = arrival.positions[:, slot] + arrival.rotations[:, slot] @ pivot
        turned = Rotation.from_matrix(arrival.rotations[:, slot])
        at, turning = fitted(path, fps), fitted((turned * turned[0].inv()).as_rotvec(), fps)
        if points:  # what still moves at rest is a fault of the clip
            at, turning = (Moving(x.value, np.zeros(3), np.zeros(3)) for x in (at, turning))
        stands = bool(points) or (at.value[2] < LOW and float(np.linalg.norm(at.velocity)) < SLOW)
        place, heading = _mean_place(motion, robot, slot, pivot, min((stance.stop for stance in own), default=1))
        middle = sole.points.mean(axis=0)
        feet.append(Foot(sole, slot, pivot, middle, at, turned[0], turning, points, stands, place, heading))
    return tuple(feet)


def _mean_place(
    motion: RobotMotion, robot: Robot, slot: int, pivot: np.ndarray, frames: int
) -> tuple[np.ndarray, float]:
    """Mean place of a body's pivot [m]  # (2,), and its mean heading [rad], over a clip's first frames."""
    positions, rotations = placements(robot, motion.qpos[:frames])
    at = (positions[:, slot] + rotations[:, slot] @ pivot)[:, :2].mean(axis=0)
    heading = np.array([yaw(rotation) for rotation in rotations[:, slot]])
    return at, float(np.arctan2(np.sin(heading).mean(), np.cos(heading).mean()))


def standing_feet(feet: tuple[Foot, ...], robot: Robot, q: np.ndarray) -> tuple[Standing, ...]:
    """The same feet in a configuration in which the robot stands.

    Args:
        feet: the feet.
        robot: their robot.
        q: the configuration.  # (7 + n,)
    """
    positions, rotations = placements(robot, q[None])
    at, turned = positions[0], rotations[0]
    return tuple(
        Standing(
            at[f.slot] + turned[f.slot] @ f.pivot,
            at[f.slot] + turned[f.slot] @ f.middle,
            Rotation.from_matrix(turned[f.slot]),
        )
        for f in feet
    )


def place_of(foot: Foot, stands: Standing) -> Standing:
    """Where a foot at rest in the clip stands flat on the floor, its resting points at their place."""
    turn = foot.heading - yaw(stands.turned.as_matrix())
    flat = Rotation.from_euler("z", turn) * stands.turned
    at = np.array([*foot.place, stands.at[2]])
    return Standing(at, at + flat.apply(foot.middle - foot.pivot), flat)


def foot_path(foot: Foot, stands: Standing, times: np.ndarray, lifts: float | None, lands: float | None) -> FootPath:
    """A foot's way from where it stands to where it is in the clip.

    Args:
        foot: the foot.
        stands: where it stands before.
        times: of the frames [s], at most 0.  # (T,)
        lifts: when it leaves the floor [s]; None to stay.
        lands: when it comes back [s]; None to stay, or to arrive in swing.
    """
    moving = foot.at.velocity, foot.at.acceleration
    turning = foot.turning.velocity, foot.turning.acceleration
    if lifts is not None and lands is None:
        swing = -lifts
        at = blend(times, swing, stands.at, foot.at.value, *moving)
        at[:, 2] += LIFT * bump(1.0 + times / swing)
        return FootPath(at, blend_rotation(times, swing, stands.turned, foot.turned, *turning), lifts, None, lifts)
    place, settle = stands, SETTLE
    if lifts is not None and lands is not None:
        place, settle = place_of(foot, stands), min(SETTLE, -lands)
    at = blend(times, settle, place.at, foot.at.value, *moving)
    turned = blend_rotation(times, settle, place.turned, foot.turned, *turning)
    if lifts is not None and lands is not None:
        share = (times - lifts) / (lands - lifts)
        left = 1.0 - minimum_jerk(share)
        at += np.multiply.outer(left, stands.at - place.at)
        at[:, 2] += LIFT * bump(share)
        turn = (place.turned.inv() * stands.turned).as_rotvec()
        turned = turned * Rotation.from_rotvec(np.multiply.outer(left, turn))
    return FootPath(at, turned, lifts, lands, -settle)
