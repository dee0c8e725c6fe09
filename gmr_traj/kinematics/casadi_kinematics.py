"""Forward kinematics of a robot as CasADi expressions.

A walk over the compiled model's tree: for body i with parent p, constant offset ``(p_i, R_i)`` in the
parent's frame and a hinge of axis a through point c (both in the body's frame),

    R_world_i = R_world_p R_i Exp(a q_i)
    p_world_i = p_world_p + R_world_p p_i + (R_world_p R_i - R_world_i) c.

The same numbers as MuJoCo's ``mj_kinematics`` and Pinocchio's ``forwardKinematics``, to 1e-9.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import mujoco
import numpy as np

from gmr_traj.robot import Robot

# Below this squared angle [rad^2] the exponential map switches to its Taylor series.
_SMALL_ANGLE_SQUARED = 1e-8


def exp_so3(rotation_vector: Any) -> Any:
    """Rotation matrix of a rotation vector: ``I + sinc(t) [w] + (1 - cos t) / t^2 [w]^2``, t = ``|w|`` [rad].

    Smooth at zero: the two coefficients are replaced by their Taylor series there.
    """
    square = ca.sumsqr(rotation_vector)
    small = square < _SMALL_ANGLE_SQUARED
    # The guarded square keeps the branch that is not taken finite, so that derivatives hold no NaN.
    guarded = ca.if_else(small, 1.0, square)
    angle = ca.sqrt(guarded)
    first = ca.if_else(small, 1 - square / 6, ca.sin(angle) / angle)
    second = ca.if_else(small, 0.5 - square / 24, (1 - ca.cos(angle)) / guarded)
    cross = ca.skew(rotation_vector)
    return ca.SX.eye(3) + first * cross + second * cross @ cross


def rotation_from_quaternion(quaternion: Any) -> Any:
    """Rotation matrix of a unit quaternion (w, x, y, z)."""
    w, x, y, z = (quaternion[i] for i in range(4))
    return ca.vertcat(
        ca.horzcat(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        ca.horzcat(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        ca.horzcat(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )


def hinge_rotation(axis: np.ndarray, angle: Any) -> Any:
    """Rotation matrix about a constant unit axis (Rodrigues), with exact zeros where the axis has them."""
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    square = cross @ cross
    s, c = ca.sin(angle), 1 - ca.cos(angle)
    return ca.DM.eye(3) + ca.sparsify(ca.DM(cross)) * s + ca.sparsify(ca.DM(square)) * c


@dataclass(frozen=True)
class Placements:
    """World placements of the bodies and hinges of one configuration, by the robot's order.

    Attributes:
        positions, rotations: of every body.  # B of (3, 1) and (3, 3)
        axes, centres: of every hinge: unit axis and a point on it, in the world.  # n of (3, 1)
    """

    positions: tuple[Any, ...]
    rotations: tuple[Any, ...]
    axes: tuple[Any, ...]
    centres: tuple[Any, ...]


class CasadiKinematics:
    """Symbolic kinematics about a reference configuration.

    A configuration is written ``q = q_ref (+) v``: base position ``p_ref + v[0:3]`` [m], base rotation
    ``Exp(v[3:6]) R_ref`` (rotation vector in the world frame [rad]), joints ``j_ref + v[6:]`` [rad].
    Near ``v = 0`` the tangent is that of world linear and world angular velocity of the base.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.tangent_size = 6 + robot.dof
        model = robot.model
        self._ids = [int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)) for name in robot.body_names]
        self._slot = {body: k for k, body in enumerate(self._ids)}

    @cached_property
    def symbols(self) -> tuple[Any, Any, Placements]:
        """One tangent v, one configuration q_ref, and the placements they give, for all functions of just these two.

        Writing the tree down takes a third of the time of what is then made of it.
        """
        tangent, reference = ca.SX.sym("v", self.tangent_size), ca.SX.sym("q", 7 + self.robot.dof)
        return tangent, reference, self.placements(tangent, reference)

    @cached_property
    def joint_symbols(self) -> tuple[Any, Any]:
        """Step and angle of every joint, for functions of a few joints alone.  # (n, 1) each"""
        return ca.SX.sym("z", self.robot.dof), ca.SX.sym("angle", self.robot.dof)

    def placements(self, tangent: Any, reference: Any) -> Placements:
        """Placements of every body.

        Args:
            tangent: v.  # (6 + n, 1)
            reference: q_ref, quaternion wxyz.  # (7 + n, 1)
        """
        model = self.robot.model
        base_position = reference[:3] + tangent[:3]
        base_rotation = exp_so3(tangent[3:6]) @ rotation_from_quaternion(reference[3:7])
        positions: list[Any] = []
        rotations: list[Any] = []
        axes: list[Any] = [None] * self.robot.dof
        centres: list[Any] = [None] * self.robot.dof
        for body in self._ids:
            if body == self._ids[0]:
                positions.append(base_position)
                rotations.append(base_rotation)
                continue
            parent = self._slot[int(model.body_parentid[body])]
            parent_rotation = rotations[parent]
            offset = ca.DM(model.body_pos[body])
            rotation = parent_rotation @ constant_rotation(model.body_quat[body])
            position = positions[parent] + parent_rotation @ offset
            if int(model.body_jntnum[body]) == 1:
                joint = int(model.body_jntadr[body])
                column = int(model.jnt_qposadr[joint]) - 7
                # MuJoCo measures a hinge from its model's qpos0 (the MJCF attribute ``ref``).
                zero = float(model.qpos0[7 + column])
                angle = reference[7 + column] + tangent[6 + column] - zero
                turned = rotation @ hinge_rotation(np.asarray(model.jnt_axis[joint]), angle)
                anchor = np.asarray(model.jnt_pos[joint])
                axes[column] = rotation @ ca.DM(model.jnt_axis[joint])
                centres[column] = position + rotation @ ca.DM(anchor)
                if np.any(anchor):
                    position = centres[column] - turned @ ca.DM(anchor)
                rotation = turned
            positions.append(position)
            rotations.append(rotation)
        return Placements(tuple(positions), tuple(rotations), tuple(axes), tuple(centres))

    def slot(self, body: str) -> int:
        """Index of a body in the robot's order."""
        return self.robot.body_names.index(body)


def constant_rotation(quaternion: np.ndarray) -> ca.DM:
    """Rotation matrix of a constant quaternion, with structural zeros where it has them."""
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, np.asarray(quaternion, dtype=np.float64))
    matrix[np.abs(matrix) < 1e-15] = 0.0
    return ca.sparsify(ca.DM(matrix.reshape(3, 3)))
