"""The state in which a blend meets the clip: placements, velocities and accelerations in its first frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.kinematics.mujoco_kinematics import centres_of_mass, placements
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot

# Velocities and accelerations are those of a parabola through the first frames of the clip, this long [s].
FIT = 0.2


@dataclass(frozen=True)
class Moving:
    """A value with its rates.

    Attributes:
        value: where it is.  # (...)
        velocity: its first derivative [1/s].  # (...)
        acceleration: its second [1/s^2].  # (...)
    """

    value: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


@dataclass(frozen=True)
class Arrival:
    """A clip's first frame.

    Attributes:
        joints: of the robot [rad].  # (n,)
        base: position of the base [m].  # (3,)
        centre: of mass [m].  # (3,)
        turned: orientation of the base.
        turning: rotation vector in world axes from ``turned``; its value is zero.  # (3,)
        positions, rotations: of the bodies, frame by frame, over the parabola's frames.  # (F, B, 3), (F, B, 3, 3)
    """

    joints: Moving
    base: Moving
    centre: Moving
    turned: Rotation
    turning: Moving
    positions: np.ndarray
    rotations: np.ndarray


def arrival(motion: RobotMotion, robot: Robot) -> Arrival:
    """The state in a motion's first frame."""
    frames = min(motion.frames, max(4, round(FIT * motion.fps) + 1))
    first = motion.with_qpos(motion.qpos[:frames])
    qpos, fps = first.qpos, first.fps
    turned = Rotation.from_quat(qpos[:, 3:7], scalar_first=True)
    positions, rotations = placements(robot, qpos)
    return Arrival(
        joints=fitted(qpos[:, 7:], fps),
        base=fitted(qpos[:, :3], fps),
        centre=fitted(centres_of_mass(robot, qpos), fps),
        turned=turned[0],
        turning=fitted((turned * turned[0].inv()).as_rotvec(), fps),
        positions=positions,
        rotations=rotations,
    )


def fitted(values: np.ndarray, fps: float) -> Moving:
    """The first value, with the rates there of the parabola through it that is nearest to all of them.

    Args:
        values: one a frame.  # (F, ...)
        fps: frames per second [Hz].
    """
    zero = np.zeros(values.shape[1:])
    if len(values) < 4:  # a parabola through three frames is nothing but their noise
        return Moving(values[0], zero, zero)
    t = np.arange(1, len(values)) / fps
    away = (values[1:] - values[0]).reshape(len(t), -1)
    velocity, acceleration = np.linalg.lstsq(np.stack([t, 0.5 * t**2], axis=1), away, rcond=None)[0]
    return Moving(values[0], velocity.reshape(zero.shape), acceleration.reshape(zero.shape))


def standing(robot: Robot, place: np.ndarray, heading: float) -> np.ndarray:
    """The robot's default configuration somewhere else on the floor.  # (7 + n,)

    Args:
        robot: the robot.
        place: of its base on the floor [m].  # (2,)
        heading: its yaw [rad].
    """
    q = np.array(robot.nominal)
    q[:2] = place
    q[3:7] = (Rotation.from_euler("z", heading) * Rotation.from_quat(q[3:7], scalar_first=True)).as_quat(
        scalar_first=True
    )
    return q


def yaw(rotation: np.ndarray) -> float:
    """Heading of a rotation matrix (3, 3) [rad]: that of its x axis, or of its z axis where that one is upright."""
    forward = rotation[:, 0] if abs(rotation[2, 0]) < 0.9 else -np.sign(rotation[2, 0]) * rotation[:, 2]
    return float(np.arctan2(forward[1], forward[0]))
