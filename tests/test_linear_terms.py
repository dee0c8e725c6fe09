"""Smoothness, posture and joint limits: linear in the steps, so closed forms and whole matrices can be checked."""

from __future__ import annotations

from math import comb

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from metrics_toy import FPS, clip, standing
from optimiser_setup import context_of, residuals_of, toy, values
from scipy.spatial.transform import Rotation

from gmr_traj.residuals import LinearResidual
from gmr_traj.terms.context import Context, stepped
from gmr_traj.terms.limits import JointAcceleration, JointPosition, JointVelocity
from gmr_traj.terms.posture import Posture
from gmr_traj.terms.smoothness import Acceleration, Jerk, Velocity, difference
from gmr_traj.terms.term import Term

ORDERS = [(Velocity, 1), (Acceleration, 2), (Jerk, 3)]


def linear(term: Term, context: Context) -> list[LinearResidual]:
    found, variables = residuals_of(term, context)
    assert all(isinstance(r, LinearResidual) and r.matrix.shape[1] == variables.size for r in found)
    return found  # type: ignore[return-value]


def wandering(frames: int, seed: int = 0) -> np.ndarray:
    """Smooth configurations of the toy that translate, turn and swing.  # (T, 10)"""
    rng = np.random.default_rng(seed)
    t = np.arange(frames) / FPS
    qpos = standing(frames)
    qpos[:, :3] += 0.2 * np.sin(np.outer(t, rng.uniform(1, 4, 3)) + rng.uniform(0, 6, 3))
    turn = 0.8 * np.sin(np.outer(t, rng.uniform(1, 4, 3)) + rng.uniform(0, 6, 3))
    qpos[:, 3:7] = Rotation.from_rotvec(turn).as_quat(scalar_first=True)
    qpos[:, 7:] = 0.6 * np.sin(np.outer(t, rng.uniform(1, 4, 3)) + rng.uniform(0, 6, 3))
    return qpos


@given(st.integers(1, 12), st.integers(0, 4))
def test_difference_has_binomial_coefficients(frames: int, order: int) -> None:
    d = difference(frames, order).toarray()
    assert d.shape == (max(frames - order, 0), frames)
    for row in range(len(d)):
        stencil = [(-1.0) ** (order - k) * comb(order, k) for k in range(order + 1)]
        np.testing.assert_array_equal(d[row, row : row + order + 1], stencil)
    assert np.count_nonzero(d) == (order + 1) * len(d)


@given(st.integers(4, 10), st.lists(st.floats(-3, 3), min_size=4, max_size=4))
def test_difference_of_polynomials(frames: int, coefficients: list[float]) -> None:
    """D^k t^j is k! for j = k and 0 for j < k."""
    t = np.arange(frames, dtype=float)
    cubic = np.polynomial.Polynomial(coefficients)(t)
    np.testing.assert_allclose(difference(frames, 3) @ cubic, 6 * coefficients[3], atol=1e-9)
    np.testing.assert_allclose(difference(frames, 4) @ cubic, 0.0, atol=1e-9)


@pytest.mark.parametrize(("kind", "order"), ORDERS)
def test_offset_is_the_finite_difference_of_the_motion(kind: type[Term], order: int) -> None:
    """At step zero the rows are the derivatives of the centre motion itself, the rotation's about world axes."""
    motion = clip(wandering(9))
    scales = (2.0, 3.0, 5.0)
    base, turn, joints = linear(kind(*scales), context_of(toy(), motion))
    x = np.zeros(9 * 9)
    rate = FPS**order
    np.testing.assert_allclose(
        values(base, x).reshape(3, -1).T, np.diff(motion.qpos[:, :3], order, axis=0) * rate, atol=1e-8
    )
    np.testing.assert_allclose(
        values(joints, x).reshape(3, -1).T, np.diff(motion.qpos[:, 7:], order, axis=0) * rate, atol=1e-8
    )
    rotation = Rotation.from_quat(motion.qpos[:, 3:7], scalar_first=True)
    velocity = (rotation[1:] * rotation[:-1].inv()).as_rotvec()
    np.testing.assert_allclose(values(turn, x).reshape(3, -1).T, np.diff(velocity, order - 1, axis=0) * rate, atol=1e-8)
    for residual, scale in zip((base, turn, joints), scales, strict=True):
        np.testing.assert_allclose(residual.weights, 1 / FPS / scale**2)


@pytest.mark.parametrize(("kind", "order"), ORDERS)
def test_rows_of_positions_and_joints_are_exact_for_any_step(kind: type[Term], order: int) -> None:
    motion, steps = clip(wandering(8)), np.random.default_rng(1).normal(size=(8, 9))
    after = stepped(motion, steps).qpos
    base, turn, joints = linear(kind(1.0, 1.0, 1.0), context_of(toy(), motion))
    for residual, columns in ((base, slice(0, 3)), (joints, slice(7, 10))):
        expected = np.diff(after[:, columns], order, axis=0) * FPS**order
        np.testing.assert_allclose(values(residual, steps.ravel()).reshape(3, -1).T, expected, atol=1e-6)
    assert turn.rows == ["base roll", "base pitch", "base yaw"] and joints.rows == ["left_hip", "right_hip", "shoulder"]


def test_rotation_rows_are_off_by_half_the_turn_times_the_steps() -> None:
    """The linear rows leave out ``-1/2 w x (v_t + v_{t-1})``, w the turn of a frame; the rest is of second order."""
    motion = clip(wandering(6))
    _, turn, _ = linear(Velocity(1.0, 1.0, 1.0), context_of(toy(), motion))
    rotation = Rotation.from_quat(motion.qpos[:, 3:7], scalar_first=True)
    w = (rotation[1:] * rotation[:-1].inv()).as_rotvec()
    remainder = []
    for size in (1e-2, 1e-3):
        steps = np.zeros((6, 9))
        steps[:, 3:6] = size * np.random.default_rng(2).normal(size=(6, 3))
        after = Rotation.from_quat(stepped(motion, steps).qpos[:, 3:7], scalar_first=True)
        exact = (after[1:] * after[:-1].inv()).as_rotvec()
        rows = values(turn, steps.ravel()).reshape(3, -1).T / FPS
        left_out = -0.5 * np.cross(w, steps[1:, 3:6] + steps[:-1, 3:6])
        remainder.append(np.abs(exact - rows - left_out).max() / size)
    assert remainder[0] < 0.02 and remainder[1] < 0.01  # |w|^2 / 12 times the step, and the step squared


def test_too_short_for_a_derivative_is_no_rows() -> None:
    for kind, order in ORDERS:
        assert linear(kind(1.0, 1.0, 1.0), context_of(toy(), clip(standing(order)))) == []
        assert len(linear(kind(1.0, 1.0, 1.0), context_of(toy(), clip(standing(order + 1))))) == 3


def test_posture_is_the_distance_from_the_target_weighted_with_trust() -> None:
    centre, target, trust = clip(wandering(5)), clip(wandering(5, seed=1)), np.linspace(0.1, 1, 5)
    (residual,) = linear(Posture(joints=0.5), context_of(toy(), centre, target=target, trust=trust))
    steps = np.random.default_rng(3).normal(size=(5, 9))
    expected = stepped(centre, steps).qpos[:, 7:] - target.qpos[:, 7:]
    np.testing.assert_allclose(values(residual, steps.ravel()).reshape(5, 3), expected, atol=1e-12)
    np.testing.assert_allclose(residual.weights.reshape(5, 3), np.tile(trust[:, None] / FPS / 0.25, 3))


def test_positions_are_bounds_on_single_unknowns() -> None:
    robot, motion = toy(), clip(wandering(4))
    (residual,) = linear(JointPosition(margin=0.01), context_of(robot, motion))
    assert (np.diff(residual.matrix.indptr) == 1).all() and residual.matrix.shape == (12, 36)
    np.testing.assert_array_equal(residual.lower.reshape(4, 3), np.tile(robot.position_lower + 0.01, (4, 1)))
    np.testing.assert_array_equal(residual.upper.reshape(4, 3), np.tile(robot.position_upper - 0.01, (4, 1)))
    np.testing.assert_allclose(values(residual, np.zeros(36)).reshape(4, 3), motion.qpos[:, 7:])


def test_a_margin_wider_than_the_range_leaves_its_middle() -> None:
    (residual,) = linear(JointPosition(margin=5.0), context_of(toy(), clip(standing(1))))
    np.testing.assert_array_equal(residual.lower, 0.0)
    np.testing.assert_array_equal(residual.upper, 0.0)


@pytest.mark.parametrize(("kind", "order"), [(JointVelocity, 1), (JointAcceleration, 2)])
def test_rate_rows_are_built_near_the_limit_only(kind: type[JointVelocity], order: int) -> None:
    robot = toy()
    limit = robot.velocity_limit if order == 1 else robot.acceleration_limit
    qpos = standing(60)
    qpos[30:, 9] = 0.7 * limit[2] / FPS**order  # the shoulder alone, 0.7 of its limit once
    (residual,) = linear(kind(factor=0.9, near=0.5), context_of(robot, clip(qpos)))
    built = residual.frames
    assert set(residual.subjects) == {2}
    fault = {29} if order == 1 else {28, 29}
    assert fault <= set(built) and set(built) <= set(range(29 - order - 5, 30 + 6))
    steps = np.random.default_rng(4).normal(size=(60, 9))
    after = np.diff(stepped(clip(qpos), steps).qpos[:, 7:], order, axis=0) * FPS**order
    np.testing.assert_allclose(values(residual, steps.ravel()), after[built, residual.subjects], atol=1e-6)
    np.testing.assert_allclose(residual.upper, 0.9 * limit[2])
    np.testing.assert_allclose(residual.lower, -0.9 * limit[2])


def test_rows_near_any_visited_motion_stay() -> None:
    """A row that an earlier pass needed is built although the centre has calmed down."""
    qpos = standing(60)
    qpos[30:, 9] = 0.5
    calm, once = clip(standing(60)), clip(qpos)
    term = JointVelocity(factor=0.9, near=0.5)
    assert linear(term, context_of(toy(), calm)) == []
    (residual,) = linear(term, context_of(toy(), calm, visited=(once, calm)))
    assert 29 in residual.frames
    np.testing.assert_array_equal(residual.offset, 0.0)
