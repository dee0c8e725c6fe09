"""Which pairs of capsules come close in which frames of a clip."""

from __future__ import annotations

import ctypes
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import fcl
import numpy as np

from gmr_traj.collision.capsules import radii, world_segments
from gmr_traj.collision.segments import Array, distance
from gmr_traj.kernels.library import address, arguments, kernels
from gmr_traj.robot import Robot

#: Frames whose swept boxes are searched together. Longer chunks mean fewer searches and more false alarms.
CHUNK = 128

#: Added to every box [m], so that rounding can lose no pair whose clearance equals the margin.
ROUNDING = 1e-9


class _Capsules(ctypes.Structure):
    """What ``Capsules`` is in segments.c."""

    _fields_ = (
        *((name, ctypes.c_int64) for name in ("frames", "pairs")),
        *((name, ctypes.c_void_p) for name in ("starts", "ends", "pair", "radii", "reach")),
    )


@dataclass(frozen=True)
class Candidate:
    """A pair of capsules and the frames in which they come closer than the margin that was asked for.

    Attributes:
        pair: indices into ``robot.capsules``, one of ``robot.collision_pairs``.
        frames: frames in ascending order.  # (F,)
        clearance: signed clearance in those frames [m], negative where they overlap.  # (F,)
    """

    pair: tuple[int, int]
    frames: np.ndarray
    clearance: np.ndarray


def candidates(
    robot: Robot,
    positions: Array,
    rotations: Array,
    margin: float,
    *,
    chunk: int = CHUNK,
) -> list[Candidate]:
    """All pairs and frames with a clearance below ``margin``; none is missed.

    Per chunk of frames each capsule is swept into one axis-aligned box, inflated by its radius and half the margin;
    python-fcl's AABB tree reports the boxes that overlap, and in every frame of the chunk first the spheres around the
    capsules and then the closed form decide.  All of that as seen from the base, so that a robot that walks or turns
    sweeps no more than one that stands.  Compiled, the spheres alone take less time than the boxes.

    Args:
        robot: its ``collision_pairs`` are searched.
        positions: origins of ``robot.body_names`` in the world [m].  # (T, B, 3)
        rotations: their orientations in the world.  # (T, B, 3, 3)
        margin: clearance below which a pair counts [m].
        chunk: frames a box.

    Returns:
        candidates in the order of ``robot.collision_pairs``; pairs that never come close are left out.
    """
    if not len(positions) or not robot.collision_pairs:
        return []
    base = rotations[:, :1]
    seen = np.einsum("tkji,tbj->tbi", base, positions - positions[:, :1]), base.swapaxes(2, 3) @ rotations
    starts, ends = world_segments(robot, *seen)  # (T, C, 3)
    radius = radii(robot)
    library = kernels()
    if library is not None:
        return _all_frames(library, robot.collision_pairs, starts, ends, radius, margin)
    middles, halves = 0.5 * (starts + ends), 0.5 * np.linalg.norm(ends - starts, axis=2).max(axis=0)
    inflation = np.maximum(radius + 0.5 * margin, 0.0) + ROUNDING
    close = _chunks_of_pairs(robot, starts, ends, inflation, chunk)
    out = []
    for i, j in robot.collision_pairs:
        if (i, j) not in close:
            continue
        frames = (np.array(close[i, j], dtype=np.intp)[:, None] + np.arange(chunk)).ravel()
        frames = frames[frames < len(positions)]
        reach = radius[i] + radius[j] + halves[i] + halves[j] + margin + ROUNDING
        between = middles[frames, i] - middles[frames, j]
        frames = frames[np.einsum("ti,ti->t", between, between) < max(reach, 0.0) ** 2]
        gap, _, _ = distance(starts[frames, i], ends[frames, i], starts[frames, j], ends[frames, j])
        gap -= radius[i] + radius[j]
        chosen = gap < margin
        if chosen.any():
            out.append(Candidate((i, j), frames[chosen], gap[chosen]))
    return out


def _all_frames(
    library: ctypes.CDLL, pairs: Sequence[tuple[int, int]], starts: Array, ends: Array, radius: Array, margin: float
) -> list[Candidate]:
    """The same by spheres and the closed form in all frames."""
    starts, ends = (np.ascontiguousarray(points.transpose(1, 0, 2)) for points in (starts, ends))
    span = ends - starts
    halves = 0.5 * np.sqrt(np.einsum("cti,cti->ct", span, span).max(axis=1))
    both = np.array(pairs)
    i, j = both.T
    sums = radius[i] + radius[j]
    reach = np.maximum(sums + halves[i] + halves[j] + margin + ROUNDING, 0.0)
    given = _Capsules(starts.shape[1], len(both), *map(address, (starts, ends, both, sums, reach)))
    counts, room = np.empty(len(both), np.int64), 32 * (starts.shape[1] + len(both))
    while True:
        frames, clearance = np.empty(room, np.int64), np.empty(room)
        found = library.segments_close(ctypes.byref(given), *arguments(margin, room, counts, frames, clearance))
        if found <= room:
            break
        room = found
    cuts = np.cumsum(counts)
    parts = zip(pairs, np.split(frames[:found], cuts[:-1]), np.split(clearance[:found], cuts[:-1]), strict=True)
    return [Candidate(pair, at.astype(np.intp), gap.copy()) for pair, at, gap in parts if at.size]


def renewed(found: list[Candidate], frames: np.ndarray, fresh: list[Candidate]) -> list[Candidate]:
    """What was found in a clip, once some of its frames have changed.

    Args:
        found: before the change.
        frames: those that changed, ascending.  # (K,)
        fresh: what is found in these frames alone, numbered from 0 to K - 1.
    """
    new = {candidate.pair: candidate for candidate in fresh}
    out = []
    for old in found:
        kept = ~np.isin(old.frames, frames)
        parts = [(old.frames[kept], old.clearance[kept])]
        if old.pair in new:
            again = new.pop(old.pair)
            parts.append((frames[again.frames], again.clearance))
        at, clearance = (np.concatenate([part[k] for part in parts]) for k in range(2))
        by = np.argsort(at)
        if by.size:
            out.append(Candidate(old.pair, at[by], clearance[by]))
    return [*out, *(Candidate(c.pair, frames[c.frames], c.clearance) for c in new.values())]


def _chunks_of_pairs(
    robot: Robot, starts: Array, ends: Array, inflation: Array, chunk: int
) -> dict[tuple[int, int], list[int]]:
    """For each collision pair whose swept boxes overlap somewhere, the first frames of those chunks, ascending."""
    firsts = np.arange(0, len(starts), chunk)
    lower = np.minimum.reduceat(np.minimum(starts, ends), firsts) - inflation[:, None]  # (K, C, 3)
    upper = np.maximum.reduceat(np.maximum(starts, ends), firsts) + inflation[:, None]
    wanted = {(min(p), max(p)): p for p in robot.collision_pairs}
    used = sorted({c for pair in robot.collision_pairs for c in pair})
    out = defaultdict(list)
    for first, low, high in zip(firsts.tolist(), lower, upper, strict=True):
        for i, j in _overlapping(low, high, used):
            if (i, j) in wanted:
                out[wanted[i, j]].append(first)
    return out


def _overlapping(lower: Array, upper: Array, used: list[int]) -> Iterator[tuple[int, int]]:
    """Pairs (i < j) of boxes that overlap, by python-fcl's dynamic AABB tree.

    The tree hands its callback fresh handles of the objects, which tell them apart by their position alone; boxes
    that share a centre are all reported with it, which adds false alarms and loses nothing.
    """
    centres, sides = 0.5 * (lower + upper), upper - lower
    objects = [fcl.CollisionObject(fcl.Box(*sides[c]), fcl.Transform(centres[c])) for c in used]
    at: defaultdict[bytes, list[int]] = defaultdict(list)
    for c in used:
        at[centres[c].tobytes()].append(c)
    found: set[tuple[int, int]] = set()

    def report(a: fcl.CollisionObject, b: fcl.CollisionObject, _: None) -> bool:
        for i in at[a.getTranslation().tobytes()]:
            for j in at[b.getTranslation().tobytes()]:
                if i != j:
                    found.add((min(i, j), max(i, j)))
        return False

    tree = fcl.DynamicAABBTreeCollisionManager()
    tree.registerObjects(objects)
    tree.setup()
    tree.collide(None, report)
    yield from found
