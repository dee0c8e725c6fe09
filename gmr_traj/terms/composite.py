"""Tracking costs of many bodies with a Hessian by the composite rigid body algorithm.

Wanting point p_b of a body near a target with weight w_b, and its rotation R_b near a target with weight u_b,

    phi = sum_b w_b/2 |p_b - p*_b|^2 + u_b/2 (3 - tr(R*_b' R_b)),

has a Gauss-Newton Hessian that is the *mass matrix* of an imagined robot whose bodies carry point masses w_b at p_b
and rotational inertias u_b I: ``H = sum_b w_b Jp_b' Jp_b + u_b Jr_b' Jr_b``.  So it is computed the way mass matrices
are, by composite inertias from the leaves to the root (Featherstone, Rigid Body Dynamics Algorithms, section 6.2),
and the gradient by composite forces: a third of the operations of forming the Jacobians and their products.
The rotation cost is ``u_b (1 - cos t)`` of the angle t between the rotations: smooth at any angle, ``u_b t^2 / 2``
near zero.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import mujoco
import numpy as np

from gmr_traj.kinematics.casadi_kinematics import CasadiKinematics, Placements

_SMALL_ANGLE_SQUARED = 1e-8


def left_jacobian(rotation_vector: Any) -> Any:
    """Left Jacobian of SO(3), ``(3, 3)``: the world angular velocity of ``Exp(w)`` is ``J_l(w) dw/dt``.

    ``J_l(w) = I + (1 - cos t) / t^2 [w] + (t - sin t) / t^3 [w]^2`` with t = ``|w|`` [rad].
    """
    square = ca.sumsqr(rotation_vector)
    small = square < _SMALL_ANGLE_SQUARED
    guarded = ca.if_else(small, 1.0, square)
    angle = ca.sqrt(guarded)
    first = ca.if_else(small, 0.5 - square / 24, (1 - ca.cos(angle)) / guarded)
    second = ca.if_else(small, 1 / 6 - square / 120, (angle - ca.sin(angle)) / (guarded * angle))
    cross = ca.skew(rotation_vector)
    return ca.SX.eye(3) + first * cross + second * cross @ cross


class CompositeCost:
    """Accumulates point and rotation targets of one configuration, then gives value, gradient and Hessian."""

    def __init__(self, kinematics: CasadiKinematics, tangent: Any, placements: Placements) -> None:
        self._kinematics = kinematics
        self._tangent = tangent
        self._placements = placements
        count = len(placements.positions)
        self.value = ca.SX(0)
        self._touched = np.zeros(count, bool)
        self._mass = [ca.SX(0)] * count
        self._moment = [ca.SX.zeros(3)] * count
        self._inertia = [ca.SX.zeros(3, 3)] * count
        self._force = [ca.SX.zeros(3)] * count
        self._torque = [ca.SX.zeros(3)] * count

    def add_point(self, slot: int, point: Any, target: Any, weight: Any, robust: float) -> None:
        """A point fixed to body ``slot`` (world position now) is wanted at ``target``.

        The cost is pseudo-Huber, ``w s^2 (sqrt(1 + |e|^2 / s^2) - 1)`` with s = ``robust`` [m]: quadratic for errors
        well below s, linear above.  Its Hessian is modelled by ``w / sqrt(1 + |e|^2 / s^2)`` times that of the square,
        which is never smaller than the true one along the error (iteratively reweighted least squares).
        """
        arm = point - self._placements.positions[0]
        error = point - target
        root = ca.sqrt(1 + ca.sumsqr(error) / robust**2)
        self.value += weight * robust**2 * (root - 1)
        weight = weight / root
        self._mass[slot] += weight
        self._moment[slot] += weight * arm
        self._inertia[slot] += weight * (ca.sumsqr(arm) * ca.SX.eye(3) - arm @ arm.T)
        self._force[slot] += weight * error
        self._torque[slot] += weight * ca.cross(arm, error)
        self._touched[slot] = True

    def add_rotation(self, slot: int, target: Any, weight: Any) -> None:
        """The rotation of body ``slot`` is wanted at the matrix ``target``."""
        rotation = self._placements.rotations[slot]
        self.value += 0.5 * weight * (3 - ca.sum1(ca.sum2(rotation * target)))
        self._inertia[slot] += weight * ca.SX.eye(3)
        for column in range(3):
            self._torque[slot] += 0.5 * weight * ca.cross(target[:, column], rotation[:, column])
        self._touched[slot] = True

    def derivatives(self) -> tuple[Any, Any]:
        """Gradient, ``(6 + n, 1)``, and upper triangle of the Gauss-Newton Hessian, ``(6 + n, 6 + n)``."""
        parents, joints = self._tree()
        size = self._kinematics.tangent_size
        for slot in range(len(parents) - 1, 0, -1):
            self._fold(slot, parents[slot])
        base = self._placements.positions[0]
        turn = left_jacobian(self._tangent[3:6])
        gradient, hessian = ca.SX.zeros(size), ca.SX(size, size)
        gradient[:3] = self._force[0]
        gradient[3:6] = turn.T @ self._torque[0]
        hessian[:3, :3] = self._mass[0] * ca.SX.eye(3)
        hessian[:3, 3:6] = -ca.skew(self._moment[0]) @ turn
        hessian[3:6, 3:6] = turn.T @ self._inertia[0] @ turn
        for slot in range(1, len(parents)):
            joint = joints[slot]
            if joint < 0 or not self._touched[slot]:
                continue
            axis = self._placements.axes[joint]
            # The hinge's motion of the composite, as angular velocity and linear velocity at the base's origin.
            linear = ca.cross(axis, base - self._placements.centres[joint])
            angular_momentum = self._inertia[slot] @ axis + ca.cross(self._moment[slot], linear)
            momentum = self._mass[slot] * linear - ca.cross(self._moment[slot], axis)
            gradient[6 + joint] = ca.dot(axis, self._torque[slot]) + ca.dot(linear, self._force[slot])
            hessian[:3, 6 + joint] = momentum
            hessian[3:6, 6 + joint] = turn.T @ angular_momentum
            ancestor = slot
            while ancestor > 0:
                other = joints[ancestor]
                if other >= 0:
                    other_axis = self._placements.axes[other]
                    other_linear = ca.cross(other_axis, base - self._placements.centres[other])
                    row, column = min(other, joint), max(other, joint)
                    hessian[6 + row, 6 + column] = ca.dot(other_axis, angular_momentum) + ca.dot(other_linear, momentum)
                ancestor = parents[ancestor]
        return gradient, ca.sparsify(ca.triu(hessian))

    def _fold(self, slot: int, parent: int) -> None:
        """Add a body's composite to its parent's."""
        if not self._touched[slot]:
            return
        for part in (self._mass, self._moment, self._inertia, self._force, self._torque):
            part[parent] = part[parent] + part[slot]
        self._touched[parent] = True

    def _tree(self) -> tuple[list[int], list[int]]:
        """Parent slot and joint index (-1: none) of every body in the robot's order."""
        robot = self._kinematics.robot
        model = robot.model
        ids = [int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)) for name in robot.body_names]
        slot = {body: k for k, body in enumerate(ids)}
        parents = [slot.get(int(model.body_parentid[body]), -1) for body in ids]
        joints = [-1] * len(ids)
        for k, body in enumerate(ids[1:], start=1):
            if int(model.body_jntnum[body]):
                joints[k] = int(model.jnt_qposadr[int(model.body_jntadr[body])]) - 7
        return parents, joints
