"""Forward kinematics of a human skeleton, all frames at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation


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
    shape = rotations.shape[:2]
    translations = np.array(np.broadcast_to(translations, (*shape, 3)))
    positions = np.empty((*shape, 3))
    turned: list[Rotation] = []
    for j, parent in enumerate(parents):
        turn = Rotation.from_quat(rotations[:, j], scalar_first=True)
        if parent < 0:
            positions[:, j] = translations[:, j]
            turned.append(turn)
        else:
            positions[:, j] = positions[:, parent] + turned[parent].apply(translations[:, j])
            turned.append(turned[parent] * turn)
    return positions, np.stack([turn.as_quat(scalar_first=True) for turn in turned], axis=1)
