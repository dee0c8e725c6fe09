r"""The contact forces that come closest to what a clip asks for.

In every frame, over the forces of the able points k along the edges e of their friction pyramids,
``f_k = sum_e c_ke d_e`` with ``c_ke >= 0``:

    min  |F - sum f_k|^2 / (m g)^2 + |M - sum (p_k - o) x f_k|^2 / (m g L)^2 + w^2 |(tau - J' f) / limit|^2

F, M are the wrench the motion needs at the base's origin o, L is 1 m, tau the joint torques without contact.  The last
term only decides what the first two leave open (how two feet share the weight): w is 1e-3.
"""

from __future__ import annotations

from ctypes import c_int
from dataclasses import dataclass

import daqp
import mujoco
import numpy as np

from gmr_traj.collision.segments import cross
from gmr_traj.exceptions import SolverError
from gmr_traj.robot import Robot
from gmr_traj.verify.contact_points import ContactPoints
from gmr_traj.verify.inverse_dynamics import Demand

_TORQUE_WEIGHT = 1e-3
_RIDGE = 1e-10  # makes the program strictly convex: the corners of a foot can share a load in many ways
_UNBOUNDED = 1e30  # what daqp takes for infinity


@dataclass(frozen=True)
class Supported:
    """What remains of the demand once the floor presses as well as it can.

    Attributes:
        forces: contact forces at the points, world axes [N]; zero where a point is not able.  # (T, K, 3)
        force: residual force on the base [N].  # (T, 3)
        moment: residual moment about its origin [N m].  # (T, 3)
        torque: joint torques [N m].  # (T, n)
    """

    forces: np.ndarray
    force: np.ndarray
    moment: np.ndarray
    torque: np.ndarray


def pyramid(friction: float) -> np.ndarray:
    """Edges of the friction pyramid inside the cone of Coulomb friction, vertical part 1.  # (4, 3)"""
    edges = np.ones((4, 3))
    edges[:, :2] = friction * np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])
    return edges


def support(robot: Robot, qpos: np.ndarray, needed: Demand, points: ContactPoints, friction: float) -> Supported:
    """Solve for the contact forces in every frame.

    Args:
        robot: the robot.
        qpos: configurations.  # (T, 7 + n)
        needed: the demand of the motion.
        points: where the floor may press.
        friction: coefficient of friction [-].

    Raises:
        SolverError: the quadratic program of a frame was not solved.
    """
    frames, count = points.able.shape
    edges = pyramid(friction)
    weight = float(robot.model.body_mass.sum()) * float(-robot.model.opt.gravity[2])
    force, moment, torque = needed.force / weight, needed.moment / weight, needed.torque.copy()
    forces = np.zeros((frames, count, 3))
    carried = _carried(robot)[points.bodies]  # (K, n)
    data = mujoco.MjData(robot.model)
    scale = weight * _TORQUE_WEIGHT / robot.effort_limit
    for t in np.flatnonzero(points.able.any(axis=1)).tolist():
        able = np.flatnonzero(points.able[t])
        data.qpos[:] = qpos[t]
        mujoco.mj_kinematics(robot.model, data)
        p = points.positions[t, able]  # (k, 3)
        arms = p - qpos[t, :3]
        levers = cross(arms[:, None], edges)  # (k, 4, 3)
        # Row j of J' times an edge d at p: (axis_j x (p - anchor_j)) . d, for joints the point's body hangs on.
        speeds = cross(data.xaxis[1:], p[:, None] - data.xanchor[1:]) * carried[able][:, :, None]  # (k, n, 3)
        turning = np.matmul(edges, speeds.transpose(0, 2, 1))  # (k, 4, n)
        columns = 4 * len(able)
        A = np.concatenate(
            [np.tile(edges, (len(able), 1)), levers.reshape(columns, 3), turning.reshape(columns, -1) * scale], axis=1
        )  # (4k, 6 + n)
        b = np.concatenate([force[t], moment[t], torque[t] * (_TORQUE_WEIGHT / robot.effort_limit)])
        c = _nonnegative(A, b, t)
        f = (c.reshape(-1, 4) @ edges) * weight
        forces[t, able] = f
        force[t] -= f.sum(axis=0) / weight
        moment[t] -= cross(arms, f).sum(axis=0) / weight
        torque[t] -= c @ turning.reshape(columns, -1) * weight
    return Supported(forces, force * weight, moment * weight, torque)


def _nonnegative(A: np.ndarray, b: np.ndarray, frame: int) -> np.ndarray:
    """The c >= 0 with the least |A' c - b|.  # (columns,)"""
    count = len(A)
    H = A @ A.T
    H.flat[:: count + 1] += _RIDGE
    nothing, upper, sense = np.zeros((0, count)), np.full(count, _UNBOUNDED), np.zeros(count, dtype=c_int)
    c, _, flag, _ = daqp.solve(H, -(A @ b), nothing, upper, np.zeros(count), sense)
    if flag <= 0:
        raise SolverError(f"frame {frame}: the program for the contact forces was not solved (daqp: {flag})")
    return np.maximum(c, 0.0)


def _carried(robot: Robot) -> np.ndarray:
    """Whether each body hangs on each joint.  # (B, n)"""
    model = robot.model
    out = np.zeros((len(robot.body_names), robot.dof))
    for body in range(2, model.nbody):
        out[body - 1] = out[model.body_parentid[body] - 1]
        if model.body_jntnum[body]:
            out[body - 1, model.body_jntadr[body] - 1] = 1.0
    return out
