"""Forward kinematics and Jacobians of a robot in numbers, by MuJoCo.

Tangent convention of the whole project, at a configuration ``q = (p, quaternion, joints)``:

    v = (p_dot, omega, joints_dot)  # (6 + n,)

with the base's linear velocity ``p_dot`` [m/s] **and** angular velocity ``omega`` [rad/s] both in **world** axes.
(MuJoCo's free joint has omega in the base's own axes, Pinocchio's has both there; see ``to_mujoco`` and
``gmr_traj.kinematics.pinocchio_model``.)  Integrating ``v`` for one second turns the base rotation R into
``exp(omega) R``.
"""

from __future__ import annotations

import mujoco
import numpy as np

from gmr_traj.exceptions import RobotError
from gmr_traj.robot import Capsule, Robot


def placements(robot: Robot, qpos: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """World placements of all bodies in every frame.

    Args:
        robot: the robot.
        qpos: configurations, quaternions wxyz of unit length.  # (T, 7 + n)

    Returns:
        positions [m]  # (T, B, 3), and rotation matrices (body axes as columns)  # (T, B, 3, 3),
        with bodies in the order of ``robot.body_names``.
    """
    data = mujoco.MjData(robot.model)
    frames, bodies = len(qpos), len(robot.body_names)
    positions = np.empty((frames, bodies, 3))
    rotations = np.empty((frames, bodies, 9))
    for t in range(frames):
        data.qpos[:] = qpos[t]
        mujoco.mj_kinematics(robot.model, data)
        positions[t] = data.xpos[1:]
        rotations[t] = data.xmat[1:]
    return positions, rotations.reshape(frames, bodies, 3, 3)


def body_points(placed: tuple[np.ndarray, np.ndarray], slot: int, points: np.ndarray) -> np.ndarray:
    """World positions of points of one body in every frame [m].  # (T, K, 3)

    Args:
        placed: what :func:`placements` gives.
        slot: index of the body in ``robot.body_names``.
        points: in the body's frame [m].  # (K, 3)
    """
    positions, rotations = placed
    return np.asarray(positions[:, slot, None] + np.einsum("tij,kj->tki", rotations[:, slot], points))


def lowest_points(placed: tuple[np.ndarray, np.ndarray], slot: int, capsule: Capsule) -> np.ndarray:
    """Height of the lowest point of a collision shape in every frame [m].  # (T,)

    Args:
        placed: what :func:`placements` gives.
        slot: index of its body in ``robot.body_names``.
        capsule: the shape.
    """
    positions, rotations = placed
    ends = [positions[:, slot, 2] + rotations[:, slot, 2] @ end for end in (capsule.start, capsule.end)]
    return np.asarray(np.minimum(*ends) - capsule.radius)


def centres_of_mass(robot: Robot, qpos: np.ndarray) -> np.ndarray:
    """Centre of mass of the whole robot in every frame [m].  # (T, 3)

    Args:
        robot: the robot.
        qpos: configurations.  # (T, 7 + n)
    """
    data = mujoco.MjData(robot.model)
    centres = np.empty((len(qpos), 3))
    for t, q in enumerate(qpos):
        data.qpos[:] = q
        mujoco.mj_kinematics(robot.model, data)
        mujoco.mj_comPos(robot.model, data)
        centres[t] = data.subtree_com[1]
    return centres


def body_id(robot: Robot, body: str) -> int:
    """Index of a body in the MuJoCo model (the world is 0).

    Raises:
        RobotError: the robot has no such body.
    """
    index = mujoco.mj_name2id(robot.model, mujoco.mjtObj.mjOBJ_BODY, body)
    if index < 1:
        raise RobotError(f"robot {robot.name} has no body {body!r}; it has {', '.join(robot.body_names)}")
    return int(index)


def to_mujoco(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Tangent vector with world angular velocity (ours) to MuJoCo's, whose angular velocity is in base axes.

    Args:
        q: configuration.  # (7 + n,)
        v: tangent vector (world linear, world angular, joints).  # (6 + n,)
    """
    out = np.array(v, dtype=float)
    out[3:6] = base_rotation(q).T @ out[3:6]
    return out


def base_rotation(q: np.ndarray) -> np.ndarray:
    """Rotation matrix of the base in the world, ``(3, 3)``."""
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, np.asarray(q[3:7], dtype=float))
    return matrix.reshape(3, 3)


def integrate(robot: Robot, q: np.ndarray, v: np.ndarray, dt: float = 1.0) -> np.ndarray:
    """Configuration, ``(7 + n,)``, reached from ``q`` along the constant tangent ``v`` in ``dt`` [s]."""
    out = np.array(q, dtype=float)
    mujoco.mj_integratePos(robot.model, out, to_mujoco(q, v), dt)
    return out


def body_jacobian(robot: Robot, q: np.ndarray, body: str) -> np.ndarray:
    """Jacobian of a body's placement in world axes: linear velocity of its origin, then angular velocity.

        (p_dot_body, omega_body) = J(q) v,    v = (world linear, world angular, joints)

    Args:
        robot: the robot.
        q: configuration.  # (7 + n,)
        body: name of the body.

    Returns:
        J.  # (6, 6 + n)

    Raises:
        RobotError: the robot has no such body.
    """
    data = mujoco.MjData(robot.model)
    data.qpos[:] = q
    mujoco.mj_kinematics(robot.model, data)
    mujoco.mj_comPos(robot.model, data)
    jacobian = np.zeros((6, robot.model.nv))
    mujoco.mj_jacBody(robot.model, data, jacobian[:3], jacobian[3:], body_id(robot, body))
    jacobian[:, 3:6] = jacobian[:, 3:6] @ base_rotation(q).T  # omega_base axes = R^T omega_world
    return jacobian
