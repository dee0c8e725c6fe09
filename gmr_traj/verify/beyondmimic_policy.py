"""Policies of BeyondMimic's form: one network for one motion, with all it needs to know in its metadata.

Observations (160, or 154 without state estimation, which lacks the two marked +), every vector in the robot's own axes:

    command          reference's joint positions and velocities                      58
    anchor position  of the reference's anchor body in the robot's anchor frame +     3
    anchor axes      the first two columns of its rotation there, row by row          6
    base velocity    linear +, angular                                              3, 3
    joints           q - q_default, q', last action                         29, 29, 29

in this order unless the metadata has another (see :mod:`~gmr_traj.verify.policy_form`).  The target is
``q_default + action_scale action``; joints have the order of the metadata's names.
"""

from __future__ import annotations

import mujoco
import numpy as np

from gmr_traj.exceptions import PolicyError
from gmr_traj.kinematics.mujoco_kinematics import base_rotation, body_id
from gmr_traj.robot import Robot
from gmr_traj.verify.controller import Controller
from gmr_traj.verify.policy import Network
from gmr_traj.verify.policy_form import JOINTS, read_form
from gmr_traj.verify.reference import Reference
from gmr_traj.verify.simulated_robot import Motors


class BeyondMimicPolicy(Controller):
    """The controller.

    Args:
        network: the network.
        robot: the robot, which must have the joints that the metadata names.

    Raises:
        PolicyError: the network has another number of actions, or its metadata are not what they should be.
    """

    def __init__(self, network: Network, robot: Robot) -> None:
        self.name = "policy beyondmimic"
        self._network, self._robot = network, robot
        if network.outputs != JOINTS:
            raise PolicyError(f"{network.path}: makes {network.outputs} actions; expected {JOINTS}")
        self._form = read_form(network, robot)
        # For each joint of the policy its index in the robot.
        self._order = np.array([robot.joint_names.index(name) for name in self._form.joint_names])
        self._anchor = body_id(robot, self._form.anchor)
        self._data = mujoco.MjData(robot.model)

    def motors(self, robot: Robot) -> Motors:
        """The gains of its metadata; armature and limits of the robot."""
        kp, kd = np.empty(JOINTS), np.empty(JOINTS)
        kp[self._order], kd[self._order] = self._form.stiffness, self._form.damping
        armature = np.array(robot.model.dof_armature[6:])
        return Motors(kp, kd, armature, robot.effort_limit, robot.velocity_limit)

    def start(self, reference: Reference, qpos: np.ndarray, qvel: np.ndarray) -> None:
        """Begin a rollout."""
        self._reference, self._action = reference, np.zeros(JOINTS)

    def target(self, tick: int, qpos: np.ndarray, qvel: np.ndarray) -> np.ndarray:
        """Joint targets of the tick."""
        self._action = self._network(self.observe(tick, qpos, qvel), tick)
        target = np.empty(JOINTS)
        target[self._order] = self._form.default + self._form.scale * self._action
        return target

    def observe(self, tick: int, qpos: np.ndarray, qvel: np.ndarray) -> np.ndarray:
        """The observations of a tick.  # (154,) or (160,)"""
        q, v = self._reference.at(tick)
        wanted, R_wanted = self._place(q)
        own, R_own = self._place(qpos)
        seen = {
            "command": np.concatenate([q[7:][self._order], v[6:][self._order]]),
            "motion_anchor_pos_b": R_own.T @ (wanted - own),
            "motion_anchor_ori_b": (R_own.T @ R_wanted)[:, :2].ravel(),
            "base_lin_vel": base_rotation(qpos).T @ qvel[:3],
            "base_ang_vel": qvel[3:6],
            "joint_pos": qpos[7:][self._order] - self._form.default,
            "joint_vel": qvel[6:][self._order],
            "actions": self._action,
        }
        return np.concatenate([seen[name] for name in self._form.observations])

    def _place(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position  # (3,) and rotation  # (3, 3) of the anchor body."""
        self._data.qpos[:] = q
        mujoco.mj_kinematics(self._robot.model, self._data)
        return self._data.xpos[self._anchor].copy(), self._data.xmat[self._anchor].reshape(3, 3).copy()
