"""Tracking: its value from MuJoCo's placements, its derivatives by finite differences, trust, robustness."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import random_configurations
from metrics_toy import clip, standing
from optimiser_setup import context_of, derivative, residuals_of, toy

from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.motion import RobotMotion
from gmr_traj.residuals import FrameResidual
from gmr_traj.robot import Robot
from gmr_traj.terms.context import Context, stepped
from gmr_traj.terms.tracking import Tracking

TERM = Tracking(position=0.03, orientation=0.2, robust=0.05)


def tracking(context: Context) -> FrameResidual:
    found, _ = residuals_of(TERM, context)
    assert len(found) == 1 and isinstance(found[0], FrameResidual) and found[0].gauss_newton is not None
    return found[0]


def motions(robot: Robot, frames: int, seed: int) -> tuple[RobotMotion, RobotMotion]:
    return tuple(
        RobotMotion(random_configurations(robot, frames, s), 50.0, robot.joint_names) for s in (seed, seed + 1)
    )  # type: ignore[return-value]


def expected_value(context: Context, motion: RobotMotion) -> np.ndarray:
    """The formula of the term, in numbers.  # (T,)"""
    robot = context.robot
    p, r = placements(robot, motion.qpos)
    target_p, target_r = placements(robot, context.target.qpos)
    out = np.zeros(motion.frames)
    for key in robot.key_bodies:
        b = robot.body_names.index(key.body)
        error = np.linalg.norm(p[:, b] - target_p[:, b], axis=1)
        huber = TERM.robust**2 * (np.sqrt(1 + error**2 / TERM.robust**2) - 1)
        away = 3 - np.einsum("tij,tij->t", r[:, b], target_r[:, b])
        out += key.position_weight * huber / TERM.position**2
        out += key.orientation_weight * away / (2 * TERM.orientation**2)
    return context.trust * out * context.dt


@pytest.mark.parametrize("name", ["toy", "g1"])
def test_value_and_derivatives(request: pytest.FixtureRequest, name: str) -> None:
    robot = toy() if name == "toy" else request.getfixturevalue(name)
    centre, target = motions(robot, 2, seed=20)
    context = context_of(robot, centre, target=target, trust=np.array([0.3, 1.0]))
    residual = tracking(context)
    functions = residual.gauss_newton
    assert functions is not None
    steps = np.random.default_rng(0).uniform(-0.3, 0.3, (2, 6 + robot.dof))
    expected = expected_value(context, stepped(centre, steps))
    for t, p in enumerate(residual.parameters.T):
        value = lambda z, p=p: np.array(functions.value(z, p)).ravel()  # noqa: E731
        assert value(steps[t])[0] == pytest.approx(expected[t], rel=1e-9)
        gradient = np.array(functions.gradient(steps[t], p)).ravel()
        numeric = derivative(value, steps[t])[0]
        np.testing.assert_allclose(gradient, numeric, atol=1e-5 * max(1.0, np.abs(numeric).max()))
        upper = np.array(functions.hessian(steps[t], p).full())
        assert np.linalg.eigvalsh(np.triu(upper) + np.triu(upper, 1).T).min() > -1e-6


def test_at_the_target_the_hessian_is_exact() -> None:
    """Where the residual vanishes Gauss-Newton is Newton: the Hessian is the derivative of the gradient."""
    robot = toy()
    centre, _ = motions(robot, 1, seed=22)
    residual = tracking(context_of(robot, centre))
    functions, p = residual.gauss_newton, residual.parameters[:, 0]
    assert functions is not None
    zero = np.zeros(9)
    upper = functions.hessian(zero, p).full()
    numeric = derivative(lambda z: np.array(functions.gradient(z, p)).ravel(), zero)
    assert float(functions.value(zero, p)) == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(np.triu(upper) + np.triu(upper, 1).T, numeric, atol=1e-4 * np.abs(numeric).max())


def test_a_spike_pulls_no_harder_than_where_the_pull_stops_growing() -> None:
    """Ten times as far off is nearly the same force on the base: the input is the suspect, too."""
    robot = toy()
    forces = []
    for metres in (0.01, 0.5, 5.0):
        away = standing(1)
        away[:, 0] += metres
        residual = tracking(context_of(robot, clip(standing(1)), target=clip(away)))
        assert residual.gauss_newton is not None
        gradient = residual.gauss_newton.gradient(np.zeros(9), residual.parameters[:, 0])
        forces.append(abs(float(gradient[0])))
    assert forces[0] < 0.3 * forces[1]
    assert forces[2] == pytest.approx(forces[1], rel=0.01)
