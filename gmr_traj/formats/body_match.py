"""Which body is which in a file of body placements without names, and with it the order of its joints.

mjlab writes bodies and joints depth first, BeyondMimic breadth first, under the same keys and shapes.  Forward
kinematics tells them apart: with the right order of joints every body of the robot is found among the file's, to
millimetres.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.exceptions import ClipError
from gmr_traj.formats.tree_order import breadth_first_bodies, breadth_first_joints
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.robot import Robot

_SAMPLES = 48
_RADIUS = 0.1  # an orientation error of one radian counts like 0.1 m of position
_FOUND = 0.03  # bodies of other descriptions of the same robot are up to 10 mm elsewhere [m]
_WORDS = {"mjlab": "depth-first", "beyondmimic": "breadth-first"}
_APART = 0.01  # a second reading this close to the best one leaves the order of joints open [m]


@dataclass(frozen=True)
class BodyMatch:
    """How the bodies and joints of a file correspond to the robot's.

    Attributes:
        format: ``mjlab`` (depth first) or ``beyondmimic`` (breadth first).
        joint_names: the file's joints in its order.  # n
        known: index in the file of each body of the robot.
        base: index in the file of the base.
        order: order of the file's quaternions, ``wxyz`` or ``xyzw``.
        residual: largest median distance of a body of the robot from the file's [m].
    """

    format: str
    joint_names: tuple[str, ...]
    known: dict[str, int]
    base: int
    order: str
    residual: float


def match_bodies(
    robot: Robot, joints: np.ndarray, positions: np.ndarray, quaternions: np.ndarray, orders: tuple[str, ...]
) -> BodyMatch:
    """Find the order of bodies, joints and quaternion components that forward kinematics confirms.

    Args:
        robot: robot with as many joints as the file.
        joints: joint positions [rad] in the file's order.  # (T, n)
        positions: origins of the file's bodies in the world [m].  # (T, F, 3)
        quaternions: their unit quaternions, in one of ``orders``.  # (T, F, 4)
        orders: quaternion orders to try.

    Raises:
        ClipError: no reading fits, or the file mixes the two orders.
    """
    every = np.unique(np.linspace(0, len(joints) - 1, _SAMPLES).astype(int))
    points = positions[every]
    readings = [
        _read(robot, names, joints[every], points, quaternions[every], order, base)
        for order in orders
        for base in range(min(2, points.shape[1]))  # some files list the world first
        for names in dict.fromkeys((robot.joint_names, breadth_first_joints(robot)))
    ]
    best = min(readings, key=lambda r: r.residual)
    if best.residual > _FOUND:
        raise ClipError(
            f"body_pos_w does not belong to joint_pos: with the joints of {robot.name} depth first or breadth first, a "
            f"body is {best.residual * 1000:.0f} mm from where forward kinematics has it; is it another robot or order?"
        )
    # Where both orders of joints fit (a clip at zero, say), the joints are read in the order the bodies have.
    order = _order_of_bodies(robot, best)
    fitting = [
        r
        for r in readings
        if r.residual < best.residual + _APART
        and (r.order, r.base) == (best.order, best.base)
        and _order_of_joints(robot, r) == order
    ]
    if not fitting:
        raise ClipError(
            f"the joints are in {_WORDS[_order_of_joints(robot, best)]} order but the bodies in {_WORDS[order]} order; "
            "trainers expect one order for both: convert the clip anew from its source"
        )
    reading = fitting[0]
    return BodyMatch(order, reading.joint_names, reading.known, reading.base, reading.order, reading.residual)


@dataclass(frozen=True)
class _Reading:
    joint_names: tuple[str, ...]
    order: str
    base: int
    known: dict[str, int]
    residual: float


def _read(
    robot: Robot,
    joint_names: tuple[str, ...],
    joints: np.ndarray,
    points: np.ndarray,
    quaternions: np.ndarray,
    order: str,
    base: int,
) -> _Reading:
    """Forward kinematics under one reading, each body of the robot given to the file's body it is nearest to."""
    turns = Rotation.from_quat(quaternions.reshape(-1, 4), scalar_first=order == "wxyz").as_matrix()
    turns = turns.reshape(*quaternions.shape[:2], 3, 3)
    qpos = np.zeros((len(joints), 7 + robot.dof))
    qpos[:, :3] = points[:, base]
    qpos[:, 3:7] = quaternions[:, base] if order == "wxyz" else np.roll(quaternions[:, base], 1, axis=-1)
    qpos[:, 7:] = joints[:, [joint_names.index(name) for name in robot.joint_names]]
    positions, rotations = placements(robot, qpos)
    apart = np.linalg.norm(positions[:, :, None] - points[:, None], axis=-1)  # (T, B, F)
    turned = np.linalg.norm(rotations[:, :, None] - turns[:, None], axis=(-2, -1)) / np.sqrt(2.0)
    cost = np.median(apart + _RADIUS * turned, axis=0)  # (B, F)
    nearest = cost.argmin(axis=1)
    known = {name: int(f) for name, f in zip(robot.body_names, nearest, strict=True)}
    return _Reading(joint_names, order, base, known, float(cost.min(axis=1).max()))


def _order_of_bodies(robot: Robot, reading: _Reading) -> str:
    for name, bodies in (("mjlab", robot.body_names), ("beyondmimic", breadth_first_bodies(robot))):
        if all(reading.known[a] < reading.known[b] for a, b in pairwise(bodies)):
            return name
    raise ClipError("the file's bodies are neither in depth-first nor in breadth-first order")


def _order_of_joints(robot: Robot, reading: _Reading) -> str:
    return "mjlab" if reading.joint_names == robot.joint_names else "beyondmimic"
