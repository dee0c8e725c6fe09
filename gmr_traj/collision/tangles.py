"""Where a limb is so deep in the body that its capsules' own normals do not say which way is out."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from gmr_traj.collision.broadphase import Candidate
from gmr_traj.collision.capsules import radii, world_segments
from gmr_traj.collision.limbs import Limb
from gmr_traj.collision.segments import Array, normal
from gmr_traj.robot import Robot
from gmr_traj.runs import runs

#: A pair deeper than this takes part in a tangle [m]; shallower overlaps are left to the problem.
DEEP = 0.015

#: Axes closer than this share of the sum of the radii leave it open on which side the limb is.
TRUST = 0.3

#: Normals that push one capsule ways this far apart contradict each other (cosine).
AGAINST = -0.5

#: Tangles closer together than this are one [s], and each is widened by this on both sides [s].
BRIDGE, WIDEN = 0.35, 0.1


def tangles(
    robot: Robot, limb: Limb, positions: Array, rotations: Array, overlaps: list[Candidate], fps: float
) -> list[tuple[int, int]]:
    """First and last frame of every stretch in which the limb is deep in something and it is doubtful which way is out.

    Doubtful is a frame in which the axes of a pair nearly touch, the normals of two deep pairs contradict each other,
    or the normal of a deep pair turns by more than a right angle from one frame to the next.

    Args:
        robot: its capsules.
        limb: the limb.
        positions: origins of ``robot.body_names`` in the world [m].  # (T, B, 3)
        rotations: their orientations in the world.  # (T, B, 3, 3)
        overlaps: pairs deeper than ``DEEP``; those between the limb and all else are looked at.
        fps: frames per second.

    Returns:
        stretches, ascending, which do not touch each other.
    """
    frames, mine = len(positions), set(limb.capsules)
    near = [c for c in overlaps if (c.pair[0] in mine) != (c.pair[1] in mine)]
    deep, doubtful = np.zeros((2, frames), dtype=bool)
    if not near:
        return []
    starts, ends = world_segments(robot, positions, rotations)
    radius = radii(robot)
    normals = []
    for candidate in near:
        i, j = candidate.pair if candidate.pair[0] in mine else candidate.pair[::-1]
        at = candidate.frames
        normals.append(normal(starts[at, i], ends[at, i], starts[at, j], ends[at, j]))
        reach = radius[i] + radius[j]
        deep[at] = True
        doubtful[at[candidate.clearance + reach < TRUST * reach]] = True
        turned = (np.diff(at) == 1) & (np.einsum("ti,ti->t", normals[-1][1:], normals[-1][:-1]) < 0.0)
        doubtful[at[1:][turned]] = doubtful[at[:-1][turned]] = True
    for (one, n), (two, m) in combinations(zip(near, normals, strict=True), 2):
        if set(one.pair) & set(two.pair) & mine:
            doubtful[_against(one, n, two, m)] = True
    return _stretches(deep, doubtful, round(BRIDGE * fps), round(WIDEN * fps))


def _against(one: Candidate, n: Array, two: Candidate, m: Array) -> Array:
    """Frames in which the normals of two pairs contradict each other."""
    both, at_one, at_two = np.intersect1d(one.frames, two.frames, assume_unique=True, return_indices=True)
    return np.asarray(both[np.einsum("ti,ti->t", n[at_one], m[at_two]) < AGAINST])


def _stretches(deep: Array, doubtful: Array, bridge: int, widen: int) -> list[tuple[int, int]]:
    """Runs of deep frames with a doubtful one among them, joined over short gaps and widened."""
    out: list[tuple[int, int]] = []
    for start, stop in runs(deep):
        if not doubtful[start:stop].any():
            continue
        first, last = max(0, start - widen), min(len(deep), stop + widen) - 1
        if out and start - (out[-1][1] + 1 - widen) <= max(bridge, 2 * widen):
            first = out.pop()[0]
        out.append((first, last))
    return out
