"""The polygon that points in stance span: where the pressure of the floor can act."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, QhullError

# Points this close to one line span no polygon [m].
_THIN = 1e-3


def edges(points: np.ndarray, widen: float) -> tuple[np.ndarray, np.ndarray]:
    """Half-planes ``normal . p >= offset`` around the convex hull of points in the plane.

    A point or a line has no inside that a pressure could be found in; both get ``widen`` on all sides.

    Args:
        points: at least one.  # (K, 2)
        widen: half the width of a line [m], positive.

    Returns:
        inward unit normals  # (E, 2), and offsets [m]  # (E,).
    """
    hull = _hull(points)
    if hull is None:
        away = points - points[0]
        along = away[np.linalg.norm(away, axis=1).argmax()]
        length = float(np.linalg.norm(along))
        x, y = along / length if length > 0.0 else (1.0, 0.0)
        corners = widen * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) @ np.array([[x, y], [-y, x]])
        hull = _hull((points[:, None] + corners).reshape(-1, 2))
        assert hull is not None
    equations = np.unique(hull.equations.round(9), axis=0)
    return -equations[:, :2], equations[:, 2]


def thinned(points: np.ndarray, most: int) -> np.ndarray:
    """The points, or where there are more of them at most ``most`` corners of their hull: a polygon inside it.

    Corners are dropped one after another, the one first that cuts the least area off.

    Args:
        points: at least one.  # (K, 2)
        most: at least three.
    """
    hull = _hull(points) if len(points) > most else None
    if hull is None:
        return points
    corners = points[hull.vertices]  # in order around it
    while len(corners) > most:
        before, after = corners - np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0) - corners
        area = np.abs(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0])
        corners = np.delete(corners, int(area.argmin()), axis=0)
    return corners


def _hull(points: np.ndarray) -> ConvexHull | None:
    """The hull of the points; None where they are on a line."""
    if len(points) < 3 or np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[1] < _THIN:
        return None
    try:
        return ConvexHull(points)
    except QhullError:
        return None
