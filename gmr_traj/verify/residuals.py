"""How far a rollout is from the reference, as the residuals that the predictive controller squares."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.robot import Robot
from gmr_traj.verify.reference import Reference

EVERY = 2  # simulation steps between the moments that count

# What counts as an error of 1: base position [m], orientation [rad], velocities [m/s], [rad/s]; joints [rad], [rad/s].
POSITION, ORIENTATION, LINEAR, ANGULAR, JOINT, SPEED = 0.05, 0.25, 0.4, 1.5, 0.5, 12.0
TERMINAL = 3.0  # weight of the last moment relative to the others


@dataclass(frozen=True)
class Goal:
    """The reference over one horizon, at the moments that count.

    Attributes:
        q: configurations.  # (S, 7 + n)
        velocity: velocities with the base's angular velocity in its own axes.  # (S, 6 + n)
    """

    q: np.ndarray
    velocity: np.ndarray

    def after(self, step: int) -> Goal:
        """What is left of it after so many simulation steps, a multiple of ``EVERY``."""
        return Goal(self.q[step // EVERY :], self.velocity[step // EVERY :])


class Residuals:
    """Weighted differences of configuration and velocity.

    Args:
        robot: the robot.
    """

    def __init__(self, robot: Robot) -> None:
        n = robot.dof
        self._nq = 7 + n
        scale = np.repeat([POSITION, ORIENTATION, JOINT, LINEAR, ANGULAR, SPEED], [3, 3, n, 3, 3, n])
        self._weight = 1.0 / scale

    def goal(self, reference: Reference, rows: np.ndarray) -> Goal:
        """The reference at the moments that count, of the rows after each simulation step.  # (steps,)"""
        chosen = rows[EVERY - 1 :: EVERY]
        q, velocity = reference.q[chosen], reference.v[chosen].copy()
        inverse = Rotation.from_quat(q[:, 3:7], scalar_first=True).inv()
        velocity[:, 3:6] = inverse.apply(velocity[:, 3:6])
        return Goal(q, velocity)

    def of(self, states: np.ndarray, goal: Goal) -> np.ndarray:
        """Residuals of rollouts.

        Args:
            states: configurations and velocities after every step.  # (B, steps, nq + nv)
            goal: what they should be.

        Returns:
            Residuals; not finite where a rollout diverged.  # (B, S (12 + 2 n))
        """
        chosen = states[:, EVERY - 1 :: EVERY]
        q, v = chosen[..., : self._nq], chosen[..., self._nq :]
        turned = rotation_difference(goal.q[:, 3:7], q[..., 3:7])
        error = np.concatenate(
            [q[..., :3] - goal.q[:, :3], turned, q[..., 7:] - goal.q[:, 7:], v - goal.velocity], axis=-1
        )
        error *= self._weight
        error[:, -1] *= TERMINAL
        return np.asarray(error.reshape(len(states), -1))


def rotation_difference(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """``2 vec(a^-1 b)`` of unit quaternions wxyz, the rotation vector from a to b to second order.  # (..., 3)"""
    w = np.sum(a * b, axis=-1, keepdims=True)
    cross = np.cross(a[..., 1:], b[..., 1:])
    vector = a[..., :1] * b[..., 1:] - b[..., :1] * a[..., 1:] - cross
    return np.asarray(2.0 * np.sign(np.where(w == 0.0, 1.0, w)) * vector)
