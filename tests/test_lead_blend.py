"""The blends of a lead: their ends in closed form, their rates by finite differences."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import Polynomial
from scipy.spatial.transform import Rotation

from gmr_traj.lead.arrival import fitted, yaw
from gmr_traj.lead.blend import TAKE_UP, blend, blend_rotation, bump, minimum_jerk, take_up

STEP = 1e-4
rates = st.floats(-5.0, 5.0)


def quintic(function, first, last):
    """The polynomial of degree 5 that a function is between two times."""
    t = np.linspace(first, last, 12)
    found = Polynomial.fit(t, function(t), 5)
    np.testing.assert_allclose(found(t), function(t), atol=1e-9)
    return found


@given(rates, rates, rates, rates, st.floats(0.3, 3.0))
def test_a_blend_begins_at_rest_and_ends_as_the_clip_begins(start, end, velocity, acceleration, duration):
    def x(t):
        return blend(t, duration, *map(np.asarray, (start, end, velocity, acceleration)))

    np.testing.assert_allclose(x(np.array([-2 * duration, -duration])), start, atol=1e-12)
    short = min(TAKE_UP, duration)
    last = quintic(x, -short, 0.0)
    ends = [last.deriv(k)(0.0) if k else last(0.0) for k in range(3)]
    np.testing.assert_allclose(ends, [end, velocity, acceleration], atol=1e-5)
    first = last if short == duration else quintic(x, -duration, -short)
    begins = [first.deriv(k)(-duration) if k else first(-duration) for k in range(3)]
    np.testing.assert_allclose(begins, [start, 0.0, 0.0], atol=1e-5)
    if short < duration:  # where the rates begin to be taken up nothing jumps, either
        np.testing.assert_allclose(
            [first.deriv(k)(-short) for k in (1, 2)], [last.deriv(k)(-short) for k in (1, 2)], atol=1e-5
        )


@given(st.floats(-2.0, 3.0))
def test_shares_stay_between_0_and_1(s):
    assert 0.0 <= minimum_jerk(np.asarray(s)) <= 1.0 + 1e-12
    assert minimum_jerk(np.asarray(s)) + minimum_jerk(np.asarray(1.0 - s)) == pytest.approx(1.0)
    assert 0.0 <= bump(np.asarray(s)) <= 1.0
    assert bump(np.asarray(s)) == pytest.approx(float(bump(np.asarray(1.0 - s))))


def test_minimum_jerk_has_the_least_jerk_of_the_curves_with_its_ends():
    s = np.linspace(0.0, 1.0, 401)
    best = minimum_jerk(s)

    def jerk(curve):
        return float(np.sum(np.square(np.diff(curve, 3))))

    for wiggle in (bump(s), bump(s) * np.sin(2 * np.pi * s)):
        assert jerk(best) < jerk(best + 0.01 * wiggle)
        assert jerk(best) < jerk(best - 0.01 * wiggle)


def test_velocity_is_taken_up_late_so_that_a_long_blend_does_not_swing_back_far():
    t = np.linspace(-5.0, 0.0, 501)
    swing = blend(t, 5.0, np.asarray(0.0), np.asarray(0.0), np.asarray(3.0), np.asarray(0.0))
    assert np.all(swing[t < -TAKE_UP - 1e-9] == 0.0)
    assert -0.2 * TAKE_UP * 3.0 < swing.min() < -0.15 * TAKE_UP * 3.0


@given(*[st.floats(-1.5, 1.5) for _ in range(6)])
def test_a_turn_ends_where_it_should_at_its_angular_velocity(a, b, c, d, e, f):
    start, end = Rotation.from_rotvec([a, b, c]), Rotation.from_rotvec([c, a, b])
    omega, alpha = np.array([d, e, f]), np.array([f, d, e])

    def turned(t):
        return blend_rotation(np.atleast_1d(t), 1.2, start, end, omega, alpha)

    assert (turned(-1.2)[0] * start.inv()).magnitude() < 1e-9
    assert (turned(0.0)[0] * end.inv()).magnitude() < 1e-9
    last = (turned(0.0)[0] * turned(-STEP)[0].inv()).as_rotvec() / STEP
    np.testing.assert_allclose(last, omega, atol=0.01)


def test_take_up_is_nothing_but_its_rates_at_the_end():
    t = np.linspace(-0.4, 0.0, 5)
    out = take_up(t, 0.4, np.ones(3), np.ones(3))
    assert out.shape == (5, 3) and not out[[0, -1]].any() and out[1:-1].any()


@given(*[st.floats(-3.0, 3.0) for _ in range(3)], st.integers(4, 20))
def test_a_parabola_is_fitted_exactly(x, v, a, frames):
    t = np.arange(frames) / 30.0
    found = fitted(np.stack([x + v * t + 0.5 * a * t**2, np.zeros(frames)], axis=1), 30.0)
    np.testing.assert_allclose(found.value, [x, 0.0], atol=1e-9)
    np.testing.assert_allclose(found.velocity, [v, 0.0], atol=1e-9)
    np.testing.assert_allclose(found.acceleration, [a, 0.0], atol=1e-7)


def test_three_frames_have_no_rates():
    found = fitted(np.array([[1.0], [5.0], [-2.0]]), 30.0)
    assert (found.value, found.velocity, found.acceleration) == (1.0, 0.0, 0.0)


@given(st.floats(-3.1, 3.1), st.floats(-0.5, 0.5), st.floats(-0.3, 0.3))
def test_heading_does_not_depend_on_roll_and_pitch(heading, pitch, roll):
    rotation = Rotation.from_euler("ZYX", [heading, pitch, roll]).as_matrix()
    assert yaw(rotation) == pytest.approx(heading)


def test_a_person_on_the_belly_looks_where_the_head_is():
    assert yaw(Rotation.from_euler("ZYX", [0.7, np.pi / 2, 0.0]).as_matrix()) == pytest.approx(0.7)
