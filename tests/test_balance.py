from __future__ import annotations

import metrics_toy as toys
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gmr_traj.metrics.balance import (
    GRAVITY,
    centre_of_mass,
    centre_of_pressure,
    hull_margin,
    zero_moment_point,
    zmp_margins,
)
from gmr_traj.metrics.observation import observe

SQUARE = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0], [0.2, 0.3]])


def test_the_centre_of_mass_moves_with_the_base_and_by_a_limb_as_its_mass_says():
    robot = toys.toy()
    qpos = toys.standing(3)
    qpos[1, :3] += (0.3, -0.2, 0.5)
    qpos[2, 9] = 0.4
    centre = centre_of_mass(observe(toys.clip(qpos), robot))
    np.testing.assert_allclose(centre[1] - centre[0], [0.3, -0.2, 0.5], atol=1e-12)
    mass = robot.model.body_mass
    arm, hand = mass[robot.model.body("arm").id], mass[robot.model.body("hand").id]
    down = np.array([0.0, 0.0, -1.0])
    turned = np.array([0.0, np.sin(0.4), -np.cos(0.4)])
    expected = (0.15 * arm + 0.3 * hand) * (turned - down) / mass.sum()
    np.testing.assert_allclose(centre[2] - centre[0], expected, atol=1e-12)


def test_the_centre_of_pressure_is_under_the_lower_foot():
    robot = toys.toy()
    qpos = toys.standing(4)
    qpos[1, 3:7] = (np.cos(0.05), np.sin(0.05), 0.0, 0.0)  # leans to the right: that foot is lower
    qpos[2:, 2] += (-0.02, 0.3)  # sunk evenly; high above the floor
    pressed = centre_of_pressure(observe(toys.clip(qpos), robot), 100.0)
    np.testing.assert_allclose(pressed[0], [0.0, 0.0], atol=1e-12)
    assert pressed[1, 1] < observe(toys.clip(qpos), robot).soles[1][1, :, 1].max() + 0.02
    np.testing.assert_allclose(pressed[2:], 0.0, atol=1e-12)


def test_the_zero_moment_point_of_a_mass_at_rest_is_below_it_and_of_one_that_speeds_up_behind_it():
    time = np.arange(60) / 50.0
    rest = np.tile([0.3, -0.1, 0.8], (60, 1))
    np.testing.assert_allclose(zero_moment_point(rest, 50.0, 0.25), rest[:, :2], atol=1e-12)
    fast = rest + np.outer(0.5 * 2.0 * time**2, [1.0, 0.0, 0.0])
    expected = fast[:, 0] - 0.8 * 2.0 / GRAVITY
    np.testing.assert_allclose(zero_moment_point(fast, 50.0, 0.25)[:, 0], expected, atol=1e-9)
    up = rest + np.outer(0.5 * (-GRAVITY) * time**2, [0.0, 0.0, 1.0])
    assert np.isnan(zero_moment_point(up, 50.0, 0.25)).all(), "in free fall there is none"
    assert np.isnan(zero_moment_point(rest[:5], 50.0, 0.25)).all(), "too short for the window"


def test_margins_of_a_robot_that_stands():
    robot = toys.toy()
    observation = observe(toys.clip(toys.standing(3)), robot)
    mask = np.array([[True, True], [True, False], [False, False]])
    margins = zmp_margins(observation, np.zeros((3, 2)), mask)
    # Both soles reach from y = -0.13 to 0.13 and x = -0.1 to 0.1; the left one alone ends at y = 0.07.
    np.testing.assert_allclose(margins, [0.1, -0.07], atol=1e-12)


@pytest.mark.parametrize(("p", "margin"), [((0, 0), 1.0), ((0.5, 0), 0.5), ((3, 0), -2.0), ((4, 5), -5.0), ((1, 0), 0)])
def test_the_margin_of_a_square(p, margin):
    assert hull_margin(SQUARE, np.array(p, dtype=float)) == pytest.approx(margin, abs=1e-12)


def test_a_support_without_an_area_has_no_margin():
    assert np.isnan(hull_margin(np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]), np.zeros(2)))


@given(st.floats(0, 6), st.floats(-3, 3), st.floats(-3, 3))
def test_margins_do_not_depend_on_where_the_axes_are(angle, x, y):
    c, s = np.cos(angle), np.sin(angle)
    turn, p = np.array([[c, -s], [s, c]]), np.array([x, y])
    moved = hull_margin(SQUARE @ turn.T + (4.0, 5.0), turn @ p + (4.0, 5.0))
    assert moved == pytest.approx(hull_margin(SQUARE, p), abs=1e-9)
