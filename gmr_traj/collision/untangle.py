"""A limb that went through the body is taken around it: a start for the problem in which nothing is deep inside.

Where a limb is deep in the trunk, the normals of its many pairs of capsules contradict one another, and no choice of
signs makes them agree.  So the way out is chosen for the limb as a whole.  For every frame of such a tangle, candidate
configurations are found by pushing the limb out in each of a set of directions and then letting it come as near to the
clip as it can (``push_out``); the path over time through the candidates is the one that minimises

    sum_t dt [ |d_t|^2 + TIME^2 |v_t|^2 + DEPTH (depth_t^2 + depth_{t+1/2}^2) ]

with the mean square distance d_t of the limb's end points from the clip, their speed v_t, and the penetration left,
in the frames and half-way between them (dynamic programming, exact over the candidates).  The path begins and ends at
the clip's own configurations around the tangle.  About such a motion exact clearances have consistent normals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gmr_traj.collision.capsules import radii, world_segments
from gmr_traj.collision.elastic_band import relax
from gmr_traj.collision.limbs import Limb, limbs
from gmr_traj.collision.push_out import Surroundings, push_out
from gmr_traj.collision.segments import Array, normal
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot

#: Axes closer than this share of the sum of the radii leave it open on which side the limb is.
TRUST = 0.3

#: A pair deeper than this takes part in a tangle [m]; shallower overlaps are left to the problem.
DEEP = 0.015

#: Tangles closer together than this are one [s], and each is widened by this on both sides [s].
BRIDGE, WIDEN = 0.35, 0.1

#: Clearance of the candidates [m].
MARGIN = 0.006

#: Clearance on the way out [m].
WIDE = 0.03

#: Distance of one metre for one second costs as much as a speed of one metre in this time for one second [s].
TIME = 0.1

#: Time between the candidates [s]; the path is straight in between.
KNOT = 0.1

#: Where between two candidates the way from one to the other is looked at.
BETWEEN = (0.25, 0.5, 0.75)

#: A joint's turn by one radian counts as this way, so that a path does not jump between postures [m/rad].
ARM = 0.1

#: Weight of squared penetration against squared distance.
DEPTH = 1000.0

#: Candidates a frame that are carried on, and how far apart they must be [m].
KEPT, DISTINCT = 12, 0.03

#: Gauss-Newton iterations out and back.
OUT, BACK = 8, 8

#: Pairs nearer than this are measured along the direction on the way out [m].
NEAR = 0.3


DEBUG=0
@dataclass(frozen=True)
class Tangle:
    """A limb and the frames in which it is deep in something, ``first`` to ``last``."""

    limb: Limb
    first: int
    last: int


def untangle(robot: Robot, motion: RobotMotion) -> tuple[RobotMotion, list[Tangle]]:
    """The motion with its tangled limbs taken around the body, and where that was; itself where there is none.

    Only limbs without a sole are moved: a foot's place is for the contacts to say.

    Args:
        robot: the robot.
        motion: the clip.
    """
    qpos = motion.qpos.copy()
    found = []
    for limb in limbs(robot):
        if limb.feet or not limb.capsules:
            continue
        positions, rotations = placements(robot, qpos)
        around = _surroundings(robot, limb, positions, rotations)
        for first, last in _tangles(around, qpos[:, 7 + limb.joints], motion.fps):
            span = slice(max(0, first - 2), min(len(qpos), last + 3))
            pinned = (first > 1, last + 2 < len(qpos))
            angles = qpos[span, 7 + limb.joints]
            here = around.at(np.arange(span.start, span.stop))
            path = _path(here, angles, motion.fps, pinned)
            if DEBUG: print('path',np.round(1e3*_depths(here,path[:,None])[:,0]))
            qpos[span, 7 + limb.joints] = relax(here, angles, path, MARGIN, 1.0 / motion.fps, pinned)
            found.append(Tangle(limb, first, last))
    return (motion.with_qpos(qpos) if found else motion), found


def _surroundings(robot: Robot, limb: Limb, positions: Array, rotations: Array) -> Surroundings:
    """All capsules that a limb must keep clear of, seen from its root."""
    starts, ends = world_segments(robot, positions, rotations)
    rotation, origin = rotations[:, limb.root], positions[:, limb.root]
    seen = np.einsum("tji,tcej->tcei", rotation, np.stack([starts, ends], axis=2) - origin[:, None, None])
    mine = {c: row for row, c in enumerate(limb.capsules)}
    pairs = [(i, j) if i in mine else (j, i) for i, j in robot.collision_pairs if (i in mine) != (j in mine)]
    radius = radii(robot)
    return Surroundings(
        limb=limb,
        pairs=np.array([(mine[i], j) for i, j in pairs], dtype=np.intp).reshape(-1, 2),
        reach=np.array([radius[i] + radius[j] for i, j in pairs]),
        ends=seen,
    )


def _tangles(around: Surroundings, angles: Array, fps: float) -> list[tuple[int, int]]:
    """First and last frames in which a limb is so deep that its own normals do not say which way is out."""
    points, _, _ = around.limb.ends(angles)
    gap, normals, _ = around.rows(points)
    deep = gap < -DEEP
    doubtful = ((gap + around.reach) < TRUST * around.reach).any(axis=1)
    for row in range(len(around.limb.capsules)):
        # Two shapes that one capsule is deep in, and that push it opposite ways.
        of_row = np.flatnonzero(around.pairs[:, 0] == row)
        n, d = normals[:, of_row], deep[:, of_row]
        against = np.einsum("tpi,tqi->tpq", n, n) < -0.5
        doubtful |= (against & d[:, :, None] & d[:, None, :]).any(axis=(1, 2))
    turned = np.einsum("tpi,tpi->tp", normals[1:], normals[:-1]) < 0.0
    flipped = (turned & deep[1:] & deep[:-1]).any(axis=1)
    doubtful[1:] |= flipped
    doubtful[:-1] |= flipped
    inside = deep.any(axis=1) | doubtful
    edges = np.flatnonzero(np.diff(inside, prepend=False, append=False)).reshape(-1, 2)
    spans: list[list[int]] = []
    for start, stop in edges:
        if not doubtful[start:stop].any():
            continue
        if spans and start - spans[-1][1] - 1 <= BRIDGE * fps:
            spans[-1][1] = stop - 1
        else:
            spans.append([start, stop - 1])
    wide = round(WIDEN * fps)
    out: list[tuple[int, int]] = []
    for first, last in spans:
        first, last = max(0, first - wide), min(len(angles) - 1, last + wide)
        if out and first <= out[-1][1] + 1:
            out[-1] = (out[-1][0], last)
        else:
            out.append((first, last))
    return out


def _path(around: Surroundings, wanted: Array, fps: float, pinned: tuple[bool, bool]) -> Array:
    """Joint angles of the limb over a tangle and the frames beside it: a polygon through candidates, shape (T, k)."""
    limb, frames = around.limb, len(wanted)
    knots = np.unique(np.linspace(0, frames - 1, max(2, round((frames - 1) / (KNOT * fps)) + 1)).round().astype(int))
    at_knots = around.at(knots)
    angles, used = _candidates(at_knots, wanted[knots])  # (K, M, k), (K, M)
    for end, pin in zip((0, -1), pinned, strict=True):
        if pin:
            used[end, 1:] = False
            angles[end, 0], used[end, 0] = wanted[knots[end]], True
    count = angles.shape[1]
    points = limb.ends(angles.reshape(knots.size * count, -1))[0].reshape(knots.size, count, -1, 3)
    target = limb.ends(wanted[knots])[0].reshape(knots.size, 1, -1, 3)
    own = _mean_square(points - target) + DEPTH * _depths(at_knots, angles) ** 2
    share = np.gradient(knots.astype(float)) / fps
    own = share[:, None] * np.where(used, own, np.inf)
    best = own[0]
    came = np.zeros((knots.size, count), dtype=np.intp)
    for t in range(1, knots.size):
        one, two = np.flatnonzero(used[t - 1]), np.flatnonzero(used[t])
        dt = (knots[t] - knots[t - 1]) / fps
        turn = angles[t][None, two] - angles[t - 1][one, None]
        moved = _mean_square(points[t][None, two] - points[t - 1][one, None]) + ARM**2 * (turn**2).mean(axis=-1)
        between = np.zeros(moved.shape)
        for share_of_edge in BETWEEN:
            there = (angles[t][None, two] - (1.0 - share_of_edge) * turn).reshape(1, one.size * two.size, -1)
            frame = knots[t - 1 : t] + round(share_of_edge * (knots[t] - knots[t - 1]))
            between = np.maximum(between, _depths(around.at(frame), there).reshape(moved.shape))
        total = best[one, None] + TIME**2 / dt * moved + dt * DEPTH * between**2
        came[t, two] = one[np.argmin(total, axis=0)]
        best = np.full(count, np.inf)
        best[two] = total.min(axis=0)
        best += own[t]
    path = np.empty((knots.size, wanted.shape[1]))
    state = int(np.argmin(best))
    for t in range(knots.size - 1, -1, -1):
        path[t] = angles[t, state]
        state = int(came[t, state])
    if DEBUG: print(knots, np.round(1e3*_depths(at_knots, path[:,None])[:,0]))
    return np.stack([np.interp(np.arange(frames), knots, column) for column in path.T], axis=1)


def _candidates(around: Surroundings, wanted: Array) -> tuple[Array, Array]:
    """Configurations for every frame, the best first, and which of them there are.  # (T, M, k), (T, M)"""
    limb, frames = around.limb, len(wanted)
    ways = _directions()
    near = around.clearances(limb.ends(wanted)[0]) < NEAR
    who = np.repeat(np.arange(frames), len(ways))
    there, target = around.at(who), wanted[who]
    pushed = push_out(
        there, target, target, WIDE, OUT, directions=np.tile(ways, (frames, 1)), along=near[who]
    )
    relaxed = push_out(there, target, pushed, MARGIN, BACK)
    stay = push_out(around, wanted, wanted, MARGIN, BACK)
    size = (frames, len(ways), -1)
    all_angles = np.concatenate([stay[:, None], relaxed.reshape(size), pushed.reshape(size)], axis=1)
    count = all_angles.shape[1]
    flat = all_angles.reshape(frames * count, -1)
    points = limb.ends(flat)[0].reshape(frames, count, -1, 3)
    depth = _depths(around, all_angles)
    cost = _mean_square(points - limb.ends(wanted)[0].reshape(frames, 1, -1, 3)) + DEPTH * depth**2
    angles, used = np.zeros((frames, KEPT, wanted.shape[1])), np.zeros((frames, KEPT), dtype=bool)
    for t in range(frames):
        chosen: list[int] = []
        for c in np.argsort(cost[t]):
            if len(chosen) < KEPT and all(_mean_square(points[t, c] - points[t, o]) > DISTINCT**2 for o in chosen):
                chosen.append(int(c))
        angles[t, : len(chosen)], used[t, : len(chosen)] = all_angles[t, chosen], True
    return angles, used


def _directions() -> Array:
    """The 26 directions to the faces, edges and corners of a cube."""
    grid = np.stack(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    grid = grid[np.abs(grid).sum(axis=1) > 0]
    return np.asarray(grid / np.linalg.norm(grid, axis=1, keepdims=True))


def _depths(around: Surroundings, angles: Array) -> Array:
    """Deepest penetration of M configurations in each frame [m], 0 where there is none.  # (T, M, k) to (T, M)"""
    frames, count = angles.shape[:2]
    there = around.at(np.repeat(np.arange(frames), count))
    gap = there.clearances(around.limb.ends(angles.reshape(frames * count, -1))[0])
    return np.asarray(np.maximum(0.0, -gap.min(axis=1, initial=0.0))).reshape(frames, count)


def _mean_square(difference: Array) -> Array:
    """Mean over points of squared lengths: (..., E, 3) to (...)."""
    return np.asarray((difference**2).sum(axis=-1).mean(axis=-1))
