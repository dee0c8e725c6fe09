"""A robot on hands and knees: clips made by inverse kinematics, with the faults that retargeting leaves in them."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from gmr_traj.kinematics.mujoco_kinematics import body_id
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot

FPS = 30.0
HANDS, KNEES, FEET = ("left_hand", "right_hand"), ("left_knee", "right_knee"), ("left_foot", "right_foot")
_TOE = np.array([0.131, 0.0, -0.015])  # centre of the ball at the tip of the G1's foot
_TOE_RADIUS = 0.02
_POSTURE = {
    "hip_pitch": -1.3,
    "knee": 1.6,
    "ankle_pitch": 0.4,
    "shoulder_pitch": -1.4,
    "elbow": 1.4,
}
# Weights of a contact, of the base's place and of each joint's angle in the least squares.
_CONTACT, _BASE, _JOINT = 100.0, 3.0, 0.3
# Standard deviation of the shaking [m].
_SHAKE = 0.004


@dataclass(frozen=True)
class Ball:
    """What touches the floor: a ball about a point of a body."""

    body: str
    point: np.ndarray
    radius: float


def balls(robot: Robot) -> dict[str, Ball]:
    """The finger tips, the knees and the tips of the feet of the G1."""
    out = {}
    for support in robot.supports:
        if support.name in HANDS + KNEES:
            # Of a hand the ball that is farthest out, of a shin the one at the knee.
            k = int(np.argmax(support.points[:, 0]) if support.name in HANDS else np.argmax(support.points[:, 2]))
            out[support.name] = Ball(support.bodies[k], support.points[k], float(support.radii[k]))
    for sole in robot.soles:
        out[f"{sole.name}_foot"] = Ball(sole.body, _TOE, _TOE_RADIUS)
    return out


def on_all_fours(robot: Robot, frames: int, rng: np.random.Generator | None = None, step: bool = True) -> RobotMotion:
    """The robot rocks on hands and knees, 6 cm to and fro and 3 cm up and down; its left hand takes a step forward.

    Args:
        robot: the G1.
        frames: how many, at 30 fps.
        rng: with it hands hover, sink and slide over three centimetres while they rest, knees over one and a half, and
            the whole robot shakes by a few millimetres.
        step: whether the hand takes its step, in the middle fifth of the clip.
    """
    touching = balls(robot)
    q = robot.nominal.copy()
    q[2], q[3:7] = 0.4, [np.cos(0.65), 0.0, np.sin(0.65), 0.0]  # leant forward by 75 degrees
    for name, value in _POSTURE.items():
        for side in ("left", "right"):
            q[7 + robot.joint_names.index(f"{side}_{name}_joint")] = value
    places = _at_rest(robot, touching, q)
    q = _reach(robot, touching, q, q, places, rounds=60)
    paths = np.repeat(np.stack([places[name] for name in touching])[None], frames, axis=0)  # (T, B, 3)
    names = list(touching)
    t = np.arange(frames) / FPS
    if step:
        first, last = int(0.4 * frames), int(0.6 * frames)
        share = np.clip((np.arange(frames) - first) / (last - first), 0.0, 1.0)
        paths[:, names.index("left_hand"), 0] += 0.1 * (share - np.sin(2 * np.pi * share) / (2 * np.pi))
        paths[:, names.index("left_hand"), 2] += 0.08 * np.sin(np.pi * share) ** 2
    if rng is not None:
        for name in HANDS + KNEES:
            far = 0.015 if name in HANDS else 0.008
            for axis in range(3):
                pace, phase = rng.uniform(1.0, 3.0), rng.uniform(0.0, 6.0)
                paths[:, names.index(name), axis] += far * np.sin(pace * t + phase)
    shake = np.zeros((frames, 3)) if rng is None else rng.normal(0.0, _SHAKE, (frames, 3))
    out: list[np.ndarray] = []
    middle = q.copy()
    for k in range(frames):
        aim = middle.copy()
        aim[0] += 0.06 * np.sin(np.pi * t[k])
        aim[2] += 0.03 * np.sin(2.0 * np.pi * t[k])
        aim[:3] += shake[k]
        q = _reach(robot, touching, q, aim, dict(zip(names, paths[k], strict=True)), rounds=8)
        out.append(q)
    return RobotMotion(np.stack(out), FPS, robot.joint_names, robot.name)


def _at_rest(robot: Robot, touching: dict[str, Ball], q: np.ndarray) -> dict[str, np.ndarray]:
    """Where the balls of a configuration are when they are put down on the floor below [m]."""
    data = mujoco.MjData(robot.model)
    data.qpos[:] = q
    mujoco.mj_kinematics(robot.model, data)
    out = {}
    for name, ball in touching.items():
        body = data.body(ball.body)
        out[name] = body.xpos + body.xmat.reshape(3, 3) @ ball.point
        out[name][2] = ball.radius
    return out


def _reach(
    robot: Robot,
    touching: dict[str, Ball],
    start: np.ndarray,
    aim: np.ndarray,
    places: dict[str, np.ndarray],
    rounds: int,
) -> np.ndarray:
    """Gauss-Newton steps from ``start`` to where the balls are at their places, near the configuration ``aim``."""
    model, data, q = robot.model, mujoco.MjData(robot.model), start.copy()
    jacobian = np.zeros((3, model.nv))
    for _ in range(rounds):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        rows, errors = [], []
        for name, ball in touching.items():
            body = data.body(ball.body)
            at = body.xpos + body.xmat.reshape(3, 3) @ ball.point
            mujoco.mj_jac(model, data, jacobian, None, at, body_id(robot, ball.body))
            rows.append(_CONTACT * jacobian)
            errors.append(_CONTACT * (places[name] - at))
        away = np.zeros(model.nv)
        mujoco.mj_differentiatePos(model, away, 1.0, q, aim)
        weight = np.concatenate([np.full(6, _BASE), np.full(model.nv - 6, _JOINT)])
        rows.append(np.diag(weight))
        errors.append(weight * away)
        step = np.linalg.lstsq(np.vstack(rows), np.concatenate(errors), rcond=None)[0]
        mujoco.mj_integratePos(model, q, np.clip(step, -0.3, 0.3), 1.0)
        q[7:] = np.clip(q[7:], robot.position_lower + 0.02, robot.position_upper - 0.02)
    return q
