"""Velocities and accelerations along a clip, by central differences and without smoothing."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.motion import RobotMotion


def derivatives(motion: RobotMotion) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and acceleration in every frame, in the project's tangent convention (all of the base in world axes).

    With ``s[t] = (q[t+1] - q[t]) / dt`` (for the base's rotation ``log(R[t+1] R[t]') / dt``, in world axes):

        v[t] = (s[t] + s[t-1]) / 2,    a[t] = (s[t] - s[t-1]) / dt

    The first and the last frame take the acceleration of their neighbour, and the velocity that goes with it.  Nothing
    is smoothed: the noise of a clip is part of what it asks of the robot.  A clip of two frames has no acceleration,
    one of a single frame stands still.

    Returns:
        v  # (T, 6 + n), and a  # (T, 6 + n)
    """
    q, dt, frames = motion.qpos, 1.0 / motion.fps, motion.frames
    v, a = np.zeros((2, frames, q.shape[1] - 1))
    if frames == 1:
        return v, a
    step = np.empty((frames - 1, q.shape[1] - 1))
    step[:, :3] = np.diff(q[:, :3], axis=0)
    rotation = Rotation.from_quat(q[:, 3:7], scalar_first=True)
    step[:, 3:6] = (rotation[1:] * rotation[:-1].inv()).as_rotvec()
    step[:, 6:] = np.diff(q[:, 7:], axis=0)
    step /= dt
    a[1:-1] = np.diff(step, axis=0) / dt
    v[1:-1] = 0.5 * (step[1:] + step[:-1])
    a[0], a[-1] = a[min(1, frames - 1)], a[max(frames - 2, 0)]
    v[0], v[-1] = step[0] - 0.5 * dt * a[0], step[-1] + 0.5 * dt * a[-1]
    return v, a


def point_velocities(points: np.ndarray, fps: float) -> np.ndarray:
    """Central differences of points, one-sided at both ends [m/s].  # (T, ...)"""
    if len(points) == 1:
        return np.zeros_like(points)
    return np.asarray(np.gradient(points, 1.0 / fps, axis=0))
