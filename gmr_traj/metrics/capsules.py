"""Distances between capsules, vectorised over frames."""

from __future__ import annotations

import numpy as np

_TINY = 1e-12  # squared length [m^2] below which a segment counts as a point


def point_segment_distance(point: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Distance of points to segments [m].

    ``min over s in [0, 1] of ||p - a - s (b - a)||``, attained at ``s = clip((p - a).(b - a) / ||b - a||^2, 0, 1)``.

    Args:
        point: p.  # (N, 3)
        start: a.  # (N, 3)
        end: b.  # (N, 3)

    Returns:
        Distances.  # (N,)
    """
    along = end - start  # (N, 3)
    offset = point - start  # (N, 3)
    length = np.maximum(_dot(along, along), _TINY)  # (N,)
    s = np.clip(_dot(offset, along) / length, 0.0, 1.0)  # (N,)
    offset -= s[:, None] * along
    return np.sqrt(_dot(offset, offset))


def segment_distance(a0: np.ndarray, a1: np.ndarray, b0: np.ndarray, b1: np.ndarray) -> np.ndarray:
    """Distance of segments ``a0 a1`` to segments ``b0 b1`` [m].

    Two segments are closest either at an end of one of them (four point-segment distances) or, where the common
    perpendicular of their lines meets both inside, at its feet

        s = (ab.bd - bb.ad) / (aa.bb - ab^2),   t = (aa.bd - ab.ad) / (aa.bb - ab^2),

    with a = a1 - a0, b = b1 - b0, d = a0 - b0 and xy short for the scalar product.  The least of the five is the
    distance, parallel segments and points included.

    Args:
        a0: start of the first segments.  # (N, 3)
        a1: their ends.  # (N, 3)
        b0: start of the second segments.  # (N, 3)
        b1: their ends.  # (N, 3)

    Returns:
        Distances.  # (N,)
    """
    best = np.minimum(point_segment_distance(a0, b0, b1), point_segment_distance(a1, b0, b1))
    np.minimum(best, point_segment_distance(b0, a0, a1), out=best)
    np.minimum(best, point_segment_distance(b1, a0, a1), out=best)
    a, b, d = a1 - a0, b1 - b0, a0 - b0  # (N, 3)
    aa, bb, ab, ad, bd = _dot(a, a), _dot(b, b), _dot(a, b), _dot(a, d), _dot(b, d)  # (N,)
    denominator = aa * bb - ab * ab
    skew = denominator > _TINY * np.maximum(aa * bb, _TINY)  # nearly parallel: the ends already have it
    safe = np.where(skew, denominator, 1.0)
    s, t = (ab * bd - bb * ad) / safe, (aa * bd - ab * ad) / safe
    inside = skew & (s > 0.0) & (s < 1.0) & (t > 0.0) & (t < 1.0)
    if inside.any():
        gap = d[inside] + s[inside, None] * a[inside] - t[inside, None] * b[inside]
        best[inside] = np.minimum(best[inside], np.sqrt(_dot(gap, gap)))
    return best


def _dot(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.einsum("ni,ni->n", x, y)
