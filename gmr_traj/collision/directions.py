"""Which way to push two overlapping capsules apart, decided over the whole clip.

The witness normal of a single frame pushes to the nearer side. Where a limb went through another so far that the axes
passed each other, that is the far side, and where the axes nearly touch it is any side. Here the direction is taken
from the frames around: a limb is pushed back out on the side it came in by.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gmr_traj.collision.broadphase import Candidate
from gmr_traj.collision.capsules import radii, world_segments
from gmr_traj.collision.segments import Array, directed_distance, distance, normal
from gmr_traj.robot import Robot

#: Below this distance of the axes, as a share of the sum of the radii, a frame's own normal is not trusted.
TRUST = 0.3

#: An excursion to the far side of at most this many frames is taken back with the passages that enclose it.
BRIDGE = 5

#: Directions further apart than this are not interpolated along the great circle they do not define well [rad].
OPPOSITE = np.radians(150.0)

#: How many ways around a capsule are compared where a limb comes out on the side opposite to where it went in.
WAYS = 24


@dataclass(frozen=True)
class DirectedCandidate:
    """A pair of capsules, the frames in which to keep it apart, and the direction in each.

    Attributes:
        pair: indices into ``robot.capsules``.
        frames: frames in ascending order: those of the candidate, and those of bridged excursions.  # (F,)
        normals: unit vectors from capsule ``pair[1]`` to ``pair[0]``, world axes.  # (F, 3)
        clearance: exact clearance [m].  # (F,)
        directed: clearance along the normals [m], at most the exact one.  # (F,)
        held: where the direction comes from the frames around rather than from the frame itself.  # (F,)
    """

    pair: tuple[int, int]
    frames: np.ndarray
    normals: np.ndarray
    clearance: np.ndarray
    directed: np.ndarray
    held: np.ndarray


def separating_directions(
    robot: Robot,
    positions: Array,
    rotations: Array,
    candidates: list[Candidate],
    *,
    trust: float = TRUST,
    bridge: int = BRIDGE,
) -> list[DirectedCandidate]:
    """A direction for every pair and frame, consistent over time.

    Outside overlaps, and in overlaps that leave no doubt, it is the frame's own witness normal, for which the directed
    clearance is the exact one. From the first to the last doubtful frame of an overlap (axes closer than ``trust``
    times the sum of the radii, or a normal that turns by more than a right angle in one frame) it is interpolated on
    the unit sphere between the normals of the frames before and after, in the axes of the base, so that it turns with
    the robot. Where the limb comes out on the opposite side, the interpolation goes round the way that leaves the least
    to move. An excursion of at most ``bridge`` frames to the far side and back counts as one overlap. An overlap that
    begins or ends with the clip takes the normal of its other side, and one without either the normal of its
    shallowest frame.

    Args:
        robot: its capsules and base.
        positions: origins of ``robot.body_names`` in the world [m], whole clip.  # (T, B, 3)
        rotations: their orientations in the world.  # (T, B, 3, 3)
        candidates: what ``broadphase.candidates`` found on the same clip.
        trust: share of the sum of the radii.
        bridge: frames.
    """
    starts, ends = world_segments(robot, positions, rotations)
    radius = radii(robot)
    base = rotations[:, 0]
    out = []
    for candidate in candidates:
        i, j = candidate.pair
        segments = (starts[:, i], ends[:, i], starts[:, j], ends[:, j])
        reach = float(radius[i] + radius[j])
        axes, _, _ = distance(*segments)
        own = np.einsum("tji,tj->ti", base, normal(*segments))  # (T, 3) base axes
        spans = _doubtful_spans(axes, own, reach, trust, bridge)
        chosen, held = own.copy(), np.zeros(len(own), dtype=bool)
        for first, last in spans:
            span = slice(first, last + 1)
            in_base = [np.einsum("tji,tj->ti", base[span], points[span]) for points in segments]
            chosen[span] = _across(own, axes, first, last, in_base)
            held[span] = True
        frames = np.union1d(candidate.frames, np.flatnonzero(held))
        normals = np.einsum("tij,tj->ti", base[frames], chosen[frames])
        directed = directed_distance(normals, *(points[frames] for points in segments)) - reach
        out.append(DirectedCandidate((i, j), frames, normals, axes[frames] - reach, directed, held[frames]))
    return out


def _doubtful_spans(axes: Array, own: Array, reach: float, trust: float, bridge: int) -> list[tuple[int, int]]:
    """First and last doubtful frame of every overlap, short excursions to the far side bridged."""
    overlap = axes < reach
    turned = np.einsum("ti,ti->t", own[1:], own[:-1]) < 0.0
    doubtful = axes < trust * reach
    doubtful[1:] |= turned
    doubtful[:-1] |= turned
    doubtful &= overlap
    edges = np.flatnonzero(np.diff(overlap, prepend=False, append=False))
    spans: list[tuple[int, int]] = []
    for start, stop in edges.reshape(-1, 2):
        inside = start + np.flatnonzero(doubtful[start:stop])
        if not inside.size:
            continue
        first, last = int(inside[0]), int(inside[-1])
        if spans and first - spans[-1][1] - 1 <= bridge and _returns(own, spans[-1], (first, last)):
            first = spans.pop()[0]
        spans.append((first, last))
    return spans


def _returns(own: Array, before: tuple[int, int], after: tuple[int, int]) -> bool:
    """Whether the gap between two spans is on the side opposite to the one before the first and after the second."""
    if before[0] == 0 or after[1] == len(own) - 1:
        return False
    came, went, gap = own[before[0] - 1], own[after[1] + 1], own[before[1] + 1 : after[0]]
    return bool(came @ went > 0 and (gap @ came).min() < 0)


def _across(own: Array, axes: Array, first: int, last: int, segments: list[Array]) -> Array:
    """Directions of the frames first..last in base axes, from those of the frames around, shape (F, 3)."""
    length = last - first + 1
    came = own[first - 1] if first > 0 else None
    went = own[last + 1] if last + 1 < len(own) else None
    if came is None or went is None:
        shallowest = own[first + int(np.argmax(axes[first : last + 1]))]
        one = came if came is not None else went if went is not None else shallowest
        return np.tile(one, (length, 1))
    share = np.arange(1, length + 1) / (length + 1)
    if came @ went > np.cos(OPPOSITE):
        return _great_circle(came, went, share)
    middle = _way_round(came, went, segments)
    return np.where(
        (share < 0.5)[:, None], _great_circle(came, middle, 2 * share), _great_circle(middle, went, 2 * share - 1)
    )


def _way_round(came: Array, went: Array, segments: list[Array]) -> Array:
    """Of the directions half-way between two opposite ones, that along which the capsules overlap least."""
    axis = (came - went) / np.linalg.norm(came - went)
    one = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    one /= np.linalg.norm(one)
    angle = np.linspace(0.0, 2 * np.pi, WAYS, endpoint=False)[:, None]
    ways = np.cos(angle) * one + np.sin(angle) * np.cross(axis, one)  # (WAYS, 3)
    gained = directed_distance(ways[:, None], *segments).sum(axis=1)
    return np.asarray(ways[int(np.argmax(gained))])


def _great_circle(start: Array, end: Array, share: Array) -> Array:
    """Unit vectors at the given shares of the arc from start to end (not opposite), shape (N, 3)."""
    angle = np.arccos(np.clip(start @ end, -1.0, 1.0))
    if angle < 1e-6:
        return np.tile(start, (len(share), 1))
    weights = np.stack([np.sin((1 - share) * angle), np.sin(share * angle)], axis=1) / np.sin(angle)
    return np.asarray(weights @ np.stack([start, end]))
