from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gmr_traj.collision import segments
from gmr_traj.collision.segments_casadi import (
    clearance,
    clearance_function,
    clearance_jacobian,
)

COORDINATE = st.integers(-3, 3).map(lambda k: k / 4) | st.floats(-1, 1)
POINT = st.tuples(COORDINATE, COORDINATE, COORDINATE).map(np.array)
RA, RB = 0.05, 0.08

POINTS = ca.SX.sym("points", 12)
A0, A1, B0, B1 = ca.vertsplit(POINTS, 3)
BY_AD = ca.Function(
    "by_ad",
    [POINTS],
    [clearance(A0, A1, RA, B0, B1, RB), ca.jacobian(clearance(A0, A1, RA, B0, B1, RB), POINTS)],
)
BY_ENVELOPE = ca.Function("by_envelope", [POINTS], [*clearance_jacobian(POINTS, A0, A1, RA, B0, B1, RB)])


def exact(points: np.ndarray) -> float:
    return float(segments.distance(*points.reshape(4, 3))[0]) - RA - RB


@given(st.tuples(POINT, POINT, POINT, POINT))
def test_value_is_exact_and_derivative_finite(points: tuple[np.ndarray, ...]) -> None:
    x = np.concatenate(points)
    for function in (BY_AD, BY_ENVELOPE):
        value, jacobian = function(x)
        assert float(value) == pytest.approx(exact(x), abs=1e-6)
        assert np.isfinite(np.array(jacobian)).all()
    # A clearance changes by no more than its end points move.
    of_a = np.array(BY_ENVELOPE(x)[1]).reshape(4, 3)
    assert np.linalg.norm(of_a, axis=1).max() <= 1 + 1e-9
    np.testing.assert_allclose(of_a.sum(axis=0), 0.0, atol=1e-9)


def test_derivative_against_finite_differences() -> None:
    rng = np.random.default_rng(0)
    checked = 0
    for x in rng.normal(size=(60, 12)) * 0.3:
        numeric = np.array([(exact(x + h) - exact(x - h)) / 2e-6 for h in 1e-6 * np.eye(12)])
        if exact(x) + RA + RB < 0.01:  # next to the kink where the axes cross
            continue
        checked += 1
        for function in (BY_AD, BY_ENVELOPE):
            np.testing.assert_allclose(np.array(function(x)[1]).ravel(), numeric, atol=2e-6)
    assert checked > 40


def test_jacobian_of_moving_points() -> None:
    angle, shift = ca.SX.sym("angle"), ca.SX.sym("shift", 3)
    x = ca.vertcat(angle, shift)
    rotation = ca.vertcat(
        ca.horzcat(ca.cos(angle), -ca.sin(angle), 0), ca.horzcat(ca.sin(angle), ca.cos(angle), 0), ca.DM([[0, 0, 1]])
    )
    a0, a1 = rotation @ ca.DM([0.1, 0.3, 0.2]) + shift, rotation @ ca.DM([0.6, -0.1, 0.3]) + shift
    b0, b1 = ca.SX(ca.DM([0.0, 0.0, -0.5])), ca.SX(ca.DM([0.1, 0.0, 0.4]))
    value, jacobian = clearance_jacobian(x, a0, a1, RA, b0, b1, RB)
    function = ca.Function("moving", [x], [value, jacobian])
    at = np.array([0.3, 0.2, -0.1, 0.05])
    numeric = [float(function(at + h)[0] - function(at - h)[0]) / 2e-6 for h in 1e-6 * np.eye(4)]
    np.testing.assert_allclose(np.array(function(at)[1]).ravel(), numeric, atol=1e-6)


def test_crossing_axes_have_a_direction_that_separates() -> None:
    x = np.array([-1, 0, 0, 1, 0, 0, 0, -1, 0, 0, 1, 0]) * 0.2
    value, jacobian = BY_ENVELOPE(x)
    gradient = np.array(jacobian).reshape(4, 3)
    push = gradient[0] + gradient[1]  # derivative with respect to a translation of A
    assert float(value) == pytest.approx(-RA - RB, abs=1e-8)
    assert np.linalg.norm(push) == pytest.approx(1.0, abs=1e-2)
    moved = x + 0.01 * np.concatenate([push, push, np.zeros(6)])
    assert exact(moved) == pytest.approx(0.01 - RA - RB, abs=1e-4)
    np.testing.assert_allclose(np.array(BY_AD(x)[1]).reshape(4, 3), gradient, atol=1e-2)


@given(st.tuples(POINT, POINT, POINT, POINT))
def test_spheres_are_capsules_without_length(points: tuple[np.ndarray, ...]) -> None:
    a0, a1, b0, b1 = points
    capsule_sphere = clearance_function(sphere_b=True)(a0, a1, RA, b0, RB)
    sphere_capsule = clearance_function(sphere_a=True)(a0, RA, b0, b1, RB)
    spheres = clearance_function(sphere_a=True, sphere_b=True)(a0, RA, b0, RB)
    for (value, jacobian), as_capsules in (
        (capsule_sphere, (a0, a1, b0, b0)),
        (sphere_capsule, (a0, a0, b0, b1)),
        (spheres, (a0, a0, b0, b0)),
    ):
        assert float(value) == pytest.approx(exact(np.concatenate(as_capsules)), abs=1e-6)
        assert np.isfinite(np.array(jacobian)).all()
    assert capsule_sphere[1].shape == sphere_capsule[1].shape == (1, 9)
    assert spheres[1].shape == (1, 6)
    value, jacobian = clearance_function()(a0, a1, RA, b0, b1, RB)
    assert float(value) == pytest.approx(exact(np.concatenate(points)), abs=1e-6)
    assert jacobian.shape == (1, 12)


def test_spheres_and_their_derivative() -> None:
    rng = np.random.default_rng(4)
    for flags, size in (({"sphere_a": True}, 9), ({"sphere_b": True}, 9), ({"sphere_a": True, "sphere_b": True}, 6)):
        function = clearance_function(**flags)
        ends_of_a = 1 if flags.get("sphere_a") else 2
        x = rng.normal(size=size)

        def value(x: np.ndarray, function: ca.Function = function, k: int = ends_of_a) -> tuple[float, np.ndarray]:
            p = np.split(x, len(x) // 3)
            out = function(*p[:k], RA, *p[k:], RB)
            return float(out[0]), np.array(out[1]).ravel()

        numeric = [(value(x + h)[0] - value(x - h)[0]) / 2e-6 for h in 1e-6 * np.eye(size)]
        np.testing.assert_allclose(value(x)[1], numeric, atol=1e-6)
