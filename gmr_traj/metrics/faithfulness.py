"""How far the bodies are from where the scaled person has them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.exceptions import ClipError
from gmr_traj.metrics.change import rotation_angle
from gmr_traj.metrics.observation import Observation
from gmr_traj.references import BodyTargets


@dataclass(frozen=True)
class Distances:
    """Distances of bodies to their targets in every frame, after one turn and one shift of the whole clip.

    Attributes:
        turn: the turn about the vertical that was taken out [rad].
        shift: length of the horizontal shift that was taken out [m].
        bodies: the bodies.  # B
        position: ``||p - p*||`` of the point meant [m].  # (T, B)
        relative: the same, both positions taken from the base's target and from the base [m].  # (T, B)
        orientation: angle of ``R*^T R`` [rad].  # (T, B)
        placed, turned: whether a body has a target position, a target orientation.  # (B,)
    """

    turn: float
    shift: float
    bodies: tuple[str, ...]
    position: np.ndarray
    relative: np.ndarray
    orientation: np.ndarray
    placed: np.ndarray
    turned: np.ndarray


def target_distances(observation: Observation, targets: BodyTargets, bodies: Collection[str]) -> Distances:
    """Distances of the bodies to their targets.

    Retargeters differ in where they put the world's origin and its axes, which is nobody's fault: the whole clip is
    turned about the vertical by one angle and shifted horizontally by one vector, those with the least squared
    distance.  ``relative`` takes out the base's path as well, frame by frame: a clip that walks shorter strides than
    the scaled person is far away at last, but may be faithful step by step.  It needs a target position of the base,
    and is not a number where there is none.  A target whose weight is 0 is none.

    Args:
        observation: the clip.
        targets: as many frames of targets as the clip has.
        bodies: the bodies that count.

    Raises:
        ClipError: the robot has no such body, or there is no target for any of ``bodies``.
    """
    robot = observation.robot
    unknown = [name for name in targets.names if name not in robot.body_names]
    if unknown:
        raise ClipError(f"the targets are for body {unknown[0]!r}, which robot {robot.name} does not have")
    chosen = [i for i, name in enumerate(targets.names) if name in bodies]
    if not chosen:
        raise ClipError(f"none of the targets' bodies ({', '.join(targets.names)}) is moved by all joints compared")
    slots = [robot.body_names.index(targets.names[i]) for i in chosen]
    placed = targets.position_weights[chosen] > 0.0
    rotations = observation.rotations[:, slots]  # (T, B, 3, 3)
    points = targets.of(bodies).reached(robot.body_names, observation.positions, observation.rotations)
    wanted = targets.positions[:, chosen]
    turn, shift = planar_alignment(points[:, placed], wanted[:, placed])
    yaw = Rotation.from_euler("z", turn).as_matrix()
    away = points @ yaw.T + shift - wanted  # (T, B, 3)
    base = next((k for k, i in enumerate(chosen) if placed[k] and targets.names[i] == robot.body_names[0]), None)
    root = away[:, [base]] if base is not None else np.full((len(away), 1, 3), np.nan)
    desired = Rotation.from_quat(targets.quaternions[:, chosen].reshape(-1, 4), scalar_first=True).as_matrix()
    return Distances(
        turn=turn,
        shift=float(np.linalg.norm(shift)),
        bodies=tuple(targets.names[i] for i in chosen),
        position=np.linalg.norm(away, axis=2),
        relative=np.linalg.norm(away - root, axis=2),
        orientation=rotation_angle(desired.reshape(rotations.shape), yaw @ rotations),
        placed=placed,
        turned=targets.orientation_weights[chosen] > 0.0,
    )


def planar_alignment(points: np.ndarray, wanted: np.ndarray) -> tuple[float, np.ndarray]:
    """The turn about the vertical and the horizontal shift that bring points closest to where they should be.

        minimise  sum ||turn(p) + shift - p*||^2;    turn = arg(sum conj(p - mean p) (p* - mean p*)), as complex numbers

    Args:
        points: p [m].  # (T, B, 3)
        wanted: p*.  # (T, B, 3)

    Returns:
        The angle [rad] and the shift, whose z is 0 [m].  # (3,)
    """
    if not points.size:
        return 0.0, np.zeros(3)
    p, q = (a[..., 0].ravel() + 1j * a[..., 1].ravel() for a in (points, wanted))
    turn = float(np.angle(((p - p.mean()).conj() * (q - q.mean())).sum()))
    shift = complex(q.mean() - np.exp(1j * turn) * p.mean())
    return turn, np.array([shift.real, shift.imag, 0.0])
