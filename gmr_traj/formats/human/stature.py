"""How tall a person is, from the bones that carry them when they stand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gmr_traj.formats.human.rigs import Landmarks


def standing_length(
    names: Sequence[str], parents: Sequence[int], positions: np.ndarray, marks: Landmarks
) -> float | None:
    """Length along the bones from the ankles, over the middle of the hips and the root, to the head joint.

    ``l = (l_left + l_right) / 2 + |(h_left + h_right) / 2 - p_root| + l_spine``: the bones of both legs from hip to
    ankle, from the root to the point halfway between the hips, and from the root to the head.  Lengths are medians
    over the frames, so that the rule needs no rest pose and holds for files that stretch a bone in a few frames.  The
    hips are the first joints at which the two legs are in different places.

    Args:
        names: the joints.  # J
        parents: index of each one's parent, -1 for the root.  # J
        positions: joint positions, in any unit and axes.  # (T, J, 3)
        marks: which joints are head and ankles.

    Returns:
        The length in the unit of the positions; None where the joints are not one tree with two legs.
    """
    left, right = (_path(names, parents, ankle) for ankle in marks.ankles)
    head = _path(names, parents, marks.head)
    if not left[0] == right[0] == head[0] or len(left) != len(right):
        return None
    apart = [k for k, (a, b) in enumerate(zip(left, right, strict=True)) if not _same(positions, a, b)]
    if not apart:
        return None
    hip = apart[0]
    middle = (positions[:, left[hip]] + positions[:, right[hip]]) / 2
    drop = float(np.median(np.linalg.norm(middle - positions[:, left[0]], axis=1)))
    legs = (_length(positions, left[hip:]) + _length(positions, right[hip:])) / 2
    return legs + drop + _length(positions, head)


def _path(names: Sequence[str], parents: Sequence[int], name: str) -> list[int]:
    """Joints from the root to one of them."""
    path = [names.index(name)]
    while parents[path[-1]] >= 0:
        path.append(parents[path[-1]])
    return path[::-1]


def _length(positions: np.ndarray, path: Sequence[int]) -> float:
    bones = np.linalg.norm(np.diff(positions[:, path], axis=1), axis=2)  # (T, bones)
    return float(np.median(bones, axis=0).sum())


def _same(positions: np.ndarray, a: int, b: int) -> bool:
    return a == b or bool(np.allclose(positions[:, a], positions[:, b], atol=1e-9))
