"""One step of inverse kinematics towards placements of some bodies: a quadratic program over the tangent space.

    minimise    1/2 ||W (e + J dq)||^2 + 1/2 (damping + lm_damping ||W e||^2) ||dq||^2
    subject to  lower <= dq <= upper

with the stacked errors e (6 a body, see ``frame_error``), their Jacobian J and the costs W on the diagonal: the same
program as mink's ``solve_ik`` with a ``FrameTask`` a body, to rounding.  What makes it fast is that all bodies share
one matrix of joint axes, and that one evaluation serves both the step and the test whether to go on.
"""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import c_int
from typing import NamedTuple

import daqp
import mujoco
import numpy as np

from gmr_traj.exceptions import SolverError
from gmr_traj.kinematics.mujoco_kinematics import body_id
from gmr_traj.retarget.frame_error import Twists, cross_matrix, derivatives, rotation_vectors, twists
from gmr_traj.robot import Robot


class Placement(NamedTuple):
    """Where the bodies are at one configuration, and how far from their targets.

    Attributes:
        rotations: of the bodies.  # (B, 3, 3)
        positions: of the bodies' points [m].  # (B, 3)
        errors: how far they are from the targets.
    """

    rotations: np.ndarray
    positions: np.ndarray
    errors: Twists


class Stage:
    """Costs of one stage, in the form the steps need.

    Args:
        costs: (position, orientation) cost of every body.  # (B, 2)
    """

    def __init__(self, costs: np.ndarray) -> None:
        six = np.repeat(np.asarray(costs, dtype=float), 3, axis=1)  # (B, 6)
        self.costs = six
        self.rows = np.flatnonzero(six.ravel())  # rows that weigh anything
        self.column = six.ravel()[self.rows][:, None]


class InverseKinematics:
    """The bodies of a robot that have targets, and the steps towards these.

    Args:
        robot: the robot.
        bodies: names of the bodies.  # B
        points: the point of each body that is meant, in its frame [m].  # (B, 3)
        damping: of the step, in units of cost^2.
        lm_damping: the same for each unit of the squared weighted errors: far targets are approached carefully.

    Raises:
        RobotError: the robot has no such body.
    """

    def __init__(
        self, robot: Robot, bodies: Sequence[str], points: np.ndarray, *, damping: float, lm_damping: float
    ) -> None:
        self.model = robot.model
        self.damping, self.lm_damping = damping, lm_damping
        self._data = mujoco.MjData(self.model)
        self._ids = np.array([body_id(robot, body) for body in bodies])
        self._points = np.asarray(points, dtype=float)[:, :, None] if np.any(points) else None
        # Which components of the tangent move which body: (B, 1, nv)
        moves = np.zeros((len(bodies), self.model.nv))
        for b, body in enumerate(self._ids):
            while body:
                first = self.model.body_dofadr[body]
                moves[b, first : first + self.model.body_dofnum[body]] = 1.0
                body = self.model.body_parentid[body]
        self._moves = moves[:, None, :]
        # Linear velocity of the world's origin, then angular velocity, for each component of the tangent: (6, nv)
        self._axes = np.zeros((6, self.model.nv))
        self._axes[:3, :3] = np.eye(3)
        self._nothing = np.zeros((0, self.model.nv))
        self._sense = np.zeros(self.model.nv, dtype=c_int)
        self.position, self.quaternion = np.zeros((len(bodies), 3)), np.zeros((len(bodies), 4))

    def aim(self, positions: np.ndarray, quaternions: np.ndarray) -> None:
        """Set the targets: positions of the points [m]  # (B, 3), unit quaternions wxyz  # (B, 4)."""
        self.position, self.quaternion = positions, quaternions

    def place(self, q: np.ndarray) -> Placement:
        """Evaluate the kinematics at a configuration.  # (nq,)"""
        data = self._data
        data.qpos[:] = q
        mujoco.mj_kinematics(self.model, data)
        rotations = data.xmat[self._ids].reshape(-1, 3, 3)
        positions = data.xpos[self._ids]
        if self._points is not None:
            positions = positions + np.matmul(rotations, self._points)[:, :, 0]
        w = rotation_vectors(data.xquat[self._ids], self.quaternion)
        d = np.matmul((self.position - positions)[:, None, :], rotations)[:, 0]
        return Placement(rotations, positions, twists(w, d))

    def objective(self, placement: Placement, stage: Stage) -> tuple[np.ndarray, np.ndarray]:
        """Hessian  # (nv, nv) and gradient  # (nv,) of the program at the configuration placed last."""
        e, derivative = placement.errors.e, derivatives(placement.errors)
        # In the world: (v, o) = (R' (m + a x p), R' a) for a joint with axis a and moment m = anchor x a.
        # So the rows of J are those of [M R', N R' - M R' [p]] times the axes, with (M, N) = de/d(v, o).
        back = placement.rotations.transpose(0, 2, 1)
        rows = np.empty_like(derivative)
        rows[:, :, :3] = np.matmul(derivative[:, :, :3], back)
        rows[:, :, 3:] = np.matmul(derivative[:, :, 3:], back)
        rows[:, :, 3:] -= np.matmul(rows[:, :, :3], cross_matrix(placement.positions))
        J = (rows.reshape(-1, 6) @ self._world_axes()).reshape(len(e), 6, -1) * self._moves
        weighted = stage.column * J.reshape(6 * len(e), -1)[stage.rows]
        error = stage.column[:, 0] * e.ravel()[stage.rows]
        H = weighted.T @ weighted
        H.flat[:: len(H) + 1] += self.damping + self.lm_damping * float(error @ error)
        return H, error @ weighted

    def step(
        self, q: np.ndarray, placement: Placement, stage: Stage, lower: np.ndarray, upper: np.ndarray
    ) -> np.ndarray:
        """The configuration after one step.

        Args:
            q: configuration.  # (nq,)
            placement: what ``place(q)`` returned, the last call of it.
            stage: the costs.
            lower: lower bounds of the step.  # (nv,)
            upper: its upper bounds.  # (nv,)

        Raises:
            SolverError: the quadratic program has no solution, as when the bounds contradict each other.
        """
        H, gradient = self.objective(placement, stage)
        dq, _, flag, _ = daqp.solve(H, gradient, self._nothing, upper, lower, self._sense)
        if flag <= 0:
            raise SolverError(f"the quadratic program of an inverse kinematics step was not solved (daqp: {flag})")
        out = q.copy()
        mujoco.mj_integratePos(self.model, out, dq, 1.0)
        return out

    def _world_axes(self) -> np.ndarray:
        data, axes = self._data, self._axes
        base = data.xmat[1].reshape(3, 3)
        axes[3:, 3:6] = base
        axes[3:, 6:] = data.xaxis[1:].T
        axes[:3, 3:6] = cross_matrix(data.xpos[1:2])[0] @ base
        anchors, hinges = data.xanchor[1:].T, axes[3:, 6:]
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            axes[i, 6:] = anchors[j] * hinges[k] - anchors[k] * hinges[j]
        return axes
