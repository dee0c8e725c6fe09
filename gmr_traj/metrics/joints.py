"""Joint speeds, accelerations, jerk and limits of a clip."""

from __future__ import annotations

import numpy as np

from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot

JERK_RATE = 50.0  # [Hz] jerk grows with the cube of the frame rate, so it is compared at one rate
RANGE_TOLERANCE = 1e-4  # [rad] single precision and a clamp at the stop are no violation


def velocities(motion: RobotMotion) -> np.ndarray:
    """Joint velocities (T - 1, n) [rad/s]: ``(q[t+1] - q[t]) fps``."""
    return np.diff(motion.qpos[:, 7:], axis=0) * motion.fps


def accelerations(motion: RobotMotion) -> np.ndarray:
    """Joint accelerations (T - 2, n) of frames 1 to T - 2 [rad/s^2]: ``(q[t+1] - 2 q[t] + q[t-1]) fps^2``."""
    return np.diff(motion.qpos[:, 7:], 2, axis=0) * motion.fps**2


def jerks(motion: RobotMotion) -> np.ndarray:
    """Joint jerk [rad/s^3]: third difference of the joints resampled linearly to 50 Hz, times 50^3."""
    time = np.arange(motion.frames) / motion.fps
    grid = np.arange(0.0, time[-1], 1.0 / JERK_RATE)
    resampled = np.stack([np.interp(grid, time, joint) for joint in motion.qpos[:, 7:].T], axis=1)  # (T50, n)
    return np.diff(resampled, 3, axis=0) * JERK_RATE**3


def range_excess(motion: RobotMotion, robot: Robot) -> np.ndarray:
    """How far each joint is outside its range (T, n) [rad], 0 inside or within 1e-4 rad of it."""
    q = motion.qpos[:, 7:]
    excess = np.maximum(robot.position_lower - q, q - robot.position_upper)
    return np.where(excess > RANGE_TOLERANCE, excess, 0.0)


def base_speeds(motion: RobotMotion) -> tuple[np.ndarray, np.ndarray]:
    """Speed of the base [m/s] and rate of its orientation [rad/s], each (T - 1,).

    The angle between orientations one frame apart is ``2 atan2(||vec(conj(p) q)||, |scal(conj(p) q)|)``: the same
    for a quaternion and its negative.
    """
    linear = np.linalg.norm(np.diff(motion.qpos[:, :3], axis=0), axis=1)
    p, q = motion.qpos[:-1, 3:7], motion.qpos[1:, 3:7]
    scalar = np.einsum("ti,ti->t", p, q)
    vector = p[:, :1] * q[:, 1:] - q[:, :1] * p[:, 1:] - np.cross(p[:, 1:], q[:, 1:])
    angle = 2.0 * np.arctan2(np.linalg.norm(vector, axis=1), np.abs(scalar))
    return linear * motion.fps, angle * motion.fps
