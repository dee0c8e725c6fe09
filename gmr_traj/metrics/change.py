"""How far one clip is from another, body by body."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from gmr_traj.metrics.observation import Observation
from gmr_traj.robot import Robot


@dataclass(frozen=True)
class BodyChange:
    """Change of one key body over the clip: position [mm] and orientation [deg], mean and maximum over frames."""

    body: str
    position_mean: float
    position_max: float
    orientation_mean: float
    orientation_max: float


@dataclass(frozen=True)
class Change:
    """Change of the key bodies between two clips of one robot.

    Attributes:
        bodies: body by body.
        position: mean over frames and key bodies [mm].
        orientation: mean over frames and key bodies [deg].
        joint_rms: root mean square change of the joints [rad].
    """

    bodies: tuple[BodyChange, ...]
    position: float
    orientation: float
    joint_rms: float

    def to_json(self) -> dict[str, Any]:
        """The change's attributes, ready for ``json.dumps``."""
        return asdict(self)


def change(before: Observation, after: Observation) -> Change:
    """World placements of the key bodies after against before, over the frames both clips have.

    Position ``||p' - p||``; orientation: the angle of ``R^T R'``, computed as ``2 asin(||R' - R||_F / (2 sqrt 2))``,
    which stays exact for small angles.
    """
    robot = after.robot
    frames = min(before.motion.frames, after.motion.frames)
    bodies = [robot.body_names.index(key.body) for key in robot.key_bodies]
    distance = 1e3 * np.linalg.norm(after.positions[:frames, bodies] - before.positions[:frames, bodies], axis=2)
    angle = np.degrees(rotation_angle(before.rotations[:frames, bodies], after.rotations[:frames, bodies]))  # (T, K)
    joints = after.motion.qpos[:frames, 7:] - before.motion.qpos[:frames, 7:]
    return Change(
        bodies=tuple(
            BodyChange(key.body, float(d.mean()), float(d.max()), float(a.mean()), float(a.max()))
            for key, d, a in zip(robot.key_bodies, distance.T, angle.T, strict=True)
        ),
        position=float(distance.mean()),
        orientation=float(angle.mean()),
        joint_rms=float(np.sqrt(np.mean(np.square(joints)))) if joints.size else 0.0,
    )


def upper_body_change(before: Observation, after: Observation) -> tuple[np.ndarray, tuple[str, ...]]:
    """Change of the key bodies that carry no foot, seen from the base [mm].

    ``||R_b'^T (p' - p_b') - R_b^T (p - p_b)||`` with the base's placement (p_b, R_b) before and (p_b', R_b') after.
    Anchoring a foot moves the legs and shifts the base; it is no reason for the rest of the body to do anything else.

    Returns:
        The change in the frames both clips have  # (T, U), and the U bodies.
    """
    robot = after.robot
    frames = min(before.motion.frames, after.motion.frames)
    names = tuple(key.body for key in robot.key_bodies if key.body not in _carries_foot(robot))
    bodies = [robot.body_names.index(name) for name in names]
    moved = _from_base(after, frames, bodies) - _from_base(before, frames, bodies)
    return 1e3 * np.linalg.norm(moved, axis=2), names


def rotation_angle(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Angles between rotation matrices of shape (..., 3, 3) [rad]."""
    chord = np.linalg.norm(second - first, axis=(-2, -1)) / (2.0 * np.sqrt(2.0))
    return 2.0 * np.arcsin(np.minimum(chord, 1.0))


def _from_base(observation: Observation, frames: int, bodies: list[int]) -> np.ndarray:
    """Body origins (T, U, 3) in the axes of the first body, the base [m]."""
    relative = observation.positions[:frames, bodies] - observation.positions[:frames, :1]
    return relative @ observation.rotations[:frames, 0]


def _carries_foot(robot: Robot) -> set[str]:
    """The bodies between the base and the soles, both included."""
    found: set[str] = set()
    for sole in robot.soles:
        body = robot.body_names.index(sole.body) + 1
        while body > 0:
            found.add(robot.body_names[body - 1])
            body = int(robot.model.body_parentid[body])
    return found
