"""Inverse kinematics of the legs: the feet have to be where they have to be, and the base as high as that allows.

    minimise over the legs' joints q_l and the base's height z
        sum_f |p_f - p*_f|^2 + ARM^2 |log(R*_f R_f')|^2 + WISH^2 (z - z*)^2 + KEEP^2 |q_l - q_l*|^2,    z <= z*

Clips stand with straight knees; a base that is too high for both feet comes down rather than lifting one.  It does not
rise, not even where an ankle at its limit would turn its foot further by that: straight knees may bend either way next.
The joints that were given, q_l*, say which way is theirs.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from gmr_traj.lead.feet import Foot, FootPath
from gmr_traj.robot import Robot

ARM = 0.2  # [m/rad]
WISH = 0.03  # [-]
KEEP = 1e-3  # [m/rad]
# Levenberg-Marquardt: steps at most, the change of the sum of squares at which it is done, damping to begin with.
STEPS = 30
DONE = 1e-12
DAMPING = 1e-4


# Where a foot has to be in one frame: the foot, its pivot [m]  # (3,), its orientation  # (3, 3).
_Target = tuple[Foot, np.ndarray, np.ndarray]


@dataclass(frozen=True)
class _Legs:
    """The unknowns: the base's height, then the joints between base and feet.

    Attributes:
        robot: the robot.
        data: room for its kinematics.
        columns: of the unknowns in qpos.
        rates: of the unknowns in MuJoCo's tangent vector.
        lower, upper: their bounds.
    """

    robot: Robot
    data: mujoco.MjData
    columns: np.ndarray
    rates: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


def bend_legs(robot: Robot, qpos: np.ndarray, feet: tuple[Foot, ...], paths: tuple[FootPath, ...]) -> np.ndarray:
    """Configurations with the feet on their paths.

    Each frame starts from the frame before, moved as the joints given move, and stays near the joints given.

    Args:
        robot: the robot.
        qpos: configurations; bases are as high as they may be.  # (T, 7 + n)
        feet: the feet.
        paths: where each should be.

    Returns:
        The configurations.  # (T, 7 + n)
    """
    out = qpos.copy()
    joints = sorted({j for foot in feet for j in _chain(robot, foot.slot + 1)})
    legs = _Legs(
        robot=robot,
        data=mujoco.MjData(robot.model),
        columns=np.array([2, *(7 + j for j in joints)]),
        rates=np.array([2, *(6 + j for j in joints)]),
        lower=np.array([-np.inf, *robot.position_lower[joints]]),
        upper=np.array([np.inf, *robot.position_upper[joints]]),
    )
    for t in range(len(qpos)):
        if t:
            moved = legs.columns[1:]
            out[t, moved] = out[t - 1, moved] + qpos[t, moved] - qpos[t - 1, moved]
        legs.upper[0] = qpos[t, 2]
        out[t, 2] = min(out[t, 2], qpos[t, 2])
        both = zip(feet, paths, strict=True)
        _bend(
            legs, out[t], qpos[t, legs.columns], [(foot, path.at[t], path.turned[t].as_matrix()) for foot, path in both]
        )
    return out


def leg_length(robot: Robot, foot: Foot) -> float:
    """How far a foot's body can be from the base with a straight leg: the sum of the links between them [m]."""
    model, body, length = robot.model, foot.slot + 1, 0.0
    while body > 1:
        length += float(np.linalg.norm(model.body_pos[body]))
        body = int(model.body_parentid[body])
    return length


def _bend(legs: _Legs, q: np.ndarray, wanted: np.ndarray, targets: list[_Target]) -> None:
    """Levenberg-Marquardt in one frame, in place; ``wanted`` are z* and q_l*."""
    scale = np.array([WISH, *[KEEP] * (len(wanted) - 1)])
    q[legs.columns], damping = np.clip(q[legs.columns], legs.lower, legs.upper), DAMPING
    residual, jacobian = _feet_off(legs, q, targets)
    cost = float(residual @ residual)
    for _ in range(STEPS):
        away = scale * (q[legs.columns] - wanted)
        rows, values = np.concatenate([jacobian, np.diag(scale)]), np.concatenate([residual, away])
        before = q[legs.columns].copy()
        # Joints at a bound that would go beyond it stay, and the others are solved for without them.
        slope = rows.T @ values
        free = ~(((before <= legs.lower) & (slope > 0.0)) | ((before >= legs.upper) & (slope < 0.0)))
        step, rows = np.zeros(len(scale)), rows[:, free]
        step[free] = np.linalg.solve(rows.T @ rows + damping * np.eye(rows.shape[1]), -slope[free])
        q[legs.columns] = np.clip(before + step, legs.lower, legs.upper)
        residual_new, jacobian_new = _feet_off(legs, q, targets)
        drift = scale * (q[legs.columns] - wanted)
        better = float(residual_new @ residual_new + drift @ drift)
        if better >= cost:
            q[legs.columns], damping = before, 10.0 * damping
            if damping > 1e4:
                return
            continue
        gain, cost, damping = cost - better, better, 0.1 * damping
        residual, jacobian = residual_new, jacobian_new
        if gain < DONE:
            return


def _feet_off(legs: _Legs, q: np.ndarray, targets: list[_Target]) -> tuple[np.ndarray, np.ndarray]:
    """How far the feet are from their targets, and its derivative by the unknowns.  # (6 F,), (6 F, m)"""
    model, data = legs.robot.model, legs.data
    data.qpos[:] = q
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    linear, angular = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    residuals, jacobians = [], []
    for foot, at, turned in targets:
        body = foot.slot + 1
        rotation = data.xmat[body].reshape(3, 3)
        here = data.xpos[body] + rotation @ foot.pivot
        mujoco.mj_jac(model, data, linear, angular, here, body)
        residuals += [here - at, ARM * _turn(rotation @ turned.T)]
        jacobians += [linear[:, legs.rates], ARM * angular[:, legs.rates]]
    return np.concatenate(residuals), np.concatenate(jacobians)


def _turn(rotation: np.ndarray) -> np.ndarray:
    """Rotation vector of a matrix."""
    quaternion, out = np.empty(4), np.empty(3)
    mujoco.mju_mat2Quat(quaternion, rotation.ravel())
    mujoco.mju_quat2Vel(out, quaternion, 1.0)
    return out


def _chain(robot: Robot, body: int) -> list[int]:
    """Indices of the joints between the base and a body."""
    model, joints = robot.model, []
    while body > 1:
        if model.body_jntnum[body]:
            joints.append(int(model.body_jntadr[body]) - 1)
        body = int(model.body_parentid[body])
    return joints
