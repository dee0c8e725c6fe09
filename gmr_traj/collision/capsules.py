"""Where the capsules of a robot are."""

from __future__ import annotations

import numpy as np

from gmr_traj.collision.segments import Array
from gmr_traj.robot import Robot


def world_segments(robot: Robot, positions: Array, rotations: Array) -> tuple[Array, Array]:
    """End points of all capsules in the world: ``p_world = x_body + R_body p_body``.

    Args:
        robot: its capsules are used in their order.
        positions: origins of ``robot.body_names`` in the world [m].  # (T, B, 3)
        rotations: their orientations in the world.  # (T, B, 3, 3)

    Returns:
        starts and ends [m].  # (T, C, 3), (T, C, 3)
    """
    of_body = {name: index for index, name in enumerate(robot.body_names)}
    bodies = [of_body[capsule.body] for capsule in robot.capsules]
    # Contiguous per capsule, because the distances are taken a pair at a time over many frames.
    starts = np.empty((len(bodies), len(positions), 3))
    ends = np.empty_like(starts)
    for c, (capsule, body) in enumerate(zip(robot.capsules, bodies, strict=True)):
        starts[c] = positions[:, body] + rotations[:, body] @ capsule.start
        ends[c] = positions[:, body] + rotations[:, body] @ capsule.end
    return starts.transpose(1, 0, 2), ends.transpose(1, 0, 2)


def radii(robot: Robot) -> Array:
    """Radii of all capsules [m], shape (C,)."""
    return np.array([capsule.radius for capsule in robot.capsules])
