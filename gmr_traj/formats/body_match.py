"""Which body is which in a file of body placements without names, and with it the order of its joints.

mjlab writes bodies and joints depth first, BeyondMimic breadth first, under the same keys and shapes.  Forward
kinematics tells them apart: with the right order of joints every body of the robot is found among the file's, to
millimetres.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.exceptions import ClipError
from gmr_traj.formats.tree_order import breadth_first_bodies, breadth_first_joints, moving_bodies
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.robot import Robot

_SAMPLES = 48
_RADIUS = 0.1  # an orientation error of one radian counts like 0.1 m of position
_FOUND = 0.03  # bodies of other descriptions of the same robot are up to 10 mm elsewhere [m]
_APART = 0.01  # a second reading this close to the best one fits as well [m]
_ORDERS = {"mjlab": "depth-first", "beyondmimic": "breadth-first"}


@dataclass(frozen=True)
class BodyMatch:
    """How the bodies and joints of a file correspond to the robot's.

    Attributes:
        format: ``mjlab`` (depth first) or ``beyondmimic`` (breadth first).
        joint_names: the file's joints in its order.  # n
        known: index in the file of each body of the robot that moves against its parent.
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
    joint_names = {"mjlab": robot.joint_names, "beyondmimic": breadth_first_joints(robot)}
    moving = moving_bodies(robot)
    listed = {"mjlab": robot.body_names, "beyondmimic": breadth_first_bodies(robot)}
    body_names = {key: [name for name in bodies if name in moving] for key, bodies in listed.items()}
    readings = []
    for order, base, of_joints in product(orders, range(min(2, positions.shape[1])), _ORDERS):  # the world may be first
        cost = _cost(robot, joint_names[of_joints], joints[every], positions[every], quaternions[every], order, base)
        for of_bodies in _ORDERS:
            rows = [robot.body_names.index(name) for name in body_names[of_bodies]]
            columns, residual = _in_order(cost[rows])
            known = dict(zip(body_names[of_bodies], columns, strict=True))
            readings.append((of_joints, BodyMatch(of_bodies, joint_names[of_joints], known, base, order, residual)))
    of_joints, best = min(readings, key=lambda r: r[1].residual)
    if best.residual > _FOUND:
        raise ClipError(
            f"body_pos_w does not belong to joint_pos: with the joints of {robot.name} depth first or breadth first, a "
            f"body is {best.residual * 1000:.0f} mm from where forward kinematics has it; is it another robot or order?"
        )
    # Where both orders of joints fit (a clip at zero, say), the joints have the order that the bodies have.
    for joints_order, match in sorted(readings, key=lambda r: r[1].residual):
        if joints_order == match.format and match.residual < best.residual + _APART:
            return match
    raise ClipError(
        f"the joints are in {_ORDERS[of_joints]} order but the bodies in {_ORDERS[best.format]} order; trainers expect "
        "one order for both: convert the clip anew from its source"
    )


def _cost(
    robot: Robot,
    joint_names: tuple[str, ...],
    joints: np.ndarray,
    points: np.ndarray,
    quaternions: np.ndarray,
    order: str,
    base: int,
) -> np.ndarray:
    """Median distance of each of the robot's bodies, by forward kinematics, from each of the file's (B, F)."""
    turns = Rotation.from_quat(quaternions.reshape(-1, 4), scalar_first=order == "wxyz").as_matrix()
    turns = turns.reshape(*quaternions.shape[:2], 3, 3)
    qpos = np.zeros((len(joints), 7 + robot.dof))
    qpos[:, :3] = points[:, base]
    qpos[:, 3:7] = quaternions[:, base] if order == "wxyz" else np.roll(quaternions[:, base], 1, axis=-1)
    qpos[:, 7:] = joints[:, [joint_names.index(name) for name in robot.joint_names]]
    positions, rotations = placements(robot, qpos)
    apart = np.linalg.norm(positions[:, :, None] - points[:, None], axis=-1)  # (T, B, F)
    turned = np.linalg.norm(rotations[:, :, None] - turns[:, None], axis=(-2, -1)) / np.sqrt(2.0)
    return np.asarray(np.median(apart + _RADIUS * turned, axis=0))


def _in_order(cost: np.ndarray) -> tuple[list[int], float]:
    """Columns for the rows, increasing from row to row, of the smallest sum of costs; and the largest of these costs.

    Files may list bodies the robot lacks, so columns can be left out:

        best[b, f] = cost[b, f] + min_{g < f} best[b - 1, g]
    """
    rows, columns = cost.shape
    best = np.full((rows, columns), np.inf)
    came = np.zeros((rows, columns), dtype=int)
    best[0] = cost[0]
    for b in range(1, rows):
        smallest = np.minimum.accumulate(best[b - 1])
        is_new = np.concatenate([[True], best[b - 1, 1:] < smallest[:-1]])
        came[b, 1:] = np.maximum.accumulate(np.where(is_new, np.arange(columns), 0))[:-1]
        best[b, 1:] = cost[b, 1:] + smallest[:-1]
    chosen = [int(np.argmin(best[-1]))]
    for b in range(rows - 1, 0, -1):
        chosen.append(int(came[b, chosen[-1]]))
    chosen.reverse()
    return chosen, float(cost[np.arange(rows), chosen].max())
