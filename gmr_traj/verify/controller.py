"""What every controller is: a rule from the robot's state to joint targets, at 50 Hz."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from gmr_traj.robot import Robot
from gmr_traj.verify.reference import STRIDE, Reference
from gmr_traj.verify.simulated_robot import Motors, described_motors


class Controller(ABC):
    """Joint targets for the plant's motors.

    Attributes:
        name: as the command calls it, with the preset where it has one.
    """

    name: str

    def motors(self, robot: Robot) -> Motors:
        """The motors the controller is made for; those that robot.toml describes unless it brings its own."""
        return described_motors(robot)

    @abstractmethod
    def start(self, reference: Reference, qpos: np.ndarray, qvel: np.ndarray) -> None:
        """Begin a rollout; everything of an earlier one is forgotten.

        Args:
            reference: what to follow.
            qpos: configuration at the first tick.  # (7 + n,)
            qvel: velocity there, in MuJoCo's convention (the base's angular velocity in its own axes).  # (6 + n,)
        """

    @abstractmethod
    def target(self, tick: int, qpos: np.ndarray, qvel: np.ndarray) -> np.ndarray:
        """Joint targets to hold until the next tick [rad].  # (n,)

        Args:
            tick: control ticks since the start; the clip's own time.
            qpos: configuration now, as far as the controller is allowed to know it.  # (7 + n,)
            qvel: velocity now.  # (6 + n,)
        """


def feed_forward(reference: Reference) -> np.ndarray:
    """Targets whose PD torque is the reference's own where the robot is on it [rad].  # (N, n)

    target = q + kd / kp q' + tau / kp
    """
    robot = reference.robot
    v, torque = reference.v[:, 6:], reference.torque
    return np.asarray(reference.q[:, 7:] + (robot.damping * v + torque) / robot.stiffness)


class OpenLoop(Controller):
    """PD on the reference with feed-forward, and nothing else: the floor that any tracker must beat."""

    name = "pd"

    def start(self, reference: Reference, qpos: np.ndarray, qvel: np.ndarray) -> None:
        """Begin a rollout."""
        self._targets = feed_forward(reference)

    def target(self, tick: int, qpos: np.ndarray, qvel: np.ndarray) -> np.ndarray:
        """Joint targets of the tick."""
        return np.asarray(self._targets[min(tick * STRIDE, len(self._targets) - 1)])
