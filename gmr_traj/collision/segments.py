"""Distances between line segments in closed form, vectorised over leading axes.

A capsule is all points within a radius of a segment, so the clearance of two capsules is the distance of their
segments less both radii [m]; it is negative where they overlap, and then minus the penetration depth.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Axes closer than this share of the segments' lengths count as crossing: rounding decides where their witnesses point.
CROSSING = 1e-9

#: Squared lengths and their products below this are zero: a point, or parallel segments. Keeps ratios from overflowing.
SMALLEST = 1e-200

#: Stands in where two points coincide and no segment tells a direction.
ANY_DIRECTION = np.array([0.0, 0.0, 1.0])


def distance(a0: Array, a1: Array, b0: Array, b1: Array) -> tuple[Array, Array, Array]:
    """Distance of the segments a0-a1 and b0-b1 and where it is attained.

    Minimises the convex quadratic ``|a(s) - b(t)|^2`` with ``a(s) = a0 + s (a1 - a0)``, ``b(t) = b0 + t (b1 - b0)``
    over the unit square: the closest parameter of A's line to B's line, clamped; the point of B closest to it,
    clamped; the point of A closest to that one, clamped. The last step makes the result the minimum in all cases,
    because a clamped first step already tells which edge of the square the minimum lies on, and it is what makes
    parallel and point-like segments come out right: there any first parameter will do. The line-to-line step uses
    ``u x v`` rather than ``|u|^2 |v|^2 - (u v)^2``, which would cancel for nearly parallel segments.

    Args:
        a0: start of A [m]; all four broadcast against each other.  # (..., 3)
        a1: end of A.  # (..., 3)
        b0: start of B.  # (..., 3)
        b1: end of B.  # (..., 3)

    Returns:
        distance [m]; s, t in [0, 1]: the closest points are a(s) and b(t). Where the minimum is not unique
        (parallel segments) s and t are one of the minimisers.  # (...,), (...,), (...,)

    References:
        C. Ericson, Real-Time Collision Detection, 2005, section 5.1.9.
    """
    u, v, r = a1 - a0, b1 - b0, b0 - a0
    uu, vv, uv = _dot(u, u), _dot(v, v), _dot(u, v)
    ur, vr = _dot(u, r), _dot(v, r)
    w = cross(u, v)
    s = np.clip(_ratio(_dot(cross(r, v), w), _dot(w, w)), 0.0, 1.0)
    t = np.clip(_ratio(s * uv - vr, vv), 0.0, 1.0)
    s = np.clip(_ratio(t * uv + ur, uu), 0.0, 1.0)
    gap = s[..., None] * u - t[..., None] * v - r
    return np.sqrt(_dot(gap, gap)), s, t


def normal(a0: Array, a1: Array, b0: Array, b1: Array) -> Array:
    """Unit witness normal, from the closest point of segment B to that of segment A.

    It is the gradient of the distance with respect to a translation of A, and it is continuous in the end points
    while the segments do not touch (also for parallel ones, whose witness points jump). Where they touch it is the
    common perpendicular u x v, whose sign is arbitrary, or for parallel segments some perpendicular of theirs.

    Args:
        a0: start of A [m].  # (..., 3)
        a1: end of A.  # (..., 3)
        b0: start of B.  # (..., 3)
        b1: end of B.  # (..., 3)

    Returns:
        unit vectors.  # (..., 3)
    """
    d, s, t = distance(a0, a1, b0, b1)
    u, v = np.broadcast_arrays(a1 - a0, b1 - b0)
    gap = a0 + s[..., None] * u - b0 - t[..., None] * v
    size = np.sqrt(np.maximum(_dot(u, u), _dot(v, v)))
    touching = d <= CROSSING * size
    touching |= d == 0.0
    if touching.any():
        gap = gap.copy()
        gap[touching] = _perpendicular(u[touching], v[touching])
    return gap / np.sqrt(_dot(gap, gap))[..., None]


def _perpendicular(u: Array, v: Array) -> Array:
    """A vector (not of unit length) perpendicular to u and to v."""
    w = cross(u, v)
    scale = np.maximum(_dot(u, u), _dot(v, v))
    parallel = _dot(w, w) <= CROSSING**2 * scale**2
    if parallel.any():
        longer = np.where((_dot(u, u) >= _dot(v, v))[..., None], u, v)[parallel]
        axis = np.eye(3)[np.argmin(np.abs(longer), axis=-1)]
        w[parallel] = cross(longer, axis)
        points = np.flatnonzero(parallel)[_dot(longer, longer) == 0.0]
        w[points] = ANY_DIRECTION
    return w


def _dot(x: Array, y: Array) -> Array:
    return np.asarray(x[..., 0] * y[..., 0] + x[..., 1] * y[..., 1] + x[..., 2] * y[..., 2])


def cross(x: Array, y: Array) -> Array:
    """``x`` times ``y``, as ``np.cross`` has it, in a fraction of its time; both broadcast.  # (..., 3)"""
    return np.stack(
        [
            x[..., 1] * y[..., 2] - x[..., 2] * y[..., 1],
            x[..., 2] * y[..., 0] - x[..., 0] * y[..., 2],
            x[..., 0] * y[..., 1] - x[..., 1] * y[..., 0],
        ],
        axis=-1,
    )


def _ratio(numerator: Array, denominator: Array) -> Array:
    """Quotient, and 0 where the denominator is 0 (a point, or parallel segments)."""
    out = np.zeros(np.broadcast_shapes(numerator.shape, denominator.shape))
    return np.divide(numerator, denominator, out=out, where=denominator > SMALLEST)
