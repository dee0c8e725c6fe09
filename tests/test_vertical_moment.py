"""The rows of the moment about the vertical: against linear programmes over the forces themselves, and closed forms."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from optimiser_setup import context_of, residuals_of
from scipy.optimize import linprog
from test_contact_wrench import TERM, cost, swinging, whole_stance

from gmr_traj.contacts.support import edges
from gmr_traj.residuals import FrameResidual
from gmr_traj.robot import Robot
from gmr_traj.terms.contact_rows import ContactRows
from gmr_traj.terms.vertical_moment import COUNT, moved, rectangle, rows_about_centre

WIDTH, MU = 0.01, 0.7
FOOT = np.array([[0.12, 0.03], [0.12, -0.03], [-0.05, 0.025], [-0.05, -0.025]])
SIDES = 16


def generators(points: np.ndarray, friction: float, directions: np.ndarray) -> np.ndarray:
    """Wrenches about the origin of unit presses at the points with friction at its most, a column each."""
    out = []
    for x, y in points:
        for fx, fy in friction * directions:
            out.append([fx, fy, 1.0, y, -x, x * fy - y * fx])
    return np.array(out).T


def possible(wrench: np.ndarray, columns: np.ndarray) -> bool:
    return bool(linprog(np.zeros(columns.shape[1]), A_eq=columns, b_eq=wrench, bounds=(0, None)).status == 0)


def turned(points: np.ndarray, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return points @ np.array([[c, s], [-s, c]]) + [0.4, -0.2]


@given(st.integers(0, 10_000), st.sampled_from([4, 3]))
def test_what_they_allow_forces_can_give(seed: int, count: int) -> None:
    """Together with pressing, friction and the zero-moment point; of a rectangle or a triangle, anywhere."""
    rng = np.random.default_rng(seed)
    points = turned(FOOT[:count], rng.uniform(0, 6))
    origin = np.array([*rng.uniform(-1, 1, 2), 0.0])
    weights = rng.dirichlet(np.ones(count))
    force = np.array([*rng.uniform(-0.3, 0.3, 2), 1.0])
    pressure = np.append(weights @ points, 0.0)
    wrench = np.concatenate([force, np.cross(pressure, force) + [0, 0, rng.uniform(-0.1, 0.1)]])
    about = np.concatenate([force, wrench[3:] - np.cross(origin, force)])
    angles = 2 * np.pi * np.arange(SIDES) / SIDES
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1) / np.cos(np.pi / SIDES)
    columns = generators(points, MU, circle)
    if (moved(*rows_about_centre(points, WIDTH, MU), origin) @ about).min() >= 0.0:
        assert possible(wrench, columns)


def test_on_a_rectangle_with_its_pyramids_they_are_all_there_is() -> None:
    rng = np.random.default_rng(0)
    points = np.array([[0.1, 0.03], [0.1, -0.03], [-0.1, -0.03], [-0.1, 0.03]])
    corners = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]]) / np.sqrt(2)
    columns, A = generators(points, MU, corners), moved(*rows_about_centre(points, WIDTH, MU), np.zeros(3))
    seen = set()
    for _ in range(150):
        force = np.array([*(0.6 * MU / np.sqrt(2) * rng.uniform(-1, 1, 2)), 1.0])
        place = np.append(rng.uniform(-0.9, 0.9, 2) * [0.1, 0.03], 0.0)
        wrench = np.concatenate([force, np.cross(place, force) + [0, 0, rng.uniform(-0.08, 0.08)]])
        allowed = bool((A @ wrench).min() >= 0.0)
        assert allowed == possible(wrench, columns)
        seen.add(allowed)
    assert seen == {True, False}


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_the_rectangle_is_inside_the_hull(count: int) -> None:
    points = turned(FOOT[:count], 0.7)
    centre, axes, half = rectangle(points, WIDTH)
    corners = centre + (np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]]) * half) @ axes
    normals, offsets = edges(points, WIDTH)
    assert (normals @ corners.T - offsets[:, None]).min() > -1e-9 and half.min() > 0.0
    np.testing.assert_allclose(axes @ axes.T, np.eye(2), atol=1e-12)


def test_a_spin_on_one_foot_costs_with_them_alone(g1: Robot) -> None:
    """The arms fling the robot around; as a cost, and as hard rows with the bounds they say."""
    motion = swinging(g1, 5, 30.0)
    schedule = whole_stance(5, g1, (g1.soles[0].name,))
    bounded = replace(TERM, vertical=0.02)
    more = cost(motion, g1, schedule, bounded) - cost(motion, g1, schedule)
    assert more.max() > 0.0 and more.min() >= -1e-9
    found, _ = residuals_of(ContactRows(**asdict(bounded)), context_of(g1, motion, schedule=schedule))
    (mine,) = [residual for residual in found if residual.name == "contact_wrench/moment about the vertical"]
    assert isinstance(mine, FrameResidual) and len(mine.rows) == COUNT and mine.unit == "m g m"
    assert (mine.lower == 0.0).all() and (mine.upper == np.inf).all()
    # On two feet there are none.
    both = whole_stance(5, g1, tuple(sole.name for sole in g1.soles))
    np.testing.assert_array_equal(cost(motion, g1, both, bounded), cost(motion, g1, both))
