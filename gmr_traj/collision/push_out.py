"""Limb configurations clear of their surroundings and near wanted ones: Levenberg-Marquardt in batches.

For N independent configurations at once (frames times ways out), least squares over the limb's joint angles q:

    sum_e |p_e(q) - p*_e|^2 / position^2 + |q - q*|^2 / angle^2 + sum_pairs min(0, c(q) - margin)^2 / violation^2

with the capsules' end points p_e and the pairs' clearances c: exact, or along one direction per configuration.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gmr_traj.collision.limbs import Limb
from gmr_traj.collision.segments import Array, distance, normal
from gmr_traj.kernels.library import address, arguments, kernels

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

#: Added to distances of spheres [m], so that rounding can lose no pair.
ROUNDING = 1e-9

#: Configurations computed together, which bounds the memory.
BATCH = 2048


class _Arrays(ctypes.Structure):
    """What ``Surroundings`` is in segments.c."""

    _fields_ = (
        *((name, ctypes.c_int64) for name in ("count", "mine", "others", "pairs")),
        *((name, ctypes.c_void_p) for name in ("points", "ends", "pair", "radii", "reach")),
    )


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

    def nearer(self, angles: Array, distance: float) -> np.ndarray:
        """Which pairs come closer than that somewhere while the limb is at the angles  # (N, k).  # (P,)"""
        return np.asarray(self.clearances(self.limb.ends(angles)[0]).min(axis=0) < distance)

    def only(self, pairs: np.ndarray) -> Surroundings:
        """The same with some of the pairs.  # (P,) bool"""
        return replace(self, pairs=self.pairs[pairs], reach=self.reach[pairs])

    def clearances(self, points: Array) -> Array:
        """Exact clearances of all pairs for the limb's end points  # (N, C, 2, 3)  [m].  # (N, P)"""
        mine, other = points[:, self.pairs[:, 0]], self.ends[:, self.pairs[:, 1]]
        gap, _, _ = distance(mine[:, :, 0], mine[:, :, 1], other[:, :, 0], other[:, :, 1])
        return np.asarray(gap - self.reach)

    def depths(self, points: Array) -> Array:
        """Penetration of the deepest pair for the limb's end points [m], 0 where there is none.  # (N,)"""
        out = np.zeros(len(points))
        n, p, gap, _, _ = self._closer(points, 0.0)
        np.maximum.at(out, n, self.reach[p] - gap)
        return out

    def _closer(self, points: Array, margin: float) -> tuple[np.ndarray, np.ndarray, Array, Array, Array]:
        """Configurations and pairs with a clearance below the margin, ascending, and what `distance` says of them."""
        middle, half = _spheres(points)
        others, halves = self._others
        i, j = self.pairs.T
        reach = self.reach + half[i] + halves[j] + max(margin, 0.0) + ROUNDING
        library = kernels()
        if library is not None:
            arrays = [np.ascontiguousarray(a) for a in (points, self.ends, self.pairs, self.reach, reach)]
            sizes = len(points), points.shape[1], self.ends.shape[1], len(self.pairs)
            most = len(points) * len(self.pairs)
            n, p = np.empty((2, most), np.int64)
            gap, s, t = np.empty((3, most))
            given = ctypes.byref(_Arrays(*sizes, *map(address, arrays)))
            found = library.segments_pairs(given, *arguments(margin, n, p, gap, s, t))
            return n[:found], p[:found], gap[:found], s[:found], t[:found]
        apart = np.zeros((len(points), len(i)))
        for axis in range(3):
            apart += (middle[:, i, axis] - others[:, j, axis]) ** 2
        n, p = np.nonzero(apart < reach**2)
        gap, s, t = distance(*self._segments(points, n, p))
        close = gap - self.reach[p] < margin
        return n[close], p[close], gap[close], s[close], t[close]

    @cached_property
    def _others(self) -> tuple[Array, Array]:
        return _spheres(self.ends)

    def _segments(self, points: Array, n: np.ndarray, p: np.ndarray) -> tuple[Array, Array, Array, Array]:
        """End points of the limb's capsule and the other one of some pairs.  # (A, 3) each"""
        mine, other = points[n, self.pairs[p, 0]], self.ends[n, self.pairs[p, 1]]
        return mine[:, 0], mine[:, 1], other[:, 0], other[:, 1]

    def rows(self, points: Array, margin: float) -> tuple[np.ndarray, np.ndarray, Array, Array, Array]:
        """What is closer than the margin.

        Returns:
            configurations, ascending, and pairs: their exact clearances, the normals of these and the share of the
            second end point.  # (A,), (A,), (A,), (A, 3), (A,)
        """
        n, p, gap, s, t = self._closer(points, margin)
        a0, a1, b0, b1 = self._segments(points, n, p)
        apart = a0 + s[:, None] * (a1 - a0) - b0 - t[:, None] * (b1 - b0)
        normals = apart / np.maximum(gap, TOUCHING)[:, None]
        crossing = gap < TOUCHING
        normals[crossing] = normal(a0[crossing], a1[crossing], b0[crossing], b1[crossing])
        return n, p, gap - self.reach[p], normals, s

    def rows_along(
        self, points: Array, margin: float, directions: Array, counting: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, Array, Array, Array]:
        """The same along one direction per configuration, of the pairs that count.  # (N, 3), (N, P)"""
        mine, other = (np.matmul(e.reshape(len(e), -1, 3), directions[:, :, None]) for e in (points, self.ends))
        mine, other = mine.reshape(*points.shape[:2], 2), other.reshape(*self.ends.shape[:2], 2)
        i, j = self.pairs.T
        gap = mine.min(axis=2)[:, i] - other.max(axis=2)[:, j] - self.reach
        n, p = np.nonzero((gap < margin) & counting)
        share = (mine[:, :, 1] < mine[:, :, 0]).astype(float)
        return n, p, gap[n, p], directions[n], share[n, i[p]]


def _spheres(ends: Array) -> tuple[Array, Array]:
    """Middles of segments, and half of what each is long at most.  # (N, C, 2, 3) to (N, C, 3), (C,)"""
    span = ends[:, :, 1] - ends[:, :, 0]
    half = 0.5 * np.sqrt(np.einsum("nci,nci->nc", span, span).max(axis=0, initial=0.0))
    return 0.5 * (ends[:, :, 0] + ends[:, :, 1]), half


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
        out[part] = around.at(who[part]).depths(flat[part])
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

    # Only what is too close.
    n, p, gap, normals, share = (
        around.rows(points, margin) if direction is None else around.rows_along(points, margin, *direction)
    )
    _add_rows(jacobian, (n, around.pairs[p, 0]), gap - margin, normals, share, (value, hessian, gradient))
    return value, hessian, gradient


def _add_rows(
    jacobian: Array,
    at: tuple[np.ndarray, np.ndarray],
    short: Array,
    normals: Array,
    share: Array,
    out: tuple[Array, Array, Array],
) -> None:
    """Add what capsules that are too close contribute to value, Hessian and gradient.

    Args:
        jacobian: of the end points by the joints.  # (N, C, 2, k, 3)
        at: configuration, ascending, and capsule of each row.  # (A,), (A,)
        short: clearance less the margin [m].  # (A,)
        normals: the clearance's direction.  # (A, 3)
        share: of the second end point.  # (A,)
        out: value, Hessian and gradient.  # (N,), (N, k, k), (N, k)
    """
    value, hessian, gradient = out
    size, library = gradient.shape[1], kernels()
    if library is not None:
        given = [np.ascontiguousarray(array) for array in (jacobian, *at, short, normals, share)]
        if library.segments_rows(*arguments(len(short), *jacobian.shape[1:4:2], VIOLATION, *given, *out)):
            return
    ends = jacobian[at]  # (A, 2, k, 3)
    moved = (1.0 - share)[:, None, None] * ends[:, 0] + share[:, None, None] * ends[:, 1]
    row = (
        moved[..., 0] * normals[:, None, 0] + moved[..., 1] * normals[:, None, 1] + moved[..., 2] * normals[:, None, 2]
    )
    row, short = row.T / VIOLATION, short / VIOLATION  # (k, A)

    def summed(rows: Array) -> Array:
        """Of every configuration, one after the other: the order in which the kernels add."""
        return np.asarray(np.bincount(at[0], rows, len(value)), float)

    value += 0.5 * summed(short * short)
    for k in range(size):
        gradient[:, k] += summed(row[k] * short)
        for m in range(k + 1):
            both = summed(row[k] * row[m])
            hessian[:, k, m] += both
            if m < k:
                hessian[:, m, k] += both
