"""A limb that went through the body is taken around it: a start for the problem in which nothing is deep inside.

Where a limb is deep in the trunk, the normals of its many pairs of capsules contradict one another, and no choice of
signs makes them agree.  So the way out is chosen for the limb as a whole.  For every knot of such a tangle there are
several clear configurations (``ways_out``); the polygon through them is the one that minimises

    sum_t dt [ |d_t|^2 + TIME^2 |v_t|^2 + DEPTH (depth_t^2 + depth_between^2) ]

with the mean square distance d_t of the limb's end points from the clip, their speed v_t, and the penetration left, at
the knots and on the way from one to the next: dynamic programming, exact over the configurations.  It begins and ends
at the clip's own configurations around the tangle, and is then drawn tight in all frames (``elastic_band``).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from gmr_traj.collision.broadphase import Candidate, candidates, renewed
from gmr_traj.collision.capsules import radii, world_segments
from gmr_traj.collision.elastic_band import relax
from gmr_traj.collision.limbs import Limb, limbs
from gmr_traj.collision.push_out import Surroundings, deepest
from gmr_traj.collision.segments import Array
from gmr_traj.collision.tangles import DEEP, tangles
from gmr_traj.collision.ways_out import DEPTH, MARGIN, cost, end_points, mean_square, ways_out
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot

#: Time between knots [s]; the path is straight in between.
KNOT = 0.1

#: Tangles are looked at this often at least, so that nothing passes through the body between two frames [1/s].
RATE = 60.0

#: A distance of one metre costs as much as a speed of one metre in this time [s].
TIME = 0.1

#: A joint's turn by one radian counts as this way, so that a path does not jump between postures [m/rad].
ARM = 0.1

#: Where between two knots the way from one to the other is looked at.
BETWEEN = (0.25, 0.5, 0.75)

#: Pairs that never come closer than this in a tangle are left out [m].
REACH = 0.3


@dataclass(frozen=True)
class Tangle:
    """A limb and the frames ``first`` to ``last`` in which it is tangled."""

    limb: Limb
    first: int
    last: int


def untangle(robot: Robot, motion: RobotMotion) -> tuple[RobotMotion, list[Tangle]]:
    """The motion with its tangled limbs taken around the body, and where that was.

    Only joints of those limbs change, and only in the tangles.  Limbs with a sole are left alone: where a foot goes is
    for the contacts to say.  The result is near the clip and clear of the body, but neither within velocity limits nor
    exact; it is what the problem starts from and what it tracks.

    Args:
        robot: the robot.
        motion: the clip.

    Returns:
        the motion (the very same where there is no tangle), and the tangles.
    """
    found: list[Tangle] = []
    waiting = [limb for limb in limbs(robot) if not limb.feet and limb.capsules]
    at = placements(robot, motion.qpos)
    overlaps = candidates(robot, *at, -DEEP)
    while waiting:
        stretches = {limb.bodies: tangles(robot, limb, *at, overlaps, motion.fps) for limb in waiting}
        waiting = [limb for limb in waiting if stretches[limb.bodies]]
        if not waiting:
            break
        # Where two limbs meet, the one that is deeper in things makes way.
        limb = max(waiting, key=lambda limb: _total_depth(limb, overlaps))
        waiting.remove(limb)
        qpos = motion.qpos.copy()
        spans = [slice(max(0, first - 2), min(len(qpos), last + 3)) for first, last in stretches[limb.bodies]]
        stretch = [_stretch(robot, limb, qpos, span, motion.fps) for span in spans]
        for span, angles in zip(spans, _around_the_body(stretch), strict=True):
            qpos[span, 7 + limb.joints] = angles
        found += [Tangle(limb, first, last) for first, last in stretches[limb.bodies]]
        changed = np.flatnonzero((qpos != motion.qpos).any(axis=1))
        motion = motion.with_qpos(qpos)
        for of_all, of_changed in zip(at, placements(robot, qpos[changed]), strict=True):
            of_all[changed] = of_changed
        overlaps = renewed(overlaps, changed, candidates(robot, at[0][changed], at[1][changed], -DEEP))
    return motion, found


def _total_depth(limb: Limb, overlaps: list[Candidate]) -> float:
    mine = set(limb.capsules)
    return float(sum(-c.clearance.sum() for c in overlaps if (c.pair[0] in mine) != (c.pair[1] in mine)))


@dataclass(frozen=True)
class _Stretch:
    """The frames of a tangle and two more on either side, seen more often than they are where they are far apart.

    Attributes:
        around: the surroundings, with all pairs.
        near: pairs that come near each other.  # (P,)
        wanted: joint angles of the limb [rad].  # (T, k)
        rate: frames per second.
        parts: that every frame of the clip was divided into.
        pinned: whether the first two and the last two frames of the clip stay.
    """

    around: Surroundings
    near: np.ndarray
    wanted: Array
    rate: float
    parts: int
    pinned: tuple[bool, bool]

    @cached_property
    def knots(self) -> np.ndarray:
        """Frames between which the path is straight.  # (K,)"""
        count = max(2, round((len(self.wanted) - 1) / (KNOT * self.rate)) + 1)
        return np.unique(np.linspace(0, len(self.wanted) - 1, count).round().astype(int))

    @cached_property
    def fixed(self) -> np.ndarray:
        """Which frames stay.  # (T,)"""
        frame, frames = np.arange(len(self.wanted)) / self.parts, (len(self.wanted) - 1) // self.parts
        return ((frame <= 1) & self.pinned[0]) | ((frame >= frames - 1) & self.pinned[1])


def _stretch(robot: Robot, limb: Limb, qpos: Array, span: slice, fps: float) -> _Stretch:
    """What surrounds a limb in some frames of a clip."""
    parts, here = max(1, math.ceil(RATE / fps)), qpos[span]
    frame = np.arange(parts * (len(here) - 1) + 1) / parts
    fine = np.stack([np.interp(frame, np.arange(len(here)), column) for column in here.T], axis=1)
    fine[:, :7] = here[0, :7]  # only where the bodies are relative to each other matters
    wanted = fine[:, 7 + limb.joints]
    around = _surroundings(robot, limb, *placements(robot, fine))
    pinned = span.start > 0, span.stop < len(qpos)
    return _Stretch(around, around.nearer(wanted, REACH), wanted, parts * fps, parts, pinned)


def _around_the_body(stretches: Sequence[_Stretch]) -> list[Array]:
    """Joint angles of the limb in the clip's frames of every stretch."""
    out = []
    for stretch, path in zip(stretches, _paths(stretches), strict=True):
        around = stretch.around.only(stretch.near)
        angles = relax(around, stretch.wanted, path, MARGIN, 1.0 / stretch.rate, stretch.fixed)
        out.append(angles[:: stretch.parts])
    return out


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


def _paths(stretches: Sequence[_Stretch]) -> list[Array]:
    """Joint angles of the limb in every frame of every stretch: polygons through ways out.  # (T, k) each"""
    # Looked for in the knots of all stretches at once: a few long vectors instead of many short ones.
    first = stretches[0].around
    near = np.any([stretch.near for stretch in stretches], axis=0)
    ends = np.concatenate([stretch.around.ends[stretch.knots] for stretch in stretches])
    wanted = np.concatenate([stretch.wanted[stretch.knots] for stretch in stretches])
    angles, used = ways_out(replace(first, ends=ends).only(near), wanted)  # (K, M, k), (K, M)
    cuts = np.cumsum([len(stretch.knots) for stretch in stretches])[:-1]
    return [
        _path(stretch, *ways)
        for stretch, *ways in zip(stretches, np.split(angles, cuts), np.split(used, cuts), strict=True)
    ]


def _path(stretch: _Stretch, angles: Array, used: np.ndarray) -> Array:
    """The best polygon through some of a stretch's ways out, in every frame.  # (T, k)"""
    around, wanted, knots, fps = stretch.around.only(stretch.near), stretch.wanted, stretch.knots, stretch.rate
    for end, pin in zip((0, -1), stretch.pinned, strict=True):
        if pin:
            used[end, 1:] = False
            angles[end, 0], used[end, 0] = wanted[knots[end]], True
    points = end_points(around, angles)
    borders = np.concatenate([knots[:1], 0.5 * (knots[1:] + knots[:-1]), knots[-1:]])
    share = np.diff(borders)[:, None] / fps
    own = np.where(used, share * cost(around.at(knots), points, wanted[knots]), np.inf)
    ways = [np.flatnonzero(there) for there in used]
    between = _depths_between(around, knots, [angles[k, way] for k, way in enumerate(ways)])
    best, came = own[0], np.zeros(used.shape, dtype=np.intp)
    for k in range(1, knots.size):
        one, two = ways[k - 1], ways[k]
        dt = (knots[k] - knots[k - 1]) / fps
        moved = mean_square(points[k][None, two] - points[k - 1][one, None])
        moved += ARM**2 * ((angles[k][None, two] - angles[k - 1][one, None]) ** 2).mean(axis=-1)
        total = best[one, None] + TIME**2 / dt * moved + dt * DEPTH * between[k - 1] ** 2
        came[k, two] = one[total.argmin(axis=0)]
        best = own[k].copy()
        best[two] += total.min(axis=0)
    path = np.empty((knots.size, wanted.shape[1]))
    state = int(best.argmin())
    for k in range(knots.size - 1, -1, -1):
        path[k] = angles[k, state]
        state = int(came[k, state])
    return np.stack([np.interp(np.arange(len(wanted)), knots, column) for column in path.T], axis=1)


def _depths_between(around: Surroundings, knots: np.ndarray, angles: list[Array]) -> list[Array]:
    """Deepest penetration on the straight ways from each configuration in a knot to each in the next [m].

    Args:
        around: the surroundings in all frames.
        knots: frames.  # (K,)
        angles: configurations in each of them [rad].  # K of (M_k, k)

    Returns:
        depths.  # K - 1 of (M_k, M_k+1)
    """
    if len(knots) < 2:
        return []
    frames, ways = [], []
    for (first, one), (last, two) in pairwise(zip(knots.tolist(), angles, strict=True)):
        for share in BETWEEN:
            ways.append(((1.0 - share) * one[:, None] + share * two[None]).reshape(-1, one.shape[1]))
            frames.append(np.full(len(ways[-1]), first + round(share * (last - first))))
    where = around.at(np.concatenate(frames))
    depths = deepest(where, end_points(where, np.concatenate(ways)[:, None]))[:, 0]
    out, begin = [], 0
    for one, two in pairwise(angles):
        shape = len(BETWEEN), len(one), len(two)
        out.append(depths[begin : begin + math.prod(shape)].reshape(shape).max(axis=0))
        begin += math.prod(shape)
    return out
