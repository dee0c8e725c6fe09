"""Limb configurations clear of their surroundings and near wanted ones: Levenberg-Marquardt in batches.

For N independent configurations at once (frames times ways out), least squares over the limb's joint angles q:

    sum_e |p_e(q) - p*_e|^2 / position^2 + |q - q*|^2 / angle^2 + sum_pairs min(0, c(q) - margin)^2 / violation^2

with the capsules' end points p_e and the pairs' clearances c: exact, or along one direction per configuration.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gmr_traj.collision.limbs import Limb
from gmr_traj.collision.segments import Array, distance, normal

#: Scales of the three terms above: [m], [rad], [m].
POSITION, ANGLE, VIOLATION = 0.05, 0.2, 0.002

#: Longest step of one iteration [rad].
STEP = 0.3

#: Levenberg-Marquardt damping at first [1/rad^2], and its change after a good and a bad step.
FIRST_DAMPING, EASE, STIFFEN = 10.0, 0.3, 10.0

#: Steps shorter than this are none [rad].
SMALLEST = 1e-12

#: Axes closer than this cross [m].
TOUCHING = 1e-9

#: Configurations computed together, which bounds the memory.
BATCH = 2048


@dataclass(frozen=True)
class Surroundings:
    """What a limb must keep clear of in N frames, in the frame of its root.

    Attributes:
        limb: the limb.
        pairs: row of ``limb.capsules`` and index of the other capsule among ``ends``.  # (P, 2)
        reach: sum of the two radii of every pair [m].  # (P,)
        ends: end points of the other capsules [m].  # (N, O, 2, 3)
    """

    limb: Limb
    pairs: np.ndarray
    reach: Array
    ends: Array

    def at(self, frames: np.ndarray) -> Surroundings:
        """The same in some of the frames, which may repeat."""
        return replace(self, ends=self.ends[frames])

    def within(self, angles: Array, distance: float) -> Surroundings:
        """The same without the pairs that stay further apart while the limb is at the angles  # (N, k)."""
        close = self.clearances(self.limb.ends(angles)[0]).min(axis=0) < distance
        return replace(self, pairs=self.pairs[close], reach=self.reach[close])

    def clearances(self, points: Array) -> Array:
        """Exact clearances of all pairs for the limb's end points  # (N, C, 2, 3)  [m].  # (N, P)"""
        gap, _, _ = distance(*self._segments(points))
        return np.asarray(gap - self.reach)

    def _segments(self, points: Array) -> tuple[Array, Array, Array, Array]:
        mine, other = points[:, self.pairs[:, 0]], self.ends[:, self.pairs[:, 1]]
        return mine[:, :, 0], mine[:, :, 1], other[:, :, 0], other[:, :, 1]

    def rows(self, points: Array) -> tuple[Array, Array, Array]:
        """Exact clearances, their normals and the share of the second end point.  # (N, P), (N, P, 3), (N, P)"""
        a0, a1, b0, b1 = self._segments(points)
        gap, s, t = distance(a0, a1, b0, b1)
        apart = a0 + s[..., None] * (a1 - a0) - b0 - t[..., None] * (b1 - b0)
        normals = apart / np.maximum(gap, TOUCHING)[..., None]
        crossing = gap < TOUCHING
        normals[crossing] = normal(a0[crossing], a1[crossing], b0[crossing], b1[crossing])
        return gap - self.reach, normals, s

    def rows_along(self, points: Array, directions: Array) -> tuple[Array, Array, Array]:
        """The same along one direction per configuration.  # directions: (N, 3)"""
        a0, a1, b0, b1 = (np.einsum("npi,ni->np", end, directions) for end in self._segments(points))
        normals = np.broadcast_to(directions[:, None], (*a0.shape, 3))
        return np.minimum(a0, a1) - np.maximum(b0, b1) - self.reach, normals, (a1 < a0).astype(float)


def deepest(around: Surroundings, points: Array) -> Array:
    """Deepest penetration [m] of M configurations in each of T frames, 0 where there is none.

    Args:
        around: the surroundings in T frames.
        points: the limb's end points [m].  # (T, M, C, 2, 3)

    Returns:
        depths.  # (T, M)
    """
    frames, count = points.shape[:2]
    flat = points.reshape(frames * count, *points.shape[2:])
    who = np.repeat(np.arange(frames), count)
    out = np.empty(frames * count)
    for first in range(0, len(out), BATCH):
        part = slice(first, first + BATCH)
        gap = around.at(who[part]).clearances(flat[part])
        out[part] = np.maximum(0.0, -gap.min(axis=1, initial=0.0))
    return out.reshape(frames, count)


def push_out(
    around: Surroundings,
    wanted: Array,
    start: Array,
    margin: float,
    iterations: int,
    *,
    directions: Array | None = None,
    along: np.ndarray | None = None,
) -> Array:
    """Joint angles after some iterations.

    Args:
        around: the surroundings in N frames.
        wanted: angles to stay near [rad].  # (N, k)
        start: angles to start from [rad].  # (N, k)
        margin: clearance to keep [m].
        iterations: how many.
        directions: unit vectors, for clearances along them.  # (N, 3)
        along: which pairs count then.  # (N, P)
    """
    out = np.empty_like(start)
    for first in range(0, len(start), BATCH):
        part = slice(first, first + BATCH)
        here = replace(around, ends=around.ends[part])
        target, _, _ = around.limb.ends(wanted[part])
        direction = None if directions is None or along is None else (directions[part], along[part])
        angles = start[part]
        value, hessian, gradient = normal_equations(here, wanted[part], target, angles, margin, direction)
        damping = np.full(len(angles), FIRST_DAMPING)
        for _ in range(iterations):
            damped = hessian + damping[:, None, None] * np.eye(angles.shape[1])
            step = -np.linalg.solve(damped, gradient[..., None])[..., 0]
            step *= np.minimum(1.0, STEP / np.maximum(np.abs(step).max(axis=1), SMALLEST))[:, None]
            tried = within_range(around.limb, angles + step)
            new = normal_equations(here, wanted[part], target, tried, margin, direction)
            better = new[0] < value
            angles = np.where(better[:, None], tried, angles)
            value = np.where(better, new[0], value)
            hessian = np.where(better[:, None, None], new[1], hessian)
            gradient = np.where(better[:, None], new[2], gradient)
            damping *= np.where(better, EASE, STIFFEN)
        out[part] = angles
    return out


def within_range(limb: Limb, angles: Array) -> Array:
    """Joint angles clipped to their ranges."""
    robot = limb.robot
    return np.clip(angles, robot.position_lower[limb.joints], robot.position_upper[limb.joints])


def normal_equations(
    around: Surroundings,
    wanted: Array,
    target: Array,
    angles: Array,
    margin: float,
    direction: tuple[Array, np.ndarray] | None = None,
) -> tuple[Array, Array, Array]:
    """Half of every configuration's cost, its gradient and Gauss-Newton Hessian.

    Args:
        around: the surroundings in N frames.
        wanted: angles to stay near [rad].  # (N, k)
        target: the end points there [m].  # (N, C, 2, 3)
        angles: where to take the derivatives [rad].  # (N, k)
        margin: clearance to keep [m].
        direction: unit vectors to measure clearances along, and which pairs count then.  # (N, 3), (N, P)

    Returns:
        value, Hessian and gradient.  # (N,), (N, k, k), (N, k)
    """
    limb = around.limb
    count, size = angles.shape
    points, anchors, axes = limb.ends(angles)
    jacobian = limb.jacobian(points, anchors, axes)  # (N, C, 2, k, 3)
    flat = jacobian.transpose(0, 3, 1, 2, 4).reshape(count, size, -1)  # (N, k, 6C)
    hessian = flat @ flat.transpose(0, 2, 1) / POSITION**2 + np.eye(size) / ANGLE**2
    off, turn = (points - target).reshape(count, -1), angles - wanted
    gradient = (flat @ off[..., None])[..., 0] / POSITION**2 + turn / ANGLE**2
    value = 0.5 * ((off**2).sum(axis=1) / POSITION**2 + (turn**2).sum(axis=1) / ANGLE**2)

    if direction is None:
        gap, normals, share = around.rows(points)
    else:
        gap, normals, share = around.rows_along(points, direction[0])
        gap = np.where(direction[1], gap, np.inf)
    n, p = np.nonzero(gap < margin)  # only what is too close
    mine = around.pairs[p, 0]
    ends = jacobian[n, mine]  # (A, 2, k, 3)
    moved = (1.0 - share[n, p])[:, None, None] * ends[:, 0] + share[n, p][:, None, None] * ends[:, 1]
    row = np.einsum("aki,ai->ak", moved, normals[n, p]) / VIOLATION  # (A, k)
    short = (gap[n, p] - margin) / VIOLATION
    if n.size:
        first = np.flatnonzero(np.diff(n, prepend=-1))  # n ascends
        hessian[n[first]] += np.add.reduceat(row[:, :, None] * row[:, None, :], first)
        gradient[n[first]] += np.add.reduceat(row * short[:, None], first)
        value[n[first]] += 0.5 * np.add.reduceat(short**2, first)
    return value, hessian, gradient
