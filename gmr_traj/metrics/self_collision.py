"""How deep the robot's collision shapes reach into each other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from gmr_traj.metrics.capsules import segment_distance


@dataclass(frozen=True)
class Overlaps:
    """Every overlap of two collision shapes in a clip, sorted by pair and frame.

    Attributes:
        frames: number of frames T of the clip.
        pair: index into the robot's ``collision_pairs``.  # (N,)
        frame: frame of the overlap.  # (N,)
        depth: how deep [m], positive.  # (N,)
    """

    frames: int
    pair: np.ndarray
    frame: np.ndarray
    depth: np.ndarray

    def by_frame(self) -> np.ndarray:
        """Deepest overlap in each frame (T,) [m], 0 where there is none."""
        deepest = np.zeros(self.frames)
        np.maximum.at(deepest, self.frame, self.depth)
        return deepest


def overlaps(starts: np.ndarray, ends: np.ndarray, radii: np.ndarray, pairs: Sequence[tuple[int, int]]) -> Overlaps:
    """All overlaps among the given pairs of capsules.

    ``depth = max(0, r_i + r_j - d_ij)`` with d_ij the distance of the two axes; capsules whose bounding spheres
    are apart cannot overlap and are passed over.

    Args:
        starts: one end of the capsules' axes in the world [m].  # (T, C, 3)
        ends: the other end.  # (T, C, 3)
        radii: their radii [m].  # (C,)
        pairs: pairs of capsules to test.  # P
    """
    found: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    for p, near, gap in _gaps(starts, ends, radii, pairs, 0.0):
        inside = gap < 0.0
        if inside.any():
            frame = near[inside]
            found.append((np.full(frame.size, p), frame, -gap[inside]))
    if not found:
        return Overlaps(len(starts), np.zeros(0, int), np.zeros(0, int), np.zeros(0))
    pair, frame, depth = (np.concatenate(column) for column in zip(*found, strict=True))
    return Overlaps(len(starts), pair, frame, depth)


def clearance(
    starts: np.ndarray, ends: np.ndarray, radii: np.ndarray, pairs: Sequence[tuple[int, int]], reach: float
) -> np.ndarray:
    """Distance between the surfaces of the closest two capsules in every frame (T,) [m], negative inside.

    ``min(reach, min over pairs of d_ij - r_i - r_j)``: what is farther apart than ``reach`` [m] is as good as free.
    Arguments as of :func:`overlaps`.
    """
    closest = np.full(len(starts), reach)
    for _, near, gap in _gaps(starts, ends, radii, pairs, reach):
        closest[near] = np.minimum(closest[near], gap)
    return closest


def _gaps(
    starts: np.ndarray, ends: np.ndarray, radii: np.ndarray, pairs: Sequence[tuple[int, int]], reach: float
) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
    """For each pair whose bounding spheres come within ``reach``: its index, those frames, the gap in them [m]."""
    centres = 0.5 * (starts + ends).transpose(1, 0, 2)  # (C, T, 3)
    half = 0.5 * np.linalg.norm(ends[0] - starts[0], axis=-1) if len(starts) else np.zeros(len(radii))
    bound = half + radii  # (C,) rigid: the first frame's lengths are every frame's
    for p, (i, j) in enumerate(pairs):
        apart = centres[i] - centres[j]  # (T, 3)
        near = np.flatnonzero(np.einsum("ti,ti->t", apart, apart) < (bound[i] + bound[j] + reach) ** 2)
        if near.size:
            distance = segment_distance(starts[near, i], ends[near, i], starts[near, j], ends[near, j])
            yield p, near, distance - (radii[i] + radii[j])
