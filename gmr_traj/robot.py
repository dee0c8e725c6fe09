"""What gmr-traj knows about a robot: one compiled model and the figures beside it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np


@dataclass(frozen=True)
class KeyBody:
    """A body whose placement describes the motion (tracked by the problem, reported by the certificate).

    Attributes:
        body: name of the body in the model.
        position_weight, orientation_weight: relative importance in tracking, 1 is typical.
    """

    body: str
    position_weight: float = 1.0
    orientation_weight: float = 1.0


@dataclass(frozen=True)
class Sole:
    """The flat underside of a foot.

    Attributes:
        name: e.g. ``left``.
        body: body the points belong to.
        points: contact points in the body's frame [m], all in one plane.  # (K, 3)
        parts: for each point the part of the sole it belongs to (``heel`` or ``toe``).  # K
        outline: further points that must stay above the floor but carry no stance [m].  # (M, 3)
    """

    name: str
    body: str
    points: np.ndarray
    parts: tuple[str, ...]
    outline: np.ndarray


@dataclass(frozen=True)
class Capsule:
    """A collision shape: all points within ``radius`` of a segment; a sphere where start equals end.

    ``start`` and ``end`` are in the frame of ``body`` [m].
    """

    name: str
    body: str
    start: np.ndarray
    end: np.ndarray
    radius: float


@dataclass(frozen=True)
class BodySupport:
    """A part of the robot other than a foot that may rest on the floor: a hand, a knee, the hips.

    What touches the floor are the round ends of its collision shapes: a ball of radius r, whose centre is r above the
    floor however the part is turned.

    Attributes:
        name: e.g. ``left_hand``.
        shapes: the collision shapes.
        bodies: the body of each ball.  # K
        points: the balls' centres in their bodies' frames [m].  # (K, 3)
        radii: of the balls [m].  # (K,)
    """

    name: str
    shapes: tuple[str, ...]
    bodies: tuple[str, ...]
    points: np.ndarray
    radii: np.ndarray


@dataclass(frozen=True)
class Robot:
    """A humanoid: a free-floating base and n hinge joints, one joint a body.

    Joint arrays have the order of ``joint_names``, which is the order of the model's ``qpos[7:]``.

    Attributes:
        name: e.g. ``unitree_g1``.
        path: the robot.toml this was read from.
        model: the compiled MuJoCo model (free joint first, then hinges only).
        joint_names, body_names: hinges and bodies (without the world), in the model's order.
        position_lower, position_upper: joint ranges [rad].  # (n,)
        velocity_limit: largest joint speed [rad/s].  # (n,)
        acceleration_limit: largest joint acceleration [rad/s^2].  # (n,)
        effort_limit: largest joint torque [N m].  # (n,)
        stiffness, damping: PD gains [N m/rad], [N m s/rad].  # (n,)
        nominal: a natural standing configuration.  # (7 + n,)
        anchor_body: the body by which tracking is judged (the torso).
        key_bodies: bodies that describe the motion.
        soles: undersides of the feet.
        capsules: collision shapes.
        collision_pairs: pairs of indices into ``capsules`` that must not overlap.
        supports: what else may rest on the floor.
    """

    name: str
    path: Path
    model: mujoco.MjModel
    joint_names: tuple[str, ...]
    body_names: tuple[str, ...]
    position_lower: np.ndarray
    position_upper: np.ndarray
    velocity_limit: np.ndarray
    acceleration_limit: np.ndarray
    effort_limit: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    nominal: np.ndarray
    anchor_body: str
    key_bodies: tuple[KeyBody, ...]
    soles: tuple[Sole, ...]
    capsules: tuple[Capsule, ...]
    collision_pairs: tuple[tuple[int, int], ...]
    supports: tuple[BodySupport, ...] = ()

    @property
    def dof(self) -> int:
        """Number of hinge joints n; the tangent space has 6 + n dimensions."""
        return len(self.joint_names)
