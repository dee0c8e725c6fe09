"""How a foot stands that shares the load with hands or knees: on the tip of its toes, as steeply as the clip has it.

What touches the floor then is the round end of a collision shape, ahead of the contact points of the sole and of the
tip of its outline.  These may be as high as they are in the clip above the foot's own lowest point: the foot comes down
to the floor, however high the clip has it, and is not made flat.
"""

from __future__ import annotations

import numpy as np

from gmr_traj.contacts.mask import limbs_to_mask
from gmr_traj.kinematics.mujoco_kinematics import body_points, lowest_points
from gmr_traj.robot import Sole
from gmr_traj.terms.context import Context


def overhang(context: Context, sole: Sole, points: np.ndarray, resting: np.ndarray) -> np.ndarray:
    """Heights of points of a foot above its lowest point in the target [m].  # (T, m)

    Zero in frames in which no limb but feet is in stance, or the foot stands on more than one part of its sole.

    Args:
        context: motions and schedule.
        sole: of the foot.
        points: in its body's frame [m].  # (m, 3)
        resting: which of the sole's contact points are in stance.  # (T, K) bool
    """
    parts = np.array(sole.parts)
    standing = sum(resting[:, parts == part].any(axis=1).astype(int) for part in dict.fromkeys(sole.parts))
    steep = limbs_to_mask(context.schedule, context.robot).any(axis=1) & (standing == 1)
    out = np.zeros((context.frames, len(points)))
    if not steep.any():
        return out
    positions, rotations = context.target_placements
    placed, slot = (positions[steep], rotations[steep]), context.robot.body_names.index(sole.body)
    lowest = body_points(placed, slot, np.vstack([sole.points, sole.outline]))[..., 2].min(axis=1)
    for capsule in (c for c in context.robot.capsules if c.body == sole.body):
        lowest = np.minimum(lowest, lowest_points(placed, slot, capsule))
    out[steep] = body_points(placed, slot, points)[..., 2] - lowest[:, None]
    return out
