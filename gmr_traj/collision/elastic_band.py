"""A limb's path over a stretch of frames, drawn tight: near the wanted one, clear of its surroundings, and smooth.

    min_q  sum_t [ phi_t(q_t) + |(q_{t+1} - 2 q_t + q_{t-1}) / dt^2|^2 / ACCELERATION^2 ]

with ``phi_t`` the cost of one configuration (``push_out``).  Levenberg-Marquardt on all frames together.  Its steps
are short and lower the cost every time, so the path stays on the side of every obstacle that it starts on.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from gmr_traj.collision.push_out import (
    EASE,
    FIRST_DAMPING,
    SMALLEST,
    STEP,
    STIFFEN,
    Surroundings,
    normal_equations,
    within_range,
)
from gmr_traj.collision.segments import Array

#: Scale of the joints' accelerations [rad/s^2].
ACCELERATION = 25.0

#: Iterations at most, and the relative decrease of the cost at which they end.
ITERATIONS, PROGRESS = 30, 1e-3


def relax(around: Surroundings, wanted: Array, path: Array, margin: float, dt: float, fixed: np.ndarray) -> Array:
    """The path after some iterations.

    Args:
        around: the surroundings in T frames.
        wanted: angles to stay near [rad].  # (T, k)
        path: angles to start from [rad].  # (T, k)
        margin: clearance to keep [m].
        dt: time between frames [s].
        fixed: which frames are as wanted and stay so.  # (T,)

    Returns:
        joint angles [rad].  # (T, k)
    """
    frames, size = path.shape
    angles = np.where(fixed[:, None], wanted, path)
    if frames < 3 or fixed.all():
        return angles
    second = sp.diags([1.0, -2.0, 1.0], [0, 1, 2], shape=(frames - 2, frames))
    smooth = sp.kron(second.T @ second, sp.eye(size), format="csr") / (dt**4 * ACCELERATION**2)
    free = np.flatnonzero(np.repeat(~fixed, size))
    target, _, _ = around.limb.ends(wanted)
    blocks = np.arange(frames + 1)

    def model(path: Array) -> tuple[float, sp.csc_matrix, Array]:
        value, hessian, gradient = normal_equations(around, wanted, target, path, margin)
        own = sp.bsr_matrix((hessian, blocks[:-1], blocks), shape=smooth.shape)
        bent = smooth @ path.ravel()
        total = float(value.sum() + 0.5 * path.ravel() @ bent)
        return total, (own + smooth).tocsc()[free][:, free], (gradient.ravel() + bent)[free]

    value, hessian, gradient = model(angles)
    damping = FIRST_DAMPING
    for _ in range(ITERATIONS):
        step = np.zeros(frames * size)
        step[free] = -spsolve(hessian + damping * sp.eye(free.size, format="csc"), gradient)
        step *= min(1.0, STEP / max(float(np.abs(step).max()), SMALLEST))
        tried = np.where(fixed[:, None], angles, within_range(around.limb, angles + step.reshape(frames, size)))
        new = model(tried)
        if new[0] < value:
            small = value - new[0] < PROGRESS * value
            angles, (value, hessian, gradient) = tried, new
            damping *= EASE
            if small:
                break
        else:
            damping *= STIFFEN
    return angles
