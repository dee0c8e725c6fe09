"""Where the floor may press on the robot: sole corners, and the ends of its other collision shapes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gmr_traj.metrics.observation import Observation
from gmr_traj.metrics.settings import Settings
from gmr_traj.verify.derivatives import point_velocities


@dataclass(frozen=True)
class ContactPoints:
    """Points of the robot that the floor could press on.

    Attributes:
        bodies: index of each point's body into ``robot.body_names``.  # K
        positions: world positions [m].  # (T, K, 3)
        able: whether each point is near enough to the floor and slow enough to carry a force.  # (T, K)
    """

    bodies: np.ndarray
    positions: np.ndarray
    able: np.ndarray


def contact_points(observation: Observation, bars: Settings, table: str = "contact") -> ContactPoints:
    """Points of a clip near the floor, and whether they may carry a force.

    Candidates are the contact points of the soles, and the lowest points of both ends of every capsule of the other
    bodies (hands, knees, ...).  A point is able to carry a force while its height is below ``near`` and the speed of
    the material there is below ``slow``; points that never come near are left out.  How deep a point
    is in the floor makes no difference here: that is a matter of geometry, which the audit reports beside the forces.

    Args:
        observation: the clip.
        bars: ``configs/verify_audit.toml``.
        table: which of its tables says what is near and slow.
    """
    robot, fps = observation.robot, observation.motion.fps
    index = {name: i for i, name in enumerate(robot.body_names)}
    near, slow = bars(table, "near"), bars(table, "slow")
    bodies: list[int] = []
    positions: list[np.ndarray] = []
    speeds: list[np.ndarray] = []
    for sole, points in zip(robot.soles, observation.soles, strict=True):
        bodies += [index[sole.body]] * len(sole.points)
        positions += list(points.transpose(1, 0, 2))
        speeds += list(np.linalg.norm(point_velocities(points, fps), axis=2).T)
    feet = {sole.body for sole in robot.soles}
    for capsule in (c for c in robot.capsules if c.body not in feet):
        b = index[capsule.body]
        R, origin = observation.rotations[:, b], observation.positions[:, b]
        ends = (capsule.start,) if np.array_equal(capsule.start, capsule.end) else (capsule.start, capsule.end)
        for end in ends:
            point = origin + R @ end - [0.0, 0.0, capsule.radius]
            if point[:, 2].min() < near:
                bodies.append(b)
                positions.append(point)
                speeds.append(_material_speed(origin, R, point, fps))
    stacked = np.stack(positions, axis=1)
    able = (stacked[..., 2] < near) & (np.stack(speeds, axis=1) < slow)
    return ContactPoints(np.array(bodies), stacked, able)


def _material_speed(origin: np.ndarray, R: np.ndarray, point: np.ndarray, fps: float) -> np.ndarray:
    """Speed of the material of a body that is at ``point`` in each frame [m/s].  # (T,)

    The lowest point of a rolling capsule is at rest although the capsule moves: what is differenced is the point of the
    body, ``x = R[t]' (p[t] - o[t])``, between the frames before and after.
    """
    last = len(point) - 1
    if last == 0:
        return np.zeros(1)
    own = np.einsum("tji,tj->ti", R, point - origin)
    t = np.arange(last + 1)
    before, after = np.maximum(t - 1, 0), np.minimum(t + 1, last)
    moved = origin[after] + np.einsum("tij,tj->ti", R[after], own) - origin[before]
    moved -= np.einsum("tij,tj->ti", R[before], own)
    return np.asarray(np.linalg.norm(moved, axis=1) * fps / (after - before))
