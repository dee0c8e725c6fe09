"""Policies of BeyondMimic's form: one network for one motion, with all it needs to know in its metadata.

Observations (160, or 154 without state estimation, which lacks the two marked +), every vector in the robot's own axes:

    command          reference's joint positions and velocities                      58
    anchor position  of the reference's anchor body in the robot's anchor frame +     3
    anchor axes      the first two columns of its rotation there, row by row          6
    base velocity    linear +, angular                                              3, 3
    joints           q - q_default, q', last action                         29, 29, 29

The target is ``q_default + action_scale action``; joints have the order of the metadata's ``joint_names``.
"""

from __future__ import annotations

import mujoco
import numpy as np

from gmr_traj.exceptions import PolicyError
from gmr_traj.kinematics.mujoco_kinematics import base_rotation, body_id
from gmr_traj.robot import Robot
from gmr_traj.verify.controller import Controller
from gmr_traj.verify.policy import Network
from gmr_traj.verify.reference import Reference
from gmr_traj.verify.simulated_robot import Motors

WIDTHS = (154, 160)
_JOINTS = 29


class BeyondMimicPolicy(Controller):
    """The controller.

    Args:
        network: the network.
        robot: the robot, which must have the joints that the metadata names.

    Raises:
        PolicyError: the metadata is missing or incomplete, or names joints or a body that the robot has not.
    """

    def __init__(self, network: Network, robot: Robot) -> None:
        self.name = "policy beyondmimic"
        self._network, self._robot = network, robot
        names = self._texts("joint_names")
        if sorted(names) != sorted(robot.joint_names) or len(names) != _JOINTS:
            strange = next((name for name in names if name not in robot.joint_names), "another number of joints")
            raise PolicyError(f"{network.path}: is for another robot than {robot.name}: it has {strange}")
        if network.outputs != _JOINTS:
            raise PolicyError(f"{network.path}: makes {network.outputs} actions; expected {_JOINTS}")
        # For each joint of the policy its index in the robot.
        self._order = np.array([robot.joint_names.index(name) for name in names])
        self._default = self._numbers("default_joint_pos")
        self._scale = self._numbers("action_scale")
        self._stiffness, self._damping = self._numbers("joint_stiffness"), self._numbers("joint_damping")
        for name, values in (("joint_stiffness", self._stiffness), ("joint_damping", self._damping)):
            if (values <= 0.0).any():
                raise PolicyError(f"{network.path}: {name} has {values.min():g}; gains must be above zero")
        anchor = network.metadata.get("anchor_body_name", robot.anchor_body)
        if anchor not in robot.body_names:
            raise PolicyError(f"{network.path}: anchor_body_name is {anchor!r}, which is no body of {robot.name}")
        self._anchor = body_id(robot, anchor)
        self._data = mujoco.MjData(robot.model)

    def motors(self, robot: Robot) -> Motors:
        """The gains of its metadata; armature and limits of the robot."""
        kp, kd = np.empty(_JOINTS), np.empty(_JOINTS)
        kp[self._order], kd[self._order] = self._stiffness, self._damping
        armature = np.array(robot.model.dof_armature[6:])
        return Motors(kp, kd, armature, robot.effort_limit, robot.velocity_limit)

    def start(self, reference: Reference, qpos: np.ndarray, qvel: np.ndarray) -> None:
        """Begin a rollout."""
        self._reference, self._action = reference, np.zeros(_JOINTS)

    def target(self, tick: int, qpos: np.ndarray, qvel: np.ndarray) -> np.ndarray:
        """Joint targets of the tick."""
        self._action = self._network(self.observe(tick, qpos, qvel), tick)
        target = np.empty(_JOINTS)
        target[self._order] = self._default + self._scale * self._action
        return target

    def observe(self, tick: int, qpos: np.ndarray, qvel: np.ndarray) -> np.ndarray:
        """The observations of a tick.  # (154,) or (160,)"""
        q, v = self._reference.at(tick)
        wanted, R_wanted = self._place(q)
        own, R_own = self._place(qpos)
        estimated = self._network.inputs == max(WIDTHS)
        joints, speeds = qpos[7:][self._order], qvel[6:][self._order]
        return np.concatenate(
            [
                q[7:][self._order],
                v[6:][self._order],
                *([R_own.T @ (wanted - own)] if estimated else []),
                (R_own.T @ R_wanted)[:, :2].ravel(),
                *([base_rotation(qpos).T @ qvel[:3]] if estimated else []),
                qvel[3:6],
                joints - self._default,
                speeds,
                self._action,
            ]
        )

    def _place(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position  # (3,) and rotation  # (3, 3) of the anchor body."""
        self._data.qpos[:] = q
        mujoco.mj_kinematics(self._robot.model, self._data)
        return self._data.xpos[self._anchor].copy(), self._data.xmat[self._anchor].reshape(3, 3).copy()

    def _texts(self, key: str) -> list[str]:
        if key not in self._network.metadata:
            raise PolicyError(f"{self._network.path}: its metadata has no {key!r}; export it with its metadata")
        return [part.strip() for part in self._network.metadata[key].split(",")]

    def _numbers(self, key: str) -> np.ndarray:
        """One number a joint; a single one stands for all."""
        parts = self._texts(key)
        try:
            values = np.array([float(part) for part in parts])
        except ValueError:
            raise PolicyError(
                f"{self._network.path}: {key} in its metadata is {','.join(parts)!r}, not numbers"
            ) from None
        if len(values) not in (1, _JOINTS) or not np.isfinite(values).all():
            raise PolicyError(
                f"{self._network.path}: {key} in its metadata has {len(values)} numbers; expected {_JOINTS}"
            )
        return np.broadcast_to(values, (_JOINTS,)).copy()
