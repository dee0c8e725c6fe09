"""Which way feet point."""

from __future__ import annotations

import numpy as np

from gmr_traj.robot import Robot


def headings(points: np.ndarray, robot: Robot) -> np.ndarray:
    """Directions of the feet about the vertical, each up to a constant, without jumps [rad].

    Args:
        points: the sole points in the world, one sole after the other [m].  # (T, K, 3)
        robot: whose soles they are.

    Returns:
        of every sole.  # (T, S)
    """
    out, last = np.zeros((len(points), len(robot.soles))), 0
    for s, sole in enumerate(robot.soles):
        first, last = last, last + len(sole.points)
        far = first + int(np.linalg.norm(sole.points - sole.points[0], axis=1).argmax())
        along = points[:, far] - points[:, first]
        out[:, s] = np.unwrap(np.arctan2(along[:, 1], along[:, 0]))
    return out
