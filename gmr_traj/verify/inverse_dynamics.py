"""What a clip asks of the robot: the wrench from outside and the torques of the joints, by Pinocchio.

Without contact, ``M(q) a + h(q, v) = tau`` leaves a wrench at the base, which no motor delivers: the floor must.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

from gmr_traj.kinematics.pinocchio_model import build, to_configuration
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot
from gmr_traj.verify.derivatives import derivatives


@dataclass(frozen=True)
class Demand:
    """Generalised forces that produce the motion of a clip, nothing touching the robot.

    Attributes:
        force: on the base, in world axes [N].  # (T, 3)
        moment: about the base's origin, in world axes [N m].  # (T, 3)
        torque: of the joints [N m].  # (T, n)
    """

    force: np.ndarray
    moment: np.ndarray
    torque: np.ndarray


def demand(motion: RobotMotion, robot: Robot) -> Demand:
    """Inverse dynamics along a clip, velocities and accelerations by central differences."""
    return inverse_dynamics(robot, motion.qpos, *derivatives(motion))


def inverse_dynamics(robot: Robot, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> Demand:
    """Generalised forces at given configurations, velocities and accelerations (armature included).

    Pinocchio's base has its velocity in its own axes, so with R its rotation, u = R' v and w = R' omega there:
    ``u' = R' v' - w x u``,   ``w' = R' omega'``.

    Args:
        robot: the robot.
        q: configurations.  # (T, 7 + n)
        v: velocities, world axes.  # (T, 6 + n)
        a: their rates.  # (T, 6 + n)
    """
    model = build(robot)
    data = model.createData()
    R = Rotation.from_quat(q[:, 3:7], scalar_first=True).as_matrix()  # (T, 3, 3)
    own_v, own_a = v.copy(), a.copy()
    for part in (slice(0, 3), slice(3, 6)):
        own_v[:, part] = np.einsum("tji,tj->ti", R, v[:, part])
        own_a[:, part] = np.einsum("tji,tj->ti", R, a[:, part])
    own_a[:, :3] -= np.cross(own_v[:, 3:6], own_v[:, :3])
    configurations = to_configuration(q)
    tau = np.array([pin.rnea(model, data, *row) for row in zip(configurations, own_v, own_a, strict=True)])
    force, moment = (np.einsum("tij,tj->ti", R, tau[:, part]) for part in (slice(0, 3), slice(3, 6)))
    return Demand(force, moment, tau[:, 6:])
