"""Balance by the whole dynamics: where the contact wrench would have to act, and where the forces do act."""

from __future__ import annotations

import numpy as np

from gmr_traj.constants import GRAVITY
from gmr_traj.metrics.balance import hull_margin
from gmr_traj.verify.contact_points import ContactPoints
from gmr_traj.verify.inverse_dynamics import Demand

LEAST_LIFT = 0.3  # of gravity; a robot that presses less than this on the floor has no zero-moment point to speak of


def zero_moment_point(needed: Demand, origins: np.ndarray, mass: float) -> np.ndarray:
    """Point of the floor about which the wrench the motion needs has no horizontal moment [m].  # (T, 2)

        M_0 = M + o x F,    ZMP = (-M_0y, M_0x) / F_z

    The angular momentum of the limbs is in it, which a point mass leaves out.  Not a number where F_z is below 0.3 m g.

    Args:
        needed: F and M, the latter about the base's origin o.
        origins: o.  # (T, 3)
        mass: of the robot [kg].
    """
    F = needed.force
    about = needed.moment + np.cross(origins, F)
    pressed = F[:, 2] > LEAST_LIFT * mass * GRAVITY
    lift = np.where(pressed, F[:, 2], np.nan)
    return np.stack([-about[:, 1] / lift, about[:, 0] / lift], axis=1)


def margins(zmp: np.ndarray, points: ContactPoints) -> np.ndarray:
    """Signed distance of the zero-moment point to the border of the hull of the able points, positive inside [m].

    Not a number where there is no zero-moment point, or no three able points off one line.  # (T,)
    """
    out = np.full(len(zmp), np.nan)
    for t in np.flatnonzero(np.isfinite(zmp).all(axis=1) & (points.able.sum(axis=1) >= 3)):
        out[t] = hull_margin(points.positions[t, points.able[t], :2], zmp[t])
    return out


def pressure_distances(forces: np.ndarray, points: ContactPoints, centre: np.ndarray) -> np.ndarray:
    """Horizontal distance of the centre of mass from the centre of pressure ``sum f_z p / sum f_z`` [m].  # (T,)

    Args:
        forces: contact forces [N].  # (T, K, 3)
        points: where they act.
        centre: centre of mass [m].  # (T, 3)

    Returns:
        The distance; not a number where nothing presses.
    """
    vertical = forces[..., 2]
    total = vertical.sum(axis=1)
    pressed = total > 1e-6
    weight = np.where(pressed, total, np.nan)
    centre_of_pressure = np.einsum("tk,tki->ti", vertical, points.positions[..., :2]) / weight[:, None]
    return np.asarray(np.linalg.norm(centre[:, :2] - centre_of_pressure, axis=1))
