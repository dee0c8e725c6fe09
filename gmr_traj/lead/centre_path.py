"""The centre of mass on its way from rest into the clip, by preview of where the floor has to press.

    minimise over c   sum_t |c'''_t|^2 / JERK^2 + |z_t - r_t|^2 / OFF^2,    z = c - (h / (g + h'')) c''

with c the horizontal place of the centre of mass, h its height, z the zero-moment point and r_t where the feet on the
floor would have it.  Derivatives are differences of the frames; the first three frames are at rest and the last three
the clip's, so it is a linear least-squares problem.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gmr_traj.constants import GRAVITY
from gmr_traj.lead.arrival import Moving

# Jerk that costs as much as a zero-moment point that is ``OFF`` from where it should be.
JERK = 20.0  # [m/s^3]
OFF = 0.02  # [m]


@dataclass(frozen=True)
class CentrePath:
    """A way of the centre of mass.

    Attributes:
        at: its horizontal place in frames 0 .. N, N the clip's first [m].  # (N + 1, 2)
        cost: mean of the squares above over the frames [-].
    """

    at: np.ndarray
    cost: float


def centre_path(start: np.ndarray, end: Moving, height: np.ndarray, pressed: np.ndarray, fps: float) -> CentrePath:
    """The best way.

    Args:
        start: where it rests [m].  # (2,)
        end: of the clip's first frame, horizontal [m].  # (2,)
        height: of the centre of mass in frames 0 .. N + 2 [m].  # (N + 3,)
        pressed: r in frames 0 .. N [m].  # (N + 1, 2)
        fps: frames per second.
    """
    last, dt = len(pressed) - 1, 1.0 / fps
    after = np.arange(3)[:, None] * dt
    known = np.concatenate(
        [np.tile(start, (3, 1)), end.value + after * end.velocity + 0.5 * after**2 * end.acceleration]
    )
    columns = np.concatenate([[0, 1, 2], last + np.arange(3)])
    free = np.arange(3, last)
    count = last + 3
    second = np.zeros((last, count))  # of frames 1 .. N
    rows = np.arange(last)
    for k, weight in enumerate((1.0, -2.0, 1.0)):
        second[rows, rows + k] = weight / dt**2
    third = np.zeros((last, count))
    for k, weight in enumerate((-1.0, 3.0, -3.0, 1.0)):
        third[rows, rows + k] = weight / dt**3
    lift = np.maximum(GRAVITY + second @ height, 0.3 * GRAVITY)
    moment = -(height[1 : last + 1] / lift)[:, None] * second
    moment[rows, rows + 1] += 1.0
    matrix = np.concatenate([third / JERK, moment / OFF])
    wanted = np.concatenate([np.zeros((last, 2)), pressed[1:] / OFF]) - matrix[:, columns] @ known
    found = np.linalg.lstsq(matrix[:, free], wanted, rcond=None)[0]
    at = np.zeros((count, 2))
    at[columns], at[free] = known, found
    residual = matrix[:, free] @ found - wanted
    return CentrePath(at[: last + 1], float(np.mean(np.square(residual))))
