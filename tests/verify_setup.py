"""Clips whose dynamics are known, and faults to put into clips."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot


def standing(robot: Robot, frames: int = 30, fps: float = 50.0) -> RobotMotion:
    """The nominal configuration, held."""
    return RobotMotion(np.tile(robot.nominal, (frames, 1)), fps, robot.joint_names, robot.name)


def squatting(robot: Robot, seconds: float = 2.0, fps: float = 50.0, depth: float = 0.2) -> RobotMotion:
    """A slow squat over flat feet that stay where they are."""
    frames = round(seconds * fps) + 1
    bend = depth * 0.5 * (1.0 - np.cos(2.0 * np.pi * np.arange(frames) / (fps * seconds)))
    qpos = np.tile(robot.nominal, (frames, 1))
    for k, name in enumerate(robot.joint_names):
        if name.endswith(("hip_pitch_joint", "ankle_pitch_joint")):
            qpos[:, 7 + k] -= bend
        elif name.endswith("knee_joint"):
            qpos[:, 7 + k] += 2.0 * bend
    motion = RobotMotion(qpos, fps, robot.joint_names, robot.name)
    return on_feet(motion, robot)


def on_feet(motion: RobotMotion, robot: Robot) -> RobotMotion:
    """Move the base so that the first sole stays where it is in the nominal configuration."""
    from gmr_traj.metrics.observation import observe

    qpos = motion.qpos.copy()
    heel = observe(motion, robot).soles[0].mean(axis=1)
    still = observe(motion.with_qpos(robot.nominal[None]), robot).soles[0].mean(axis=1)
    qpos[:, :3] += still - heel
    return motion.with_qpos(qpos)


FAULTS = ("spike", "float", "sunk", "skating", "lean", "noise")


def with_fault(motion: RobotMotion, fault: str, seed: int = 0) -> RobotMotion:
    """A clip with a fault put in on purpose."""
    qpos, n = motion.qpos.copy(), motion.frames
    if fault == "spike":
        qpos[n // 2 : n // 2 + 5, 7 + motion.joint_names.index("waist_roll_joint")] += 0.4
    elif fault in ("float", "sunk"):
        qpos[:, 2] += 0.05 if fault == "float" else -0.05
    elif fault == "skating":  # everything drifts sideways
        qpos[:, 1] += 0.4 * np.arange(n) / motion.fps
    elif fault == "lean":
        lean = Rotation.from_quat(qpos[:, 3:7], scalar_first=True) * Rotation.from_euler("y", 0.25)
        qpos[:, 3:7] = lean.as_quat(scalar_first=True)
    elif fault == "noise":
        qpos[:, 7:] += np.random.default_rng(seed).normal(scale=0.02, size=(n, qpos.shape[1] - 7))
    else:
        raise ValueError(fault)
    return motion.with_qpos(qpos)
