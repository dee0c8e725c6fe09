"""Products of quaternions of many frames, component by component: an array of numbers at a time.

Quaternions are wxyz with the components first, ``(4, ...)``, and of unit length.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """``a b``: the turn b in the axes that the turn a leads to.  # (4, ...)"""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return np.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ]
    )


def inverse(a: np.ndarray) -> np.ndarray:
    """The turn back.  # (4, ...)"""
    w, x, y, z = a
    return np.stack([w, -x, -y, -z])


def rotated(quaternions: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Vectors turned by quaternions, ``v + 2 w (u x v) + 2 u x (u x v)`` with ``q = (w, u)``.  # (3, ...)

    Args:
        quaternions: the turns.  # (4, ...)
        vectors: what they turn.  # (3, ...)
    """
    w, x, y, z = quaternions
    a, b, c = vectors
    # s = 2 u x v
    sx, sy, sz = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return np.stack([a + w * sx + y * sz - z * sy, b + w * sy + z * sx - x * sz, c + w * sz + x * sy - y * sx])


def from_euler(order: str, angles: Sequence[np.ndarray]) -> np.ndarray:
    """Turns about the axes of a frame that goes along, one after the other.  # (4, ...)

    Args:
        order: axes, of ``XYZ``.
        angles: about each of them [rad].  # (...) each
    """
    whole: np.ndarray | None = None
    for axis, angle in zip(order, angles, strict=True):
        one = np.zeros((4, *np.shape(angle)))
        one[0], one[1 + "XYZ".index(axis)] = np.cos(0.5 * angle), np.sin(0.5 * angle)
        whole = one if whole is None else product(whole, one)
    if whole is None:
        raise ValueError("no axes")
    return whole
