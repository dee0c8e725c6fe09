"""Configurations of a limb that are clear of its surroundings: several for every frame, on different sides.

The limb is pushed out of what it is in along each of 26 directions in the frame of its root, as a whole; from there
it comes as near to the wanted configuration as it can without going through anything.  Both are ways out: the near
ones are where a limb would stay, the far ones what it passes through from one side to another.
"""

from __future__ import annotations

import numpy as np

from gmr_traj.collision.push_out import Surroundings, deepest, push_out
from gmr_traj.collision.segments import Array

#: Clearance on the way out, and after coming back [m].
WIDE, MARGIN = 0.03, 0.006

#: Iterations out and back.
OUT, BACK = 8, 8

#: Pairs further apart than this do not count on the way out [m].
NEAR = 0.3

#: Configurations a frame that are kept, and how far apart they must be [m].
KEPT, DISTINCT = 12, 0.03

#: Weight of squared penetration against squared distance.
DEPTH = 1000.0


def ways_out(around: Surroundings, wanted: Array) -> tuple[Array, np.ndarray]:
    """Clear configurations for every frame, the best first.

    Args:
        around: the surroundings in T frames.
        wanted: angles to stay near [rad].  # (T, k)

    Returns:
        angles [rad], and which of them there are.  # (T, KEPT, k), (T, KEPT)
    """
    frames, size = wanted.shape
    ways = directions()
    near = around.clearances(around.limb.ends(wanted)[0]) < NEAR
    who = np.repeat(np.arange(frames), len(ways))
    pushed = push_out(
        around.at(who), wanted[who], wanted[who], WIDE, OUT, directions=np.tile(ways, (frames, 1)), along=near[who]
    ).reshape(frames, len(ways), size)
    pushed, there = _best(around, wanted, pushed, np.ones(pushed.shape[:2], dtype=bool))
    start = np.concatenate([wanted[:, None], pushed], axis=1)
    used = np.concatenate([np.ones((frames, 1), dtype=bool), there], axis=1)
    who = np.nonzero(used)[0]
    back = np.zeros_like(start)
    back[used] = push_out(around.at(who), wanted[who], start[used], MARGIN, BACK)
    return _best(around, wanted, np.concatenate([back, pushed], axis=1), np.concatenate([used, there], axis=1))


def directions() -> Array:
    """Unit vectors to the faces, edges and corners of a cube, shape (26, 3)."""
    grid = np.stack(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    grid = grid[np.abs(grid).sum(axis=1) > 0]
    return np.asarray(grid / np.linalg.norm(grid, axis=1, keepdims=True))


def cost(around: Surroundings, points: Array, wanted: Array) -> Array:
    """Mean square distance of the end points from where they are wanted, and the penetration left [m^2].

    Args:
        around: the surroundings in T frames.
        points: end points of M configurations in each frame [m].  # (T, M, C, 2, 3)
        wanted: angles to stay near [rad].  # (T, k)

    Returns:
        costs.  # (T, M)
    """
    target, _, _ = around.limb.ends(wanted)
    return mean_square(points - target[:, None]) + DEPTH * deepest(around, points) ** 2


def mean_square(difference: Array) -> Array:
    """Mean over the end points of squared lengths.  # (..., C, 2, 3) to (...)"""
    return np.asarray((difference**2).sum(axis=-1).mean(axis=(-2, -1)))


def end_points(around: Surroundings, angles: Array) -> Array:
    """End points of M configurations in each frame [m].  # (T, M, k) to (T, M, C, 2, 3)"""
    points, _, _ = around.limb.ends(angles.reshape(-1, angles.shape[-1]))
    return points.reshape(*angles.shape[:2], *points.shape[1:])


def _best(around: Surroundings, wanted: Array, angles: Array, used: np.ndarray) -> tuple[Array, np.ndarray]:
    """The best of the used configurations of every frame that are apart from one another; the rest is unused."""
    frames, _, size = angles.shape
    points = end_points(around, angles)
    left = np.where(used, cost(around, points, wanted), np.inf)
    out, there = np.zeros((frames, KEPT, size)), np.zeros((frames, KEPT), dtype=bool)
    for k in range(KEPT):
        best = left.argmin(axis=1)
        rows = np.flatnonzero(np.isfinite(left[np.arange(frames), best]))
        out[rows, k], there[rows, k] = angles[rows, best[rows]], True
        apart = mean_square(points[rows] - points[rows, best[rows]][:, None])
        left[rows] = np.where(apart > DISTINCT**2, left[rows], np.inf)
    return out, there
