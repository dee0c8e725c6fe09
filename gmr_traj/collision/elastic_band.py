"""A limb's path over a stretch of frames, drawn tight: near the wanted one, clear of its surroundings, and smooth.

    min_q  sum_t [ phi_t(q_t) + |(q_{t+1} - 2 q_t + q_{t-1}) / dt^2|^2 / ACCELERATION^2 ]

with ``phi_t`` the cost of one configuration (``push_out``).  Gauss-Newton on all frames together; the path stays on
the side of every obstacle that it starts on, because a violated clearance pushes back the way it came.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from gmr_traj.collision.push_out import SMALLEST, STEP, Surroundings, normal_equations, within_range
from gmr_traj.collision.segments import Array

#: Scale of the joints' accelerations [rad/s^2].
ACCELERATION = 25.0

#: Gauss-Newton iterations.
ITERATIONS = 15


def relax(
    around: Surroundings, wanted: Array, path: Array, margin: float, dt: float, pinned: tuple[bool, bool]
) -> Array:
    """The path after some iterations.

    Args:
        around: the surroundings in T frames.
        wanted: angles to stay near [rad].  # (T, k)
        path: angles to start from [rad].  # (T, k)
        margin: clearance to keep [m].
        dt: time between frames [s].
        pinned: whether the first two and the last two frames stay as they are wanted.

    Returns:
        joint angles [rad].  # (T, k)
    """
    frames, size = path.shape
    angles = path.copy()
    fixed = np.zeros(frames, dtype=bool)
    fixed[:2], fixed[frames - 2 :] = pinned
    angles[fixed] = wanted[fixed]
    if frames < 3 or fixed.all():
        return angles
    second = sp.diags([1.0, -2.0, 1.0], [0, 1, 2], shape=(frames - 2, frames))
    smooth = sp.kron(second.T @ second, sp.eye(size), format="csr") / (dt**4 * ACCELERATION**2)
    free = np.flatnonzero(np.repeat(~fixed, size))
    target, _, _ = around.limb.ends(wanted)
    blocks = np.arange(frames + 1)
    for _ in range(ITERATIONS):
        hessian, gradient = normal_equations(around, wanted, target, angles, margin)
        own = sp.bsr_matrix((hessian, blocks[:-1], blocks), shape=smooth.shape)
        total = (own + smooth).tocsc()[free][:, free]
        slope = (gradient.ravel() + smooth @ angles.ravel())[free]
        step = np.zeros(frames * size)
        step[free] = -spsolve(total, slope)
        step *= min(1.0, STEP / max(float(np.abs(step).max()), SMALLEST))
        angles = np.where(fixed[:, None], angles, within_range(around.limb, angles + step.reshape(frames, size)))
    return angles
