"""Targets for the robot's bodies from the source's: the source's motion, and where the robot is beside it.

A retargeted robot is where the source is plus a misfit: their proportions differ, and inverse kinematics strikes a
compromise.  While it works, the misfit changes slowly; its faults (a joint that jumps to another solution, the
transient of the first frames) are jumps of the misfit.  So the misfit is smoothed and the source is not:

    p*_t = p_t(source) + mean_s(p_s(robot) - p_s(source)),
    R*_t = exp(mean_s(log(R_s(robot) R_s(source)'))) R_t(source)

with the mean over frames s around t, weighted with ``exp(-(t - s)^2 / (2 SPREAD^2))`` and with the trust in frame s.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.motion import RobotMotion
from gmr_traj.quaternions import inverse, product
from gmr_traj.references import BodyTargets
from gmr_traj.robot import Robot

#: Standard deviation of the weights over time [s].
SPREAD = 0.1


def fitted(references: BodyTargets, robot: Robot, motion: RobotMotion, trust: np.ndarray) -> BodyTargets:
    """The source's targets moved and turned to where the robot is beside them.

    Args:
        references: the source's targets; those of bodies that the robot has not are left out.
        robot: the robot.
        motion: the retargeted clip.
        trust: how far each of its frames is to be believed, in (0, 1].  # (T,)
    """
    known = references.of(robot.body_names)
    if not known.names:
        return known
    slots = [robot.body_names.index(name) for name in known.names]
    positions, rotations = placements(robot, motion.qpos)
    at = known.reached(robot.body_names, positions, rotations)
    robots = Rotation.from_matrix(rotations[:, slots].reshape(-1, 3, 3)).as_quat(scalar_first=True).T  # (4, T B)
    source = known.quaternions.reshape(-1, 4).T
    turned = Rotation.from_quat(product(robots, inverse(source)).T, scalar_first=True).as_rotvec()
    spread = SPREAD * motion.fps
    shift = smoothed(at - known.positions, trust, spread)
    turn = smoothed(_continuous(turned.reshape(at.shape)), trust, spread)
    quaternions = product(Rotation.from_rotvec(turn.reshape(-1, 3)).as_quat(scalar_first=True).T, source)
    return replace(known, positions=known.positions + shift, quaternions=quaternions.T.reshape(*at.shape[:2], 4))


def smoothed(values: np.ndarray, weights: np.ndarray, spread: float) -> np.ndarray:
    """Weighted Gaussian mean over the first axis, ``sum_s g w x / sum_s g w``.

    Args:
        values: x.  # (T, ...)
        weights: w, positive.  # (T,)
        spread: standard deviation of g in frames.
    """
    w = weights.reshape(-1, *[1] * (values.ndim - 1))
    options = {"sigma": spread, "axis": 0, "mode": "constant", "truncate": 6.0}
    return np.asarray(gaussian_filter1d(w * values, **options) / gaussian_filter1d(w, **options))


def _continuous(turn: np.ndarray) -> np.ndarray:
    """Rotation vectors as near as possible to the frame before: half a turn has two, of opposite signs.  # (T, B, 3)"""
    out = turn.copy()
    # A turn of a quarter or less after another is nearer than its counterpart of three quarters or more.
    large = np.flatnonzero((np.linalg.norm(out, axis=-1) > 0.5 * np.pi).any(axis=0))
    if not large.size:
        return out
    for t in range(1, len(out)):
        here, before = out[t, large], out[t - 1, large]
        angle = np.linalg.norm(here, axis=-1, keepdims=True)
        other = here * (1 - 2 * np.pi / np.maximum(angle, 1e-9))
        nearer = np.linalg.norm(other - before, axis=-1) < np.linalg.norm(here - before, axis=-1)
        out[t, large[nearer]] = other[nearer]
    return out
