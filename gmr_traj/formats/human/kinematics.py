"""Forward kinematics of a human skeleton, all frames at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gmr_traj.quaternions import product, rotated


def world_placements(
    parents: Sequence[int], translations: np.ndarray, rotations: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """World placements of joints from their placements in their parents.

    ``p_j = p_i + R_i t_j``, ``R_j = R_i S_j``, with ``i`` the parent of ``j``.

    Args:
        parents: index of each joint's parent, -1 for none; parents come first.  # (J,)
        translations: joint positions ``t`` in the parents' frames.  # (T, J, 3) or (J, 3)
        rotations: joint orientations ``S`` in the parents' frames, wxyz.  # (T, J, 4)

    Returns:
        Positions and unit quaternions wxyz, in the world.  # (T, J, 3), (T, J, 4)
    """
    local = np.ascontiguousarray(rotations.transpose(1, 2, 0))  # (J, 4, T)
    local /= np.linalg.norm(local, axis=1, keepdims=True)
    offsets = np.broadcast_to(translations, (*rotations.shape[:2], 3)).transpose(1, 2, 0)  # (J, 3, T)
    positions, quaternions = np.empty(offsets.shape), np.empty(local.shape)
    for j, parent in enumerate(parents):
        if parent < 0:
            positions[j], quaternions[j] = offsets[j], local[j]
        else:
            positions[j] = positions[parent] + rotated(quaternions[parent], offsets[j])
            quaternions[j] = product(quaternions[parent], local[j])
    return np.ascontiguousarray(positions.transpose(2, 0, 1)), np.ascontiguousarray(quaternions.transpose(2, 0, 1))
