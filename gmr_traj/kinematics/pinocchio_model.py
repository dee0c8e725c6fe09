"""The robot as a Pinocchio model, built from the same compiled MuJoCo model.

Pinocchio's configuration has the quaternion as xyzw, and its free-flyer's velocity is linear **and** angular in the
base's own axes; the functions here convert from and to the project's conventions (quaternion wxyz, both in world axes).
"""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin

from gmr_traj.exceptions import RobotError
from gmr_traj.kinematics.mujoco_kinematics import base_rotation
from gmr_traj.robot import Robot


def build(robot: Robot) -> pin.Model:
    """The robot in Pinocchio: a free-flyer and n revolute joints, in the order of ``robot.joint_names``.

    Masses, inertias, armature and the limits of position, velocity and effort come along; every body is a frame of
    its name.  A body without a joint is fixed to its parent's joint.

    Raises:
        RobotError: Pinocchio's order of joints is not the robot's (a model whose tree is not written depth first).
    """
    source = robot.model
    model = pin.Model()
    model.name = robot.name
    # For every MuJoCo body: the Pinocchio joint that carries it, its placement there, its frame.
    carried: dict[int, tuple[int, pin.SE3, int]] = {0: (0, pin.SE3.Identity(), 0)}
    for body in range(1, source.nbody):
        joint, T_joint_parent, parent_frame = carried[int(source.body_parentid[body])]
        T_joint_body = pin.SE3.Identity()
        if body > 1:  # a free joint's body is where the configuration says, not where the file says
            T_joint_body = T_joint_parent * _placement(source.body_pos[body], source.body_quat[body])
        if int(source.body_jntnum[body]) == 1:
            joint, T_joint_body = _add_joint(model, source, body, joint, T_joint_body)
        frame = pin.Frame(source.body(body).name, joint, parent_frame, T_joint_body, pin.FrameType.BODY)
        carried[body] = joint, T_joint_body, model.addFrame(frame, False)
        model.appendBodyToJoint(joint, _inertia(source, body), T_joint_body)
    if tuple(model.names[2:]) != robot.joint_names:
        raise RobotError(f"{robot.path}: Pinocchio orders the joints as {', '.join(list(model.names)[2:])}")
    model.lowerPositionLimit = np.concatenate([np.full(7, -np.inf), robot.position_lower])
    model.upperPositionLimit = np.concatenate([np.full(7, np.inf), robot.position_upper])
    model.velocityLimit = np.concatenate([np.full(6, np.inf), robot.velocity_limit])
    model.effortLimit = np.concatenate([np.zeros(6), robot.effort_limit])
    model.armature = np.array(source.dof_armature)
    return model


def to_configuration(qpos: np.ndarray) -> np.ndarray:
    """Our configuration (quaternion wxyz) as Pinocchio's (xyzw).  Leading dimensions are kept."""
    return np.concatenate([qpos[..., :3], np.roll(qpos[..., 3:7], -1, axis=-1), qpos[..., 7:]], axis=-1)


def from_configuration(configuration: np.ndarray) -> np.ndarray:
    """Pinocchio's configuration (quaternion xyzw) as ours (wxyz).  Leading dimensions are kept."""
    quaternion = np.roll(configuration[..., 3:7], 1, axis=-1)
    return np.concatenate([configuration[..., :3], quaternion, configuration[..., 7:]], axis=-1)


def tangent_map(q: np.ndarray) -> np.ndarray:
    """Matrix C that turns our tangent into Pinocchio's, ``v_pin = C v``.

    With R the rotation of the base, ``C = blockdiag(R^T, R^T, 1)``; it is orthogonal, so ``v = C^T v_pin``, a Jacobian
    becomes ``J = J_pin C``, a generalised force ``tau = C^T tau_pin``.

    Args:
        q: configuration, quaternion wxyz.  # (7 + n,)

    Returns:
        C.  # (6 + n, 6 + n)
    """
    out = np.eye(len(q) - 1)
    out[:3, :3] = out[3:6, 3:6] = base_rotation(q).T
    return out


def body_jacobian(model: pin.Model, q: np.ndarray, body: str) -> np.ndarray:
    """Jacobian of a body's placement, in the convention of ``mujoco_kinematics.body_jacobian``.

    Args:
        model: from ``build``.
        q: configuration, quaternion wxyz.  # (7 + n,)
        body: name of the body.

    Returns:
        J: world linear velocity of the body's origin, then world angular velocity.  # (6, 6 + n)

    Raises:
        RobotError: the model has no such body.
    """
    if not model.existFrame(body, pin.FrameType.BODY):
        raise RobotError(f"robot {model.name} has no body {body!r}")
    frame = model.getFrameId(body, pin.FrameType.BODY)
    jacobian = pin.computeFrameJacobian(model, model.createData(), to_configuration(q), frame, pin.LOCAL_WORLD_ALIGNED)
    return np.asarray(jacobian @ tangent_map(q))


def _add_joint(
    model: pin.Model, source: mujoco.MjModel, body: int, parent: int, T_parent_body: pin.SE3
) -> tuple[int, pin.SE3]:
    """Add the joint of a body; returns its index and the body's placement in its frame."""
    j = int(source.body_jntadr[body])
    name = source.joint(j).name
    if body == 1:
        return model.addJoint(parent, pin.JointModelFreeFlyer(), pin.SE3.Identity(), name), pin.SE3.Identity()
    axis, anchor = np.array(source.jnt_axis[j]), np.array(source.jnt_pos[j])
    # MuJoCo's joint turns about a point of the body, and from the angle ``ref`` (in qpos0) at which the file shows it.
    reference = pin.exp3(-float(source.qpos0[int(source.jnt_qposadr[j])]) * axis)
    T_parent_joint = T_parent_body * pin.SE3(reference, anchor)
    index = model.addJoint(parent, pin.JointModelRevoluteUnaligned(axis), T_parent_joint, name)
    return index, pin.SE3(np.eye(3), -anchor)


def _inertia(source: mujoco.MjModel, body: int) -> pin.Inertia:
    """Spatial inertia of a body in its own frame: I = R diag(principal moments) R^T about the centre of mass."""
    rotation = _placement(np.zeros(3), source.body_iquat[body]).rotation
    moments = rotation @ np.diag(source.body_inertia[body]) @ rotation.T
    return pin.Inertia(float(source.body_mass[body]), np.array(source.body_ipos[body]), moments)


def _placement(position: np.ndarray, quaternion: np.ndarray) -> pin.SE3:
    """SE3 from a position and a wxyz quaternion, rotation by MuJoCo's own formula."""
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, np.asarray(quaternion))
    return pin.SE3(matrix.reshape(3, 3), np.array(position))
