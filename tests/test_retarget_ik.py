"""One step of inverse kinematics: errors, their derivatives, and the program, against mink and differences."""

from __future__ import annotations

from functools import cache

import casadi as ca
import mink
import mujoco
import numpy as np
import pytest
from conftest import random_configurations
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from gmr_traj.exceptions import RobotError, SolverError
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.retarget.body_map import load_map
from gmr_traj.retarget.frame_error import coupling, twist, way_between
from gmr_traj.retarget.inverse_kinematics import InverseKinematics
from gmr_traj.robot import Robot

COUNT = 5
ANGLES = (1e-6, 1e-3, 0.049, 0.051, 1.0, 3.1)  # both sides of where the series take over, and nearly half a turn


def errors_between(angle: float, seed: int) -> tuple[Rotation, np.ndarray, Rotation, np.ndarray]:
    """Bodies, and targets that are turned by ``angle`` from them."""
    rng = np.random.default_rng(seed)
    body = Rotation.random(COUNT, random_state=seed)
    axes = rng.normal(size=(COUNT, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return body, rng.normal(size=(COUNT, 3)), body * Rotation.from_rotvec(angle * axes), rng.normal(size=(COUNT, 3))


@cache
def function() -> ca.Function:
    """(body's quaternion, target's, way from body to target) -> (error, its derivative by (v, o)), in world axes."""
    body, target, d = ca.SX.sym("b", 4), ca.SX.sym("t", 4), ca.SX.sym("d", 3)
    found = twist(way_between(body, target), d)
    A = found.inverse_jacobian
    by_v, by_o = ca.vertcat(-A, ca.SX(3, 3)), ca.vertcat(coupling(found), -A)
    return ca.Function("twist", [body, target, d], [ca.vertcat(found.linear, found.w), ca.horzcat(by_v, by_o)])


def in_world(body: Rotation, p: np.ndarray, target: Rotation, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Errors  # (B, 6) and their derivatives  # (B, 6, 6) in the axes of the world."""
    columns = (body.as_quat(scalar_first=True).T, target.as_quat(scalar_first=True).T, (at - p).T)
    errors, slopes = (np.array(found) for found in function().map(COUNT)(*columns))
    return errors.T, slopes.reshape(6, COUNT, 6).transpose(1, 0, 2)


def in_body(body: Rotation, p: np.ndarray, target: Rotation, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same in the axes of the bodies, those of the velocities included."""
    errors, slopes = in_world(body, p, target, at)
    turns = np.zeros((COUNT, 6, 6))
    turns[:, :3, :3] = turns[:, 3:, 3:] = body.inv().as_matrix()
    return (turns @ errors[:, :, None])[:, :, 0], turns @ slopes @ turns.transpose(0, 2, 1)


@pytest.mark.parametrize("angle", ANGLES)
def test_errors_and_derivatives_are_minks(angle: float):
    body, p, target, at = errors_between(angle, 1)
    errors, slopes = in_body(body, p, target, at)
    for b in range(COUNT):
        T_body = mink.SE3(np.concatenate([body[b].as_quat(scalar_first=True), p[b]]))
        T_target = mink.SE3(np.concatenate([target[b].as_quat(scalar_first=True), at[b]]))
        np.testing.assert_allclose(errors[b], T_target.rminus(T_body), atol=1e-12)
        if angle > 1e-3:  # mink drops the first-order term of the coupling below that
            np.testing.assert_allclose(slopes[b], -(T_target.inverse() @ T_body).jlog(), atol=1e-11)


@pytest.mark.parametrize("angle", ANGLES)
def test_derivatives_are_those_of_the_errors(angle: float):
    body, p, target, at = errors_between(angle, 2)
    _, slopes = in_body(body, p, target, at)
    step = 1e-6
    for k in range(6):
        moved = []
        for sign in (step, -step):
            v, o = np.zeros(3), np.zeros(3)
            (v if k < 3 else o)[k % 3] = sign
            # To first order the body twist (v, o) moves the body by R v and turns it by exp(o).
            moved.append(in_body(body * Rotation.from_rotvec(o), p + body.apply(v), target, at)[0])
        np.testing.assert_allclose(slopes[:, :, k], (moved[0] - moved[1]) / (2 * step), atol=2e-8)


@given(st.integers(0, 10_000), st.floats(0.0, np.pi - 1e-3))
def test_the_error_is_the_twist_that_leads_to_the_target(seed: int, angle: float):
    body, p, target, at = errors_between(angle, seed)
    for b, e in enumerate(in_body(body, p, target, at)[0]):
        generator = np.zeros((4, 4))
        generator[:3, :3], generator[:3, 3] = np.cross(np.eye(3), e[3:]), e[:3]
        T = expm(generator)
        np.testing.assert_allclose(p[b] + body[b].apply(T[:3, 3]), at[b], atol=1e-9)
        assert (body[b] * Rotation.from_matrix(T[:3, :3]) * target[b].inv()).magnitude() < 1e-7


def test_errors_take_the_shorter_way_whatever_the_quaternions_sign():
    body, target = Rotation.random(COUNT, random_state=3), Rotation.random(COUNT, random_state=4)
    b, t = (turn.as_quat(scalar_first=True).T for turn in (body, target))
    for sign in (1.0, -1.0):
        errors = np.array(function().map(COUNT)(b, sign * t, np.zeros((3, COUNT)))[0])
        np.testing.assert_allclose(errors[3:].T, (target * body.inv()).as_rotvec(), atol=1e-12)


@given(st.integers(0, 10_000))
def test_the_way_between_is_the_product_of_quaternions(seed: int):
    body, target = (Rotation.random(random_state=seed + k) for k in (0, 1))
    way = way_between(*(ca.DM(turn.as_quat(scalar_first=True)) for turn in (body, target)))
    found = Rotation.from_quat(np.array(way)[:, 0], scalar_first=True)
    assert ((target * body.inv()) * found.inv()).magnitude() < 1e-12


@pytest.fixture(scope="module")
def problem(g1: Robot):
    """Inverse kinematics of the LAFAN1 map's bodies with targets nearby, and the costs of the second stage."""
    body_map = load_map("lafan1_to_unitree_g1", g1)
    rng = np.random.default_rng(0)
    points = rng.normal(scale=0.1, size=(len(body_map.bodies), 3))
    ik = InverseKinematics(g1, body_map.bodies, points, [body_map.costs(2)], damping=0.5, lm_damping=1.0)
    turned = Rotation.random(len(points), random_state=1).as_quat(scalar_first=True)
    ik.aim(rng.normal(size=points.shape), turned)
    return ik, np.square(body_map.costs(2)), random_configurations(g1, 1, 7)[0]


def test_the_gradient_is_that_of_half_the_weighted_squares(problem, g1: Robot):
    ik, weights, q = problem
    ik.place(q)
    gradient = ik.objective(0)[1].copy()

    def cost(v: np.ndarray) -> float:
        moved = q.copy()
        mujoco.mj_integratePos(g1.model, moved, v, 1.0)
        ik.place(moved)
        return 0.5 * float((weights * ik.squares).sum())

    steps = 1e-6 * np.eye(g1.model.nv)
    numeric = [(cost(step) - cost(-step)) / 2e-6 for step in steps]
    np.testing.assert_allclose(gradient, numeric, atol=1e-6 * np.abs(gradient).max())


@pytest.mark.parametrize("stage", [1, 2])
def test_the_program_and_the_step_are_minks(g1: Robot, stage: int):
    body_map = load_map("lafan1_to_unitree_g1", g1)
    costs, bodies = body_map.costs(stage), body_map.bodies
    ik = InverseKinematics(g1, bodies, body_map.points, [costs], damping=0.5, lm_damping=1.0)
    limit = mink.ConfigurationLimit(g1.model)
    tasks = [mink.FrameTask(body, "body", *cost, lm_damping=1.0) for body, cost in zip(bodies, costs, strict=True)]
    rng = np.random.default_rng(3)
    for q in random_configurations(g1, 8, 11):
        positions = rng.normal(scale=0.2, size=(len(bodies), 3)) + q[:3]
        quaternions = Rotation.random(len(bodies), random_state=2).as_quat(scalar_first=True)
        ik.aim(positions, quaternions)
        configuration = mink.Configuration(g1.model)
        configuration.update(q)
        for task, p, o in zip(tasks, positions, quaternions, strict=True):
            task.set_target(mink.SE3(np.concatenate([o, p])))
        program = mink.build_ik(configuration, tasks, 0.002, 0.5, limits=[limit])
        ik.place(q)
        H, gradient = ik.objective(0)
        np.testing.assert_allclose(H, program.P, atol=1e-10 * np.abs(H).max())
        np.testing.assert_allclose(gradient, program.q, atol=1e-10 * np.abs(gradient).max())
        lower, upper = np.full(35, -1e30), np.full(35, 1e30)
        lower[6:], upper[6:] = 0.95 * (g1.position_lower - q[7:]), 0.95 * (g1.position_upper - q[7:])
        velocity = mink.solve_ik(configuration, tasks, 0.002, "daqp", 0.5, limits=[limit])
        configuration.integrate_inplace(velocity, 0.002)
        np.testing.assert_allclose(ik.step(0, lower, upper), configuration.q, atol=1e-9)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", ["g1", "talos"])
def test_the_hessian_is_that_of_differences(name: str, seed: int, request: pytest.FixtureRequest):
    """Bodies that share a joint, the base, points off the origin, costs of which some are zero."""
    robot: Robot = request.getfixturevalue(name)
    rng = np.random.default_rng(seed)
    bodies = [robot.body_names[0], *rng.choice(robot.body_names[1:], 7, replace=False)]
    costs = rng.choice([0.0, 1.0, 3.0, 10.0], size=(8, 2))
    points = rng.normal(scale=0.2, size=(8, 3))
    ik = InverseKinematics(robot, bodies, points, [costs], damping=0.3, lm_damping=0.2)
    q = random_configurations(robot, 1, seed)[0]
    turned = Rotation.random(8, random_state=seed).as_quat(scalar_first=True)
    ik.aim(q[:3] + rng.normal(size=(8, 3)), turned)

    def seen_from_bodies(v: np.ndarray) -> np.ndarray:
        moved = q.copy()
        mujoco.mj_integratePos(robot.model, moved, v, 1.0)
        ik.place(moved)
        _, rotations = placements(robot, moved[None])
        turns = rotations[0, [robot.body_names.index(body) for body in bodies]].transpose(0, 2, 1)
        return (turns[:, None] @ ik.errors.reshape(8, 2, 3, 1)).ravel()

    steps = 1e-6 * np.eye(robot.model.nv)
    J = np.stack([(seen_from_bodies(step) - seen_from_bodies(-step)) / 2e-6 for step in steps], axis=1)
    W = np.repeat(costs, 3, axis=1).ravel()
    weighted = W * seen_from_bodies(np.zeros(robot.model.nv))
    expected = (W[:, None] * J).T @ (W[:, None] * J) + (0.3 + 0.2 * weighted @ weighted) * np.eye(robot.model.nv)
    H, gradient = ik.objective(0)
    np.testing.assert_allclose(H, expected, atol=1e-7 * np.abs(expected).max())
    slope = (W[:, None] * J).T @ weighted
    np.testing.assert_allclose(gradient, slope, atol=1e-7 * np.abs(slope).max())
    idle = ~np.any(J, axis=0)  # components that move none of the bodies
    assert not H[idle][:, ~idle].any()


def test_a_step_keeps_its_bounds(problem):
    ik, _, q = problem
    narrow = np.full(35, 0.01)
    ik.place(q)
    after = ik.step(0, -narrow, narrow)
    moved = np.abs(after[7:] - q[7:])
    assert moved.max() <= 0.01 + 1e-9
    assert (moved > 0.0099).any()  # some joint would go farther


def test_bounds_that_contradict_each_other_are_an_error(problem):
    ik, _, q = problem
    ik.place(q)
    with pytest.raises(SolverError, match="not solved"):
        ik.step(0, np.full(35, 1.0), np.full(35, -1.0))


def test_an_unknown_body_is_an_error(g1: Robot):
    with pytest.raises(RobotError, match="no body 'tail'"):
        InverseKinematics(g1, ["tail"], np.zeros((1, 3)), [np.ones((1, 2))], damping=1.0, lm_damping=0.0)
