"""Balance from kinematics alone: centre of mass, centre of pressure, zero-moment point."""

from __future__ import annotations

import numpy as np
from scipy.signal import savgol_filter
from scipy.spatial import ConvexHull, QhullError

from gmr_traj.constants import GRAVITY
from gmr_traj.kinematics.mujoco_kinematics import centres_of_mass
from gmr_traj.metrics.observation import Observation

_LEAST_LIFT = 0.3  # of gravity; a robot that presses less than this on the floor has no zero-moment point to speak of


def centre_of_mass(observation: Observation) -> np.ndarray:
    """Centre of mass of the whole robot in every frame [m].  # (T, 3)"""
    return centres_of_mass(observation.robot, observation.motion.qpos)


def centre_of_pressure(observation: Observation, rate: float) -> np.ndarray:
    """Where the floor presses, from how low the sole points p_k are [m].  # (T, 2)

    CoP = sum_k w_k p_xy,k / sum_k w_k,    w_k = exp(-rate z_k) for z_k >= 0, 1 - rate z_k below the floor
    """
    points = np.concatenate(observation.soles, axis=1)  # (T, K, 3)
    # Relative to the lowest point where even that is above the floor, or all weights of a clip that floats underflow.
    height = points[..., 2] - np.maximum(0.0, points[..., 2].min(axis=1, keepdims=True))
    weight = np.where(height >= 0.0, np.exp(-rate * np.maximum(height, 0.0)), 1.0 - rate * height)  # (T, K)
    return np.einsum("tk,tki->ti", weight, points[..., :2]) / weight.sum(axis=1, keepdims=True)


def zero_moment_point(centre: np.ndarray, fps: float, window: float) -> np.ndarray:
    """Zero-moment point on the floor of a mass at the centre of mass c [m].  # (T, 2)

        ZMP = c_xy - c_z c_xy'' / (c_z'' + g)

    The rate of the angular momentum about c is left out.  c'' is the second derivative of a cubic fitted to each
    ``window`` (Savitzky-Golay), so that noise from frame to frame does not count as acceleration.  Not a number where
    the robot presses on the floor with less than 0.3 of its weight, and throughout a clip shorter than the window.

    Args:
        centre: c.  # (T, 3)
        fps: frames per second.
        window: [s].
    """
    width = max(5, 2 * round(0.5 * window * fps) + 1)
    if len(centre) < width:
        return np.full((len(centre), 2), np.nan)
    smooth = savgol_filter(centre, width, 3, axis=0)
    acceleration = savgol_filter(centre, width, 3, deriv=2, delta=1.0 / fps, axis=0)
    lift = acceleration[:, 2] + GRAVITY
    pressed = lift > _LEAST_LIFT * GRAVITY
    ratio = np.where(pressed, smooth[:, 2] / np.where(pressed, lift, 1.0), np.nan)
    return smooth[:, :2] - ratio[:, None] * acceleration[:, :2]


def zmp_margins(observation: Observation, zmp: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Signed distance of the zero-moment point to the border of the support, positive inside [m].

    The support is the convex hull of all sole points of the feet in stance, where they are in this clip.

    Args:
        observation: the clip.
        zmp: its zero-moment point.  # (T, 2)
        mask: whether each foot is in stance.  # (T, S)

    Returns:
        One margin for each frame with a stance and a zero-moment point.  # (N,)
    """
    frames = np.flatnonzero(mask.any(axis=1) & np.isfinite(zmp).all(axis=1))
    margins = np.empty(len(frames))
    for i, t in enumerate(frames):
        support = np.concatenate([observation.soles[s][t, :, :2] for s in np.flatnonzero(mask[t])])
        margins[i] = hull_margin(support, zmp[t])
    return margins


def hull_margin(points: np.ndarray, p: np.ndarray) -> float:
    """Signed distance of p to the border of the convex hull of points in the plane, positive inside.

    Args:
        points: at least three that are not in one line.  # (K, 2)
        p: (2,).

    Returns:
        The distance; not a number where the points are in one line.
    """
    try:
        hull = ConvexHull(points)
    except QhullError:
        return float("nan")
    inside = float(-(hull.equations[:, :2] @ p + hull.equations[:, 2]).max())
    if inside >= 0.0:
        return inside
    a = points[hull.vertices]
    along = np.roll(a, -1, axis=0) - a
    s = np.clip(np.einsum("ki,ki->k", p - a, along) / np.einsum("ki,ki->k", along, along), 0.0, 1.0)
    return -float(np.linalg.norm(p - a - s[:, None] * along, axis=1).min())
