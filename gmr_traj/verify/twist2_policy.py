"""TWIST2's general tracker for the G1: one network for every motion.

Observations (1432): the present frame (127), ten past ones with the oldest first (1270), the mimic part once more (35).

    mimic (35)    reference's root velocity x, y in its own axes; root height; roll, pitch; yaw rate; 29 joints
    proprio (92)  base's angular velocity x 0.25; roll, pitch; q - q_default; q' x 0.05, ankles 0; last action

The target is ``clip(action, +-10) 0.5 + q_default``.  It sees neither place nor heading in the world, so both drift.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from gmr_traj.exceptions import PolicyError
from gmr_traj.kinematics.mujoco_kinematics import base_rotation
from gmr_traj.robot import Robot
from gmr_traj.verify.controller import Controller
from gmr_traj.verify.policy import Network, roll_pitch_yaw
from gmr_traj.verify.reference import Reference
from gmr_traj.verify.simulated_robot import Motors

INPUTS, JOINTS, PAST = 1432, 29, 10

_LEG = ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll")
_ARM = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "wrist_roll", "wrist_pitch", "wrist_yaw")
ORDER = tuple(
    f"{name}_joint"
    for name in (
        *(f"{side}_{part}" for side in ("left", "right") for part in _LEG),
        *(f"waist_{part}" for part in ("yaw", "roll", "pitch")),
        *(f"{side}_{part}" for side in ("left", "right") for part in _ARM),
    )
)


def _whole(leg: list[float], waist: list[float], left: list[float], right: list[float] | None = None) -> np.ndarray:
    return np.array(leg + leg + waist + left + (left if right is None else right))


DEFAULT = _whole(
    [-0.2, 0.0, 0.0, 0.4, -0.2, 0.0],
    [0.0] * 3,
    [0.0, 0.4, 0.0, 1.2, 0.0, 0.0, 0.0],
    [0.0, -0.4, 0.0, 1.2, 0.0, 0.0, 0.0],
)
STIFFNESS = _whole([100.0, 100.0, 100.0, 150.0, 40.0, 40.0], [150.0] * 3, [40.0] * 4 + [4.0] * 3)
DAMPING = _whole([2.0, 2.0, 2.0, 4.0, 2.0, 2.0], [4.0] * 3, [5.0] * 4 + [0.2] * 3)
ARMATURE = _whole([0.0103, 0.0251, 0.0103, 0.0251, 0.003597, 0.003597], [0.0103] * 3, [0.003597] * 5 + [0.00425] * 2)
_ANKLES = [k for k, name in enumerate(ORDER) if "ankle" in name]


class Twist2Policy(Controller):
    """The controller.

    Args:
        network: the network.
        robot: the robot, which must have the G1's 29 joints.
        steer: gain by which the commanded velocity and yaw rate are turned toward the reference's place and heading
            in the world [1/s]; 0 leaves the command as the reference has it.

    Raises:
        PolicyError: the network has another number of actions, or the robot other joints.
    """

    def __init__(self, network: Network, robot: Robot, steer: float = 0.0) -> None:
        if network.outputs != JOINTS:
            raise PolicyError(f"{network.path}: makes {network.outputs} actions; expected {JOINTS}")
        if robot.joint_names != ORDER:
            raise PolicyError(
                f"{network.path}: is for the G1 with 29 joints; robot {robot.name} has {robot.dof} others"
            )
        self.name = "policy twist2" + (f" steered {steer:g}" if steer else "")
        self._network, self._steer = network, steer

    def motors(self, robot: Robot) -> Motors:
        """The gains and the armature it was trained with, the robot's limits."""
        return Motors(STIFFNESS, DAMPING, ARMATURE, robot.effort_limit, robot.velocity_limit)

    def start(self, reference: Reference, qpos: np.ndarray, qvel: np.ndarray) -> None:
        """Begin a rollout; the past is the first frame, again and again."""
        self._reference, self._action = reference, np.zeros(JOINTS)
        first = self._frame(0, qpos, qvel)
        self._past = deque([first] * PAST, maxlen=PAST)

    def target(self, tick: int, qpos: np.ndarray, qvel: np.ndarray) -> np.ndarray:
        """Joint targets of the tick."""
        frame = self._frame(tick, qpos, qvel)
        self._action = self._network(np.concatenate([frame, *self._past, frame[:35]]))
        self._past.append(frame)
        return np.asarray(np.clip(self._action, -10.0, 10.0) * 0.5 + DEFAULT)

    def _frame(self, tick: int, qpos: np.ndarray, qvel: np.ndarray) -> np.ndarray:
        """The frame of a tick: what to do, and what is.  # (127,)"""
        roll, pitch, _ = roll_pitch_yaw(qpos[3:7])
        speeds = 0.05 * qvel[6:]
        speeds[_ANKLES] = 0.0
        proprio = [0.25 * qvel[3:6], [roll, pitch], qpos[7:] - DEFAULT, speeds, self._action]
        return np.concatenate([self._mimic(tick, qpos), *proprio])

    def _mimic(self, tick: int, qpos: np.ndarray) -> np.ndarray:
        q, v = self._reference.at(tick)
        roll, pitch, yaw = roll_pitch_yaw(q[3:7])
        R = base_rotation(q)
        velocity, turning = R.T @ v[:3], R.T @ v[3:6]
        if self._steer:
            off = yaw - roll_pitch_yaw(qpos[3:7])[2]
            velocity = velocity + self._steer * (base_rotation(qpos).T @ (q[:3] - qpos[:3]))
            turning = turning + self._steer * np.array([0.0, 0.0, (off + np.pi) % (2.0 * np.pi) - np.pi])
        return np.concatenate([velocity[:2], [q[2], roll, pitch, turning[2]], q[7:]])
