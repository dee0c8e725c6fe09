"""One step of inverse kinematics towards placements of some bodies: a quadratic program over the tangent space.

    minimise    1/2 ||W (e + J dq)||^2 + 1/2 (damping + lm_damping ||W e||^2) ||dq||^2
    subject to  lower <= dq <= upper

with the stacked errors e (6 a body, see ``frame_error``), their Jacobian J and the costs W on the diagonal: the same
program as mink's ``solve_ik`` with a ``FrameTask`` a body, to rounding.

A step takes tens of microseconds, and what costs is not arithmetic but the number of calls.  So MuJoCo places the
bodies, one CasADi function makes all errors and another the whole objective, from and to memory that stays where it
is and as machine code where there is a compiler.  One evaluation of the errors serves both the step and the test
whether to go on.
"""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import c_int

import daqp
import mujoco
import numpy as np

from gmr_traj.exceptions import SolverError
from gmr_traj.kinematics.mujoco_kinematics import body_id
from gmr_traj.machine_code import compiled
from gmr_traj.retarget.error_functions import Call, body_errors
from gmr_traj.retarget.frame_error import coupling
from gmr_traj.retarget.objective_function import Tree, objective
from gmr_traj.robot import Robot


class InverseKinematics:
    """The bodies of a robot that have targets, and the steps towards these.

    Args:
        robot: the robot.
        bodies: names of the bodies.  # B
        points: the point of each body that is meant, in its frame [m].  # (B, 3)
        stages: (position, orientation) cost of every body, once for each kind of step.  # (B, 2) each
        damping: of the step, in units of cost^2.
        lm_damping: the same for each unit of the squared weighted errors: far targets are approached carefully.

    Attributes:
        errors: of the bodies at the configuration placed last, in the world's axes, linear part first.  # (B, 6)
        squares: their squared linear [m^2] and angular [rad^2] lengths.  # (B, 2)

    Raises:
        RobotError: the robot has no such body.
    """

    def __init__(
        self,
        robot: Robot,
        bodies: Sequence[str],
        points: np.ndarray,
        stages: Sequence[np.ndarray],
        *,
        damping: float,
        lm_damping: float,
    ) -> None:
        self.model = robot.model
        self._data = mujoco.MjData(self.model)
        # Views of MuJoCo's arrays, which stay where they are.
        self._qpos, self._xpos, self._xquat = self._data.qpos, self._data.xpos, self._data.xquat
        count, nv = len(bodies), self.model.nv
        self._ids = np.array([body_id(robot, body) for body in bodies])
        self._at, self._turned, own = np.zeros((count, 3)), np.zeros((count, 4)), np.array(points, dtype=float)
        self._position, self._quaternion = np.zeros((count, 3)), np.zeros((count, 4))
        self.errors, self.squares, rest = np.zeros((count, 6)), np.zeros((count, 2)), np.zeros((count, 5))
        self._evaluate = Call(
            compiled(body_errors(bool(own.any()), count)),
            [self._at, self._turned, own, self._position, self._quaternion],
            [self.errors, rest, self.squares],
        )
        self._H, self._gradient = np.zeros((nv, nv)), np.zeros(nv)
        tree = Tree(tuple(self.model.dof_parentid.tolist()), tuple(self._last(body) for body in self._ids.tolist()))
        places = [self.errors, rest, self.squares, self._data.subtree_com[1], self._data.cdof]
        inputs = [*places, np.array([damping, lm_damping])]
        self._objectives = []
        for costs in stages:
            of_stage = tuple(map(tuple, np.asarray(costs, dtype=float).tolist()))
            function = objective(tree, of_stage, coupling)
            self._objectives.append(Call(compiled(function), inputs, [self._H, self._gradient]))
        self._nothing, self._sense = np.zeros((0, nv)), np.zeros(nv, dtype=c_int)
        self._q = np.zeros(self.model.nq)

    def _last(self, body: int) -> int:
        """The component of the tangent that moves a body and nothing between it and the body."""
        while not self.model.body_dofnum[body]:
            body = int(self.model.body_parentid[body])
        return int(self.model.body_dofadr[body] + self.model.body_dofnum[body] - 1)

    def aim(self, positions: np.ndarray, quaternions: np.ndarray) -> None:
        """Set the targets: positions of the points [m]  # (B, 3), unit quaternions wxyz  # (B, 4)."""
        self._position[:], self._quaternion[:] = positions, quaternions

    def place(self, q: np.ndarray) -> None:
        """Evaluate the errors at a configuration.  # (nq,)"""
        self._q = q
        self._qpos[:] = q
        mujoco.mj_kinematics(self.model, self._data)
        self._xpos.take(self._ids, 0, self._at)
        self._xquat.take(self._ids, 0, self._turned)
        self._evaluate()

    def objective(self, stage: int) -> tuple[np.ndarray, np.ndarray]:
        """Hessian  # (nv, nv) and gradient  # (nv,) of the program at the configuration placed last.

        They stay what they are until the next call.

        Args:
            stage: which of the stages' costs.
        """
        mujoco.mj_comPos(self.model, self._data)
        self._objectives[stage]()
        return self._H, self._gradient

    def step(self, stage: int, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
        """The configuration one step after the one placed last.

        Args:
            stage: which of the stages' costs.
            lower: lower bounds of the step.  # (nv,)
            upper: its upper bounds.  # (nv,)

        Raises:
            SolverError: the quadratic program has no solution, as when the bounds contradict each other.
        """
        return self.moved(*self.objective(stage), lower, upper)

    def moved(self, H: np.ndarray, gradient: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
        """The configuration that the minimum of ``1/2 dq' H dq + gradient' dq`` leads to from the one placed last.

        Args:
            H: positive definite.  # (nv, nv)
            gradient: likewise.  # (nv,)
            lower: lower bounds of dq.  # (nv,)
            upper: its upper bounds.  # (nv,)

        Raises:
            SolverError: the quadratic program has no solution, as when the bounds contradict each other.
        """
        dq, _, flag, _ = daqp.solve(H, gradient, self._nothing, upper, lower, self._sense)
        if flag <= 0:
            raise SolverError(f"the quadratic program of an inverse kinematics step was not solved (daqp: {flag})")
        out = self._q.copy()
        mujoco.mj_integratePos(self.model, out, dq, 1.0)
        return out
