"""The composite-inertia cost against explicit Jacobians, finite differences and closed forms."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from conftest import random_configurations
from hypothesis import given
from hypothesis import strategies as st
from optimiser_setup import derivative, toy
from scipy.spatial.transform import Rotation

from gmr_traj.kinematics.casadi_kinematics import CasadiKinematics
from gmr_traj.robot import Robot
from gmr_traj.terms.composite import CompositeCost

ROBUST = 0.2
POINT = np.array([0.1, -0.05, 0.2])


@pytest.fixture(params=["toy", "g1", "talos"])
def robot(request: pytest.FixtureRequest) -> Robot:
    if request.param == "toy":
        return toy()
    found: Robot = request.getfixturevalue(request.param)
    return found


class Case:
    """A cost on some bodies of a robot, at a configuration, with the parts its Hessian is made of."""

    def __init__(self, robot: Robot, seed: int) -> None:
        rng = np.random.default_rng(seed)
        size, kinematics = 6 + robot.dof, CasadiKinematics(robot)
        v, q = ca.SX.sym("v", size), random_configurations(robot, 1, seed)[0]
        placements = kinematics.placements(v, q)
        cost = CompositeCost(kinematics, v, placements)
        # Leaves, the base, a body in the middle; not all have both targets, and one has two points.
        bodies = [0, 1, len(robot.body_names) // 2, len(robot.body_names) - 1]
        self.at = rng.uniform(-0.5, 0.5, size)
        rows, self.weights = [], []
        for slot in [*bodies, bodies[-1]]:
            point = placements.positions[slot] + placements.rotations[slot] @ ca.DM(POINT * (slot % 3))
            target, weight = rng.uniform(-1, 1, 3) + q[:3], float(rng.uniform(0.5, 2))
            cost.add_point(slot, point, target, weight, ROBUST)
            error = point - target
            rows.append(ca.jacobian(error, v))
            self.weights.append(weight / ca.sqrt(1 + ca.sumsqr(error) / ROBUST**2))
        for slot in bodies[1:]:
            target, weight = Rotation.random(rng=rng).as_matrix(), float(rng.uniform(0.5, 2))
            cost.add_rotation(slot, target, weight)
            rows.append(self.spin(placements.rotations[slot], v))
            self.weights.append(ca.SX(weight))
        gradient, hessian = cost.derivatives()
        explicit = sum((w * j.T @ j for w, j in zip(self.weights, rows, strict=True)), ca.SX(0))
        self.parts = ca.Function("parts", [v], [cost.value, gradient, hessian, explicit], {"cse": True})

    @staticmethod
    def spin(rotation: ca.SX, v: ca.SX) -> ca.SX:
        """World angular velocity Jacobian of a rotation that depends on v, by differentiating it.  # (3, nv)"""
        columns = []
        by_v = ca.jacobian(ca.vec(rotation), v)
        for k in range(v.numel()):
            change = ca.reshape(by_v[:, k], 3, 3) @ rotation.T
            columns.append(ca.vertcat(change[2, 1], change[0, 2], change[1, 0]))
        return ca.horzcat(*columns)


def full(upper: ca.DM) -> np.ndarray:
    matrix = np.array(ca.densify(upper))
    return np.triu(matrix) + np.triu(matrix, 1).T


def test_hessian_is_the_sum_of_weighted_jacobian_products(robot: Robot) -> None:
    case = Case(robot, seed=3)
    for at in (np.zeros(6 + robot.dof), case.at):
        _, _, hessian, explicit = case.parts(at)
        assert np.array_equal(np.array(ca.densify(hessian)), np.triu(np.array(ca.densify(hessian))))
        np.testing.assert_allclose(full(hessian), np.array(explicit), atol=1e-9)
        assert np.linalg.eigvalsh(full(hessian)).min() > -1e-9


def test_gradient_is_the_derivative_of_the_value(robot: Robot) -> None:
    case = Case(robot, seed=4)
    for at in (np.zeros(6 + robot.dof), case.at):
        numeric = derivative(lambda x: np.array(case.parts(x)[0]).ravel(), at)[0]
        np.testing.assert_allclose(np.array(case.parts(at)[1]).ravel(), numeric, atol=1e-7)


@given(st.floats(0.0, np.pi), st.integers(0, 100))
def test_rotation_cost_is_one_minus_the_cosine_of_the_angle(angle: float, seed: int) -> None:
    axis = np.random.default_rng(seed).normal(size=3)
    target = Rotation.random(rng=seed)
    turned = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)) * target
    value = float(ROTATION_COST(turned.as_quat(scalar_first=True), target.as_matrix()))
    assert value == pytest.approx(3.0 * (1 - np.cos(angle)), abs=1e-9)


@given(st.tuples(*[st.floats(-2, 2)] * 3), st.tuples(*[st.floats(-2, 2)] * 3))
def test_pseudo_huber_is_majorised_by_its_model(here: tuple[float, ...], there: tuple[float, ...]) -> None:
    """phi(y) <= phi(x) + g'(y - x) + 1/2 (y - x)' H (y - x) for every move of the base: steps never undershoot."""
    value, gradient, hessian = POINT_COST(np.concatenate([here, np.zeros(6)]))
    move = np.array(there) - np.array(here)
    model = float(value) + np.array(gradient)[:3, 0] @ move + 0.5 * move @ full(hessian)[:3, :3] @ move
    assert float(POINT_COST(np.concatenate([there, np.zeros(6)]))[0]) <= model + 1e-9


def test_pseudo_huber_is_quadratic_near_and_linear_far() -> None:
    for error, expected in ((1e-3 * ROBUST, 0.5e-6 * ROBUST**2), (1e3 * ROBUST, ROBUST**2 * (1e3 - 1))):
        value = float(POINT_COST(np.array([error, 0, 0, 0, 0, 0, 0, 0, 0]))[0])
        assert value == pytest.approx(expected, rel=1e-3)


def _point_cost() -> ca.Function:
    """The toy's base wanted where it is, with weight 1, as a function of the step."""
    robot = toy()
    kinematics, v = CasadiKinematics(robot), ca.SX.sym("v", 9)
    placements = kinematics.placements(v, robot.nominal)
    cost = CompositeCost(kinematics, v, placements)
    cost.add_point(0, placements.positions[0], robot.nominal[:3], 1.0, ROBUST)
    return ca.Function("cost", [v], [cost.value, *cost.derivatives()])


def _rotation_cost() -> ca.Function:
    """The toy's base wanted at a rotation, with weight 3, as a function of its quaternion and that rotation."""
    kinematics, v = CasadiKinematics(toy()), ca.SX.zeros(9)
    quaternion, target = ca.SX.sym("q", 4), ca.SX.sym("R", 3, 3)
    cost = CompositeCost(kinematics, v, kinematics.placements(v, ca.vertcat(0, 0, 1, quaternion, 0, 0, 0)))
    cost.add_rotation(0, target, 3.0)
    return ca.Function("cost", [quaternion, target], [cost.value])


POINT_COST, ROTATION_COST = _point_cost(), _rotation_cost()
