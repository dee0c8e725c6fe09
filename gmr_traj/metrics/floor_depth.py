"""How deep the robot is in the floor, and how far above it."""

from __future__ import annotations

import numpy as np

from gmr_traj.metrics.foot_contact import sole_heights
from gmr_traj.metrics.observation import Observation


def lowest_points(observation: Observation) -> tuple[np.ndarray, tuple[str, ...]]:
    """Height of the lowest point of everything that is known of the robot's surface [m].

    Returns:
        Heights of soles (outline included) and collision shapes  # (T, S + C), and the body of each.
    """
    robot = observation.robot
    parts = [observation.lowest]
    bodies = [capsule.body for capsule in robot.capsules]
    if robot.soles:
        parts.insert(0, sole_heights(observation))
        bodies = [sole.body for sole in robot.soles] + bodies
    return np.concatenate(parts, axis=1), tuple(bodies)
