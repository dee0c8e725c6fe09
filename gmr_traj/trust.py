"""How far each frame of a clip can be believed."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter1d

from gmr_traj.motion import RobotMotion

# Joint acceleration that hardly any human motion asks of a robot [rad/s^2]; what lies above is taken for a fault.
PLAUSIBLE_ACCELERATION = 150.0
# A fault spoils the frames around it [s].
REACH = 0.08


def trust(motion: RobotMotion) -> np.ndarray:
    """``1 / (1 + (a / a0 - 1)^2)`` for frames near a joint acceleration a above a0, else 1.  # (T,)"""
    joints = motion.qpos[:, 7:]
    if motion.frames < 3:
        return np.ones(motion.frames)
    acceleration = np.abs(np.diff(joints, 2, axis=0)).max(axis=1) * motion.fps**2
    acceleration = np.concatenate([acceleration[:1], acceleration, acceleration[-1:]])
    excess = np.maximum(0.0, acceleration / PLAUSIBLE_ACCELERATION - 1.0)
    return 1.0 / (1.0 + maximum_filter1d(excess, 2 * max(1, round(REACH * motion.fps)) + 1) ** 2)
