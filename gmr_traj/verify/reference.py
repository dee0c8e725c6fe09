"""What a controller is asked to follow: the clip on a fine grid of time, with velocities and feed-forward torques."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gmr_traj.metrics.observation import observe
from gmr_traj.metrics.settings import shipped
from gmr_traj.motion import RobotMotion
from gmr_traj.resampling import resample
from gmr_traj.robot import Robot
from gmr_traj.verify.contact_forces import support
from gmr_traj.verify.contact_points import contact_points
from gmr_traj.verify.derivatives import derivatives
from gmr_traj.verify.inverse_dynamics import inverse_dynamics

GRID = 0.01  # [s] time between rows
CONTROL = 0.02  # [s] time between control ticks
STRIDE = round(CONTROL / GRID)


@dataclass(frozen=True)
class Reference:
    """A clip on a grid of 10 ms; past its end it holds its last configuration.

    Attributes:
        robot: the robot.
        q: configurations.  # (N, 7 + n)
        v: velocities, world axes.  # (N, 6 + n)
        torque: joint torques of the audit's inverse dynamics, within the effort limits [N m].  # (N, n)
        ticks: number of control ticks within the clip, the first included.
    """

    robot: Robot
    q: np.ndarray
    v: np.ndarray
    torque: np.ndarray
    ticks: int

    def at(self, tick: int) -> tuple[np.ndarray, np.ndarray]:
        """Configuration and velocity at a control tick."""
        row = min(tick * STRIDE, len(self.q) - 1)
        return self.q[row], self.v[row]


def reference(motion: RobotMotion, robot: Robot, after: float = 1.0) -> Reference:
    """Put a clip on the grid.

    Configurations are linear between frames (the base's orientation by slerp), and so are velocities and torques, both
    found at the clip's own frames.

    Args:
        motion: the clip.
        robot: its robot.
        after: how long the last configuration is held past the end [s].
    """
    v, a = derivatives(motion)
    bars = shipped("verify_audit")
    needed = inverse_dynamics(robot, motion.qpos, v, a)
    points = contact_points(observe(motion, robot), bars, "feed_forward")
    torque = support(robot, motion.qpos, needed, points, bars("contact", "friction")).torque
    torque = np.clip(torque, -robot.effort_limit, robot.effort_limit)
    fine = resample(motion, 1.0 / GRID).qpos
    times = np.arange(len(fine)) * GRID
    own = np.arange(motion.frames) / motion.fps
    held = round(after / GRID)
    return Reference(
        robot=robot,
        q=np.concatenate([fine, np.repeat(fine[-1:], held, axis=0)]),
        v=np.concatenate([_columns(times, own, v), np.zeros((held, v.shape[1]))]),
        torque=np.concatenate([_columns(times, own, torque), np.repeat(torque[-1:], held, axis=0)]),
        ticks=(len(fine) - 1) // STRIDE + 1,
    )


def _columns(times: np.ndarray, own: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.stack([np.interp(times, own, column) for column in values.T], axis=1)
