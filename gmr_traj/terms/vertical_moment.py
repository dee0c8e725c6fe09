"""The moment about the vertical that one foot's friction can give.

On a rectangle of half sides X, Y, with pyramids of friction mu at its corners whose sides are parallel to the
rectangle's, a wrench (F, M) about its centre can be made up of forces at the corners where, beside the conditions on
friction and zero-moment point,

    |Y F_x - mu M_x| + |X F_y - mu M_y| - mu (X + Y) F_z <=  M_z
    |Y F_x + mu M_x| + |X F_y + mu M_y| - mu (X + Y) F_z <= -M_z

(S. Caron, Q.-C. Pham, Y. Nakamura, Stability of surface contacts for humanoid robots, ICRA 2015): eight rows, two for
every pair of signs.  The rectangle is one inside the hull of the points that bear the load, and the pyramid one inside
the cone of friction, so that the rows promise too little rather than too much.  Two feet are so far apart that friction
turns the robot as it likes; where more than one stands there are no rows.
"""

from __future__ import annotations

import numpy as np

from gmr_traj.contacts.support import edges

#: Rows of a frame.
COUNT = 8

_SIGNS = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
# Shares of the hull's length that the rectangle may have: all of it fits into another rectangle alone.
_SHARES = (1.0, 0.75, 0.5)


def rectangle(points: np.ndarray, widen: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A rectangle inside the convex hull of points of the floor.

    Args:
        points: at least one.  # (K, 2)
        widen: half the width of what a point or a line can bear [m].

    Returns:
        centre [m]  # (2,), axes, a row each  # (2, 2), half sides along them [m]  # (2,).
    """
    normals, offsets = edges(points, widen)
    centre = points.mean(axis=0)
    _, _, axes = np.linalg.svd(points - centre, full_matrices=True)
    along, across = np.abs(normals @ axes.T).T
    room = normals @ centre - offsets
    longest = float(np.min(room / np.maximum(along, 1e-9)))
    half = []
    for share in _SHARES:
        width = np.min((room - share * longest * along) / np.maximum(across, 1e-9), where=across > 1e-9, initial=np.inf)
        half.append((share * longest, max(0.0, float(width))))
    return centre, axes, np.array(max(half, key=lambda sides: sides[0] * sides[1]))


def rows_about_centre(points: np.ndarray, widen: float, friction: float) -> tuple[np.ndarray, np.ndarray]:
    """The eight rows ``A (F, M) >= 0``, M about the centre of the points.

    Args:
        points: that bear the load.  # (K, 2)
        widen: half the width of what a point or a line can bear [m].
        friction: mu of the cone.

    Returns:
        A  # (8, 6), and the centre [m]  # (2,).
    """
    centre, axes, (x, y) = rectangle(points, widen)
    if np.linalg.det(axes) < 0:
        axes = axes * [[1.0], [-1.0]]
    mu = friction / np.sqrt(2.0)
    turn = np.zeros((3, 3))
    turn[:2, :2], turn[2, 2] = axes, 1.0
    about = np.zeros((COUNT, 6))
    for k, (one, other) in enumerate(_SIGNS):
        for row, sense in ((k, 1.0), (k + len(_SIGNS), -1.0)):
            about[row, :3] = [-one * y, -other * x, mu * (x + y)]
            about[row, 3:] = [sense * one * mu, sense * other * mu, sense]
    return np.hstack([about[:, :3] @ turn, about[:, 3:] @ turn]), centre


def moved(rows: np.ndarray, centre: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """Rows about another point of the floor: about the centre, M is less by (centre - origin) x F.  # (8, 6)

    Args:
        rows: A.  # (8, 6)
        centre: the point they are about [m].  # (2,)
        origin: the other one [m].  # (3,)
    """
    away = np.append(centre, 0.0) - origin
    lever = np.array([[0.0, -away[2], away[1]], [away[2], 0.0, -away[0]], [-away[1], away[0], 0.0]])
    return np.hstack([rows[:, :3] - rows[:, 3:] @ lever, rows[:, 3:]])
