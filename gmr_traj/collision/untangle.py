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
from dataclasses import dataclass

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
        for first, last in stretches[limb.bodies]:
            span = slice(max(0, first - 2), min(len(qpos), last + 3))
            pinned = (first > 1, last + 2 < len(qpos))
            qpos[span, 7 + limb.joints] = _around_the_body(robot, limb, qpos[span], motion.fps, pinned)
            found.append(Tangle(limb, first, last))
        changed = np.flatnonzero((qpos != motion.qpos).any(axis=1))
        motion = motion.with_qpos(qpos)
        for of_all, of_changed in zip(at, placements(robot, qpos[changed]), strict=True):
            of_all[changed] = of_changed
        overlaps = renewed(overlaps, changed, candidates(robot, at[0][changed], at[1][changed], -DEEP))
    return motion, found


def _total_depth(limb: Limb, overlaps: list[Candidate]) -> float:
    mine = set(limb.capsules)
    return float(sum(-c.clearance.sum() for c in overlaps if (c.pair[0] in mine) != (c.pair[1] in mine)))


def _around_the_body(robot: Robot, limb: Limb, qpos: Array, fps: float, pinned: tuple[bool, bool]) -> Array:
    """Joint angles of the limb in the frames of a tangle; the first and last two stay where they are pinned."""
    parts = max(1, math.ceil(RATE / fps))
    frame = np.arange(parts * (len(qpos) - 1) + 1) / parts
    fine = np.stack([np.interp(frame, np.arange(len(qpos)), column) for column in qpos.T], axis=1)
    fine[:, :7] = qpos[0, :7]  # only where the bodies are relative to each other matters
    wanted = fine[:, 7 + limb.joints]
    around = _surroundings(robot, limb, *placements(robot, fine)).within(wanted, REACH)
    fixed = ((frame <= 1) & pinned[0]) | ((frame >= len(qpos) - 2) & pinned[1])
    path = _path(around, wanted, parts * fps, pinned)
    return relax(around, wanted, path, MARGIN, 1.0 / (parts * fps), fixed)[::parts]


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


def _path(around: Surroundings, wanted: Array, fps: float, pinned: tuple[bool, bool]) -> Array:
    """Joint angles of the limb in every frame of a tangle and beside it: a polygon through ways out, shape (T, k)."""
    frames = len(wanted)
    knots = np.unique(np.linspace(0, frames - 1, max(2, round((frames - 1) / (KNOT * fps)) + 1)).round().astype(int))
    angles, used = ways_out(around.at(knots), wanted[knots])  # (K, M, k), (K, M)
    for end, pin in zip((0, -1), pinned, strict=True):
        if pin:
            used[end, 1:] = False
            angles[end, 0], used[end, 0] = wanted[knots[end]], True
    points = end_points(around, angles)
    borders = np.concatenate([knots[:1], 0.5 * (knots[1:] + knots[:-1]), knots[-1:]])
    share = np.diff(borders)[:, None] / fps
    own = np.where(used, share * cost(around.at(knots), points, wanted[knots]), np.inf)
    best, came = own[0], np.zeros(used.shape, dtype=np.intp)
    for k in range(1, knots.size):
        one, two = np.flatnonzero(used[k - 1]), np.flatnonzero(used[k])
        dt = (knots[k] - knots[k - 1]) / fps
        moved = mean_square(points[k][None, two] - points[k - 1][one, None])
        moved += ARM**2 * ((angles[k][None, two] - angles[k - 1][one, None]) ** 2).mean(axis=-1)
        between = _depth_between(around, knots[k - 1], knots[k], angles[k - 1][one], angles[k][two])
        total = best[one, None] + TIME**2 / dt * moved + dt * DEPTH * between**2
        came[k, two] = one[total.argmin(axis=0)]
        best = own[k].copy()
        best[two] += total.min(axis=0)
    path = np.empty((knots.size, wanted.shape[1]))
    state = int(best.argmin())
    for k in range(knots.size - 1, -1, -1):
        path[k] = angles[k, state]
        state = int(came[k, state])
    return np.stack([np.interp(np.arange(frames), knots, column) for column in path.T], axis=1)


def _depth_between(around: Surroundings, first: int, last: int, one: Array, two: Array) -> Array:
    """Deepest penetration on the straight ways from configurations in one frame to those in another [m].  # (M, N)"""
    out = np.zeros((len(one), len(two)))
    for share in BETWEEN:
        frame = np.array([first + round(share * (last - first))])
        angles = (1.0 - share) * one[:, None] + share * two[None]
        points = end_points(around, angles.reshape(1, out.size, -1))
        out = np.maximum(out, deepest(around.at(frame), points).reshape(out.shape))
    return out
