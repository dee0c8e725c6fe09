"""Points of a robot in all frames at once, and the gradient of a scalar of them, in NumPy alone.

One pass down the tree places the bodies, one pass up collects forces: a gradient g_k = dL/dp_k at a point p_k is a
force on its body, and

    dL/d(base position) = sum F,   dL/d(base rotation) = torque about the base,   dL/dq_j = a_j . (torque_j - o_j x F_j)

with F_j, torque_j the force and torque (about the world's origin) of everything that joint j carries, a_j its axis and
o_j its anchor in the world.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gmr_traj.kinematics.mujoco_kinematics import body_id
from gmr_traj.robot import Robot


@dataclass(frozen=True)
class Placed:
    """Where the points and joints are.

    Attributes:
        points: the points [m].  # (T, K, 3)
        base: position of the base [m].  # (T, 3)
        axes: world axes of the joints that carry a point, by joint.  # each (3, T)
        anchors: their world anchors [m].  # each (3, T)
    """

    points: np.ndarray
    base: np.ndarray
    axes: dict[int, np.ndarray]
    anchors: dict[int, np.ndarray]


class BatchedKinematics:
    """Points fixed in bodies of a robot.

    Args:
        robot: the robot.
        points: (body, point in its frame [m]).  # K

    Raises:
        RobotError: the robot has no such body.
    """

    def __init__(self, robot: Robot, points: Sequence[tuple[str, np.ndarray]]) -> None:
        self._model, self.dof = robot.model, robot.dof
        self._of_body: dict[int, list[int]] = {}
        self._points = np.array([point for _, point in points], dtype=float).reshape(-1, 3)
        needed: set[int] = set()
        for k, (name, _) in enumerate(points):
            body = body_id(robot, name)
            self._of_body.setdefault(body, []).append(k)
            while body > 0:
                needed.add(body)
                body = int(robot.model.body_parentid[body])
        self._bodies = sorted(needed)  # parents before children
        self._local = {b: _local_rotation(robot.model.body_quat[b]) for b in self._bodies}
        self._joint = {
            b: int(robot.model.body_jntadr[b]) for b in self._bodies if b > 1 and int(robot.model.body_jntnum[b])
        }
        # A hinge's rotation is A + sin(q) A K + (1 - cos q) A K^2, K the cross matrix of its axis: these, as columns.
        self._hinge = {}
        for b, j in self._joint.items():
            K = _cross_matrix(robot.model.jnt_axis[j])
            self._hinge[b] = np.stack([self._local[b], self._local[b] @ K, self._local[b] @ K @ K]).reshape(3, 9).T

    def place(self, base: np.ndarray, rotation: np.ndarray, joints: np.ndarray) -> Placed:
        """Place the points.

        Args:
            base: positions of the base [m].  # (T, 3)
            rotation: its rotation matrices.  # (T, 3, 3)
            joints: joint positions [rad].  # (T, n)
        """
        model = self._model
        # Frames last: NumPy's small matrices are slow one by one, and fast element by element over the frames.
        positions = {1: np.ascontiguousarray(base.T)}  # (3, T)
        rotations = {1: np.ascontiguousarray(rotation.transpose(1, 2, 0))}  # (3, 3, T)
        q = np.ascontiguousarray(joints.T)  # (n, T)
        factors = np.stack([np.ones_like(q), np.sin(q), 1.0 - np.cos(q)], axis=1)  # (n, 3, T)
        axes: dict[int, np.ndarray] = {}
        anchors: dict[int, np.ndarray] = {}
        for b in self._bodies[1:]:
            parent = int(model.body_parentid[b])
            turned, local = rotations[parent], self._local[b]
            placed = positions[parent] + _apply(turned, model.body_pos[b])
            if b not in self._joint:
                rotations[b], positions[b] = np.einsum("ijt,jk->ikt", turned, local), placed
                continue
            j = self._joint[b]
            turn = (self._hinge[b] @ factors[j - 1]).reshape(3, 3, -1)
            rotations[b] = sum(turned[:, i, None] * turn[i] for i in range(3))  # (3, 3, T)
            anchors[j] = placed + _apply(turned, local @ model.jnt_pos[j])
            positions[b] = anchors[j] - _apply(rotations[b], model.jnt_pos[j])
            axes[j] = _apply(rotations[b], model.jnt_axis[j])
        points = np.empty((len(self._points), 3, len(base)))
        for b, own in self._of_body.items():
            for k in own:
                points[k] = positions[b] + _apply(rotations[b], self._points[k])
        placed_points = np.ascontiguousarray(points.transpose(2, 0, 1))
        return Placed(placed_points, base, axes, anchors)

    def gradient(self, placed: Placed, forces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Gradient of a scalar L of the points.

        Args:
            placed: where they are.
            forces: dL/dp.  # (T, K, 3)

        Returns:
            dL by the base's position  # (T, 3), by its rotation (exp(w) R, w in world axes)  # (T, 3), by the joints
            # (T, n).
        """
        along = np.ascontiguousarray(forces.transpose(1, 2, 0))  # (K, 3, T)
        moments = np.ascontiguousarray(np.cross(placed.points, forces).transpose(1, 2, 0))
        force = {b: np.zeros(along.shape[1:]) for b in self._bodies}
        torque = {b: np.zeros(along.shape[1:]) for b in self._bodies}
        joints = np.zeros((len(forces), self.dof))
        for b in reversed(self._bodies):
            if b in self._of_body:
                force[b] += along[self._of_body[b]].sum(axis=0)
                torque[b] += moments[self._of_body[b]].sum(axis=0)
            if b == self._bodies[0]:
                break
            if b in self._joint:
                j = self._joint[b]
                about = torque[b] - np.cross(placed.anchors[j], force[b], axis=0)
                joints[:, j - 1] = np.einsum("it,it->t", placed.axes[j], about)
            parent = int(self._model.body_parentid[b])
            force[parent] += force[b]
            torque[parent] += torque[b]
        base = self._bodies[0]
        return force[base].T, torque[base].T - np.cross(placed.base, force[base].T), joints


def _apply(rotations: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """One vector (3,) turned by rotations (3, 3, T), (3, T)."""
    return vector @ rotations  # for each row i the vector times (3, T)


def left_jacobian(w: np.ndarray) -> np.ndarray:
    """J(w) with ``exp(w + d) = exp(J(w) d) exp(w)`` for small d.

        J(w) = I + (1 - cos a) / a^2 [w] + (a - sin a) / a^3 [w]^2,   a = |w|

    Args:
        w: rotation vectors [rad].  # (T, 3)

    Returns:
        Matrices.  # (T, 3, 3)
    """
    angle = np.linalg.norm(w, axis=1)
    small = angle < 1e-4  # the series' next terms are below 1e-9 there
    a = np.where(small, 1.0, angle)
    first = np.where(small, 0.5 - angle**2 / 24.0, (1.0 - np.cos(a)) / a**2)
    second = np.where(small, 1.0 / 6.0 - angle**2 / 120.0, (a - np.sin(a)) / a**3)
    cross = np.zeros((len(w), 3, 3))
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -w[:, 2], w[:, 1], -w[:, 0]
    cross -= cross.transpose(0, 2, 1)
    return np.eye(3) + first[:, None, None] * cross + second[:, None, None] * (cross @ cross)


def _local_rotation(quaternion: np.ndarray) -> np.ndarray:
    w, v = float(quaternion[0]), np.asarray(quaternion[1:], dtype=float)
    K = _cross_matrix(v)
    return np.eye(3) + 2.0 * w * K + 2.0 * K @ K


def _cross_matrix(x: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -x[2], x[1]], [x[2], 0.0, -x[0]], [-x[1], x[0], 0.0]])
