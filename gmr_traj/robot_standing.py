"""The nominal standing configuration: soles on the floor, nothing below it."""

from __future__ import annotations

import mujoco
import numpy as np

from gmr_traj.exceptions import RobotError
from gmr_traj.robot import Capsule
from gmr_traj.robot_toml import RobotFile

# A shape may reach below the sole points by this much when the robot stands [m].
_FLOOR_TOLERANCE = 1e-3


def standing_configuration(file: RobotFile, model: mujoco.MjModel, joints: list[float]) -> np.ndarray:
    """Configuration, ``(7 + n,)``, with an upright base at the origin, so high that the lowest sole point is at z = 0.

    Args:
        file: the robot's figures.
        model: its compiled model.
        joints: joint positions [rad].  # n

    Raises:
        RobotError: a joint position is outside the joint's range.
    """
    for j, value in enumerate(joints, start=1):
        low, high = model.jnt_range[j]
        if not low <= value <= high:
            name = model.joint(j).name
            raise RobotError(f"{file.path}: [nominal] {name} = {value:g} is outside its range {low:g} .. {high:g}")
    q = np.array([0, 0, 0, 1, 0, 0, 0, *joints], dtype=float)
    data = _placed(model, q)
    feet = [(data.body(sole.body), sole.points) for sole in file.soles]
    q[2] = -min(float((foot.xpos[2] + points @ foot.xmat.reshape(3, 3)[2]).min()) for foot, points in feet)
    q.setflags(write=False)
    return q


def check_floor(file: RobotFile, model: mujoco.MjModel, capsules: tuple[Capsule, ...], nominal: np.ndarray) -> None:
    """Check that no shape reaches below the soles when the robot stands: it could never be kept above the floor.

    Raises:
        RobotError: a shape does.
    """
    data = _placed(model, nominal)
    for capsule in capsules:
        body = data.body(capsule.body)
        ends = np.stack([capsule.start, capsule.end]) @ body.xmat.reshape(3, 3)[2] + body.xpos[2]
        depth = capsule.radius - float(ends.min())
        if depth > _FLOOR_TOLERANCE:
            raise RobotError(
                f"{file.path}: shape {capsule.name!r} of body {capsule.body!r} reaches {depth:.3f} m below the sole "
                "points when the robot stands; list [[capsules]] for that body that end at the sole"
            )


def _placed(model: mujoco.MjModel, q: np.ndarray) -> mujoco.MjData:
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_kinematics(model, data)
    return data
