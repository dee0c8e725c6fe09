"""What the tests of retargeting share: motions whose answer is known, and mink's shortcut in its derivatives."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.human_motion import HumanMotion
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.retarget.body_map import BodyMap
from gmr_traj.retarget.frame_error import Twist, coupling
from gmr_traj.robot import Robot


def dance(robot: Robot, frames: int = 30, fps: float = 30.0) -> np.ndarray:
    """The robot swaying about its nominal posture while it walks along an arc.  # (T, 7 + n)"""
    time = np.arange(frames)[:, None] / fps
    rng = np.random.default_rng(5)
    rate, phase = rng.uniform(2.0, 6.0, robot.dof), rng.uniform(0.0, 2 * np.pi, robot.dof)
    qpos = np.tile(robot.nominal, (frames, 1))
    reach = 0.3 * np.minimum(robot.position_upper - robot.nominal[7:], robot.nominal[7:] - robot.position_lower)
    qpos[:, 7:] += np.minimum(reach, 0.35) * np.sin(rate * time + phase)
    qpos[:, :2] = np.hstack([np.sin(time), 1.0 - np.cos(time)]) + [0.7, -0.4]
    turned = Rotation.from_euler("zx", np.hstack([0.6 + time, 0.1 * np.sin(3 * time)]))
    qpos[:, 3:7] = turned.as_quat(scalar_first=True)
    return qpos


def human_of(robot: Robot, body_map: BodyMap, qpos: np.ndarray, height: float, fps: float = 30.0) -> HumanMotion:
    """The person whose scaled targets are exactly where the robot's bodies are.

    The map's formula the other way round; joints that are only there for their orientation sit on the others.
    """
    all_positions, all_rotations = placements(robot, qpos)
    ratio = height / body_map.human_height
    position, rotation = {}, {}
    for target in (body_map.root_target, *body_map.targets):
        b = robot.body_names.index(target.body)
        R = Rotation.from_matrix(all_rotations[:, b])
        at = all_positions[:, b] + R.apply(target.point - target.position_offset)
        root = position.get(body_map.root, at / (ratio * target.scale))
        position[target.joint] = root + (at / ratio - body_map.root_target.scale * root) / target.scale
        position.setdefault(target.orientation_joint, position[target.joint])
        rotation[target.orientation_joint] = R * Rotation.from_quat(target.rotation_offset, scalar_first=True).inv()
        rotation.setdefault(target.joint, rotation[target.orientation_joint])
    names = tuple(position)
    return HumanMotion(
        rig=body_map.rigs[0],
        names=names,
        parents=(-1, *[0] * (len(names) - 1)),
        positions=np.stack([position[name] for name in names], axis=1),
        quaternions=np.stack([rotation[name].as_quat(scalar_first=True) for name in names], axis=1),
        fps=fps,
        height=height,
    )


def cut(human: HumanMotion, first: int, frames: int, turn: float = 0.0, noise: float = 0.0) -> HumanMotion:
    """Some frames, turned about the vertical [rad]; with ``noise`` [m, rad] no robot can meet the targets."""
    positions = np.array(human.positions[first : first + frames])
    rng = np.random.default_rng(first)
    positions += noise * rng.normal(size=positions.shape)
    quaternions = np.array(human.quaternions[first : first + frames])
    R = Rotation.from_euler("z", turn)
    wrong = Rotation.from_rotvec(noise * rng.normal(size=(positions[..., 0].size, 3)))
    turned = R * Rotation.from_quat(quaternions.reshape(-1, 4), scalar_first=True) * wrong
    return replace(
        human,
        positions=R.apply(positions.reshape(-1, 3)).reshape(positions.shape),
        quaternions=turned.as_quat(scalar_first=True).reshape(quaternions.shape),
        contacts={},
    )


def largest_difference(robot: Robot, a: np.ndarray, b: np.ndarray, turn: float = 0.0) -> float:
    """Largest difference of two clips [m], [rad], the second turned about the vertical against the first."""
    R = Rotation.from_euler("z", turn)
    root = np.abs(R.apply(np.array(a[:, :3])) - b[:, :3]).max()
    mine = R * Rotation.from_quat(np.array(a[:, 3:7]), scalar_first=True)
    angle = (mine * Rotation.from_quat(np.array(b[:, 3:7]), scalar_first=True).inv()).magnitude().max()
    return float(max(root, angle, np.abs(a[:, 7:] - b[:, 7:]).max()))


def minks_coupling(twist: Twist) -> Any:
    """C of ``frame_error`` with mink's shortcut: zero where the rotation is below 1e-5 rad, and not ``[d] / 2``.

    As for a wrist that has reached its orientation.
    """
    return ca.if_else(ca.sumsqr(twist.w) < 1e-10, 0.0, coupling(twist))
