"""Velocities that the trackers' files hold beside positions, by the finite differences their converters take."""

from __future__ import annotations

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.kinematics.mujoco_kinematics import to_mujoco
from gmr_traj.robot import Robot


def finite_differences(qpos: np.ndarray, fps: float) -> np.ndarray:
    """Tangent vectors of a clip, base velocities in world axes.

        p_dot[t] = (p[t+1] - p[t-1]) fps / 2,   omega[t] = log(R[t+1] R[t-1]^-1) fps / 2,   joints as p

    with one-sided differences of p and joints at the ends, and omega's neighbours repeated there.

    Args:
        qpos: configurations.  # (T, 7 + n)
        fps: frame rate [Hz].

    Returns:
        (world linear, world angular, joints).  # (T, 6 + n)
    """
    frames = len(qpos)
    velocity = np.zeros((frames, qpos.shape[1] - 1))
    if frames == 1:
        return velocity
    velocity[:, :3] = np.gradient(qpos[:, :3], 1.0 / fps, axis=0)
    velocity[:, 6:] = np.gradient(qpos[:, 7:], 1.0 / fps, axis=0)
    turns = Rotation.from_quat(qpos[:, 3:7], scalar_first=True)
    if frames == 2:
        velocity[:, 3:6] = (turns[1] * turns[0].inv()).as_rotvec() * fps
    else:
        velocity[1:-1, 3:6] = (turns[2:] * turns[:-2].inv()).as_rotvec() * (0.5 * fps)
        velocity[0, 3:6], velocity[-1, 3:6] = velocity[1, 3:6], velocity[-2, 3:6]
    return velocity


def body_velocities(robot: Robot, qpos: np.ndarray, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Linear velocities of the origins of all bodies, and their angular velocities, in world axes.

    Args:
        robot: the robot.
        qpos: configurations.  # (T, 7 + n)
        velocity: tangent vectors as of ``finite_differences``.  # (T, 6 + n)

    Returns:
        linear [m/s] and angular [rad/s] velocities, bodies in the order of ``robot.body_names``.  # (T, B, 3) each
    """
    data = mujoco.MjData(robot.model)
    count = len(robot.body_names)
    linear, angular = np.empty((len(qpos), count, 3)), np.empty((len(qpos), count, 3))
    root = robot.model.body_rootid[1:]
    for t in range(len(qpos)):
        data.qpos[:] = qpos[t]
        data.qvel[:] = to_mujoco(qpos[t], velocity[t])
        mujoco.mj_kinematics(robot.model, data)
        mujoco.mj_comPos(robot.model, data)
        mujoco.mj_comVel(robot.model, data)
        # cvel is (angular, linear) at the centre of mass of the whole tree; shift it to the body's origin.
        angular[t] = data.cvel[1:, :3]
        linear[t] = data.cvel[1:, 3:] + np.cross(angular[t], data.xpos[1:] - data.subtree_com[root])
    return linear, angular
