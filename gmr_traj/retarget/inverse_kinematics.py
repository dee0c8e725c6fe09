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
from gmr_traj.retarget.frame_error import Twists, cross_matrix, relative_to, turning_slopes, twists
from gmr_traj.robot import Robot


class Stage:
    """Costs of one stage, in the form the steps need.

    Args:
        costs: (position, orientation) cost of every body.  # (B, 2)

    Attributes:
        costs: one a component of the errors.  # (B, 6)
        rows: which components of all bodies' errors weigh anything.  # (N,)
        column: their costs.  # (N, 1)
        bodies: whose they are.  # (N,)
    """

    def __init__(self, costs: np.ndarray) -> None:
        self.costs = np.repeat(np.asarray(costs, dtype=float), 3, axis=1)
        self.rows = np.flatnonzero(self.costs)
        self.column = self.costs.ravel()[self.rows][:, None]
        self.bodies = self.rows // 6


class Placement(NamedTuple):
    """Where the bodies are at one configuration, and how far from their targets.

    Attributes:
        rotations: of the bodies.  # (B, 3, 3)
        errors: how far they are from the targets.
    """

    rotations: np.ndarray
    errors: Twists


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
        # Views of MuJoCo's arrays, which stay where they are.
        self._xmat, self._xpos, self._xquat = self._data.xmat, self._data.xpos, self._data.xquat
        self._axes, self._centre, self._qpos = self._data.cdof, self._data.subtree_com[1], self._data.qpos
        self._ids = np.array([body_id(robot, body) for body in bodies])
        self._points = np.asarray(points, dtype=float)[:, :, None] if np.any(points) else None
        # Which components of the tangent move which body: (B, nv)
        self._moves = np.zeros((len(bodies), self.model.nv))
        for b, body in enumerate(self._ids):
            while body:
                first = self.model.body_dofadr[body]
                self._moves[b, first : first + self.model.body_dofnum[body]] = 1.0
                body = self.model.body_parentid[body]
        self._nothing = np.zeros((0, self.model.nv))
        self._sense = np.zeros(self.model.nv, dtype=c_int)
        self.aim(np.zeros((len(bodies), 3)), np.tile([1.0, 0.0, 0.0, 0.0], (len(bodies), 1)))

    def aim(self, positions: np.ndarray, quaternions: np.ndarray) -> None:
        """Set the targets: positions of the points [m]  # (B, 3), unit quaternions wxyz  # (B, 4)."""
        self._position, self._relative = positions, relative_to(quaternions)

    def place(self, q: np.ndarray) -> Placement:
        """Evaluate the kinematics at a configuration.  # (nq,)"""
        self._qpos[:] = q
        mujoco.mj_kinematics(self.model, self._data)
        rotations = self._xmat[self._ids].reshape(-1, 3, 3)
        positions = self._xpos[self._ids]
        if self._points is not None:
            positions = positions + np.matmul(rotations, self._points)[:, :, 0]
        way = np.matmul(self._relative, self._xquat[self._ids][:, :, None])[:, :, 0]
        d = np.matmul((self._position - positions)[:, None, :], rotations)[:, 0]
        return Placement(rotations, twists(way, d))

    def objective(self, placement: Placement, stage: Stage) -> tuple[np.ndarray, np.ndarray]:
        """Hessian  # (nv, nv) and gradient  # (nv,) of the program at the configuration placed last."""
        mujoco.mj_comPos(self.model, self._data)
        # MuJoCo's axes are (o, v) of a point that goes along with the body at the robot's centre of mass c, so that a
        # body at p has R' (v + o x (p - c)) and R' o in its own axes.  With M = A R' and D as in `frame_error`,
        # A [d] R' = M [p_t - p], and the rows of J are (M [p_t - c] - D M, -M) and (-M, 0) times the axes.
        M = np.matmul(placement.errors.A, placement.rotations.transpose(0, 2, 1))
        rows = np.zeros((len(M), 6, 6))
        rows[:, :3, :3] = np.matmul(M, cross_matrix(self._position - self._centre))
        rows[:, :3, :3] -= np.matmul(turning_slopes(placement.errors), M)
        rows[:, :3, 3:] = rows[:, 3:, :3] = -M
        weighted = (stage.column * rows.reshape(-1, 6)[stage.rows]) @ self._axes.T
        weighted *= self._moves[stage.bodies]
        error = stage.column[:, 0] * placement.errors.e.ravel()[stage.rows]
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
