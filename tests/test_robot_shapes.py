"""Covering capsules contain what they cover, and are no larger than they need to be."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gmr_traj.robot_shapes import cover_points, covering_capsule, model_capsules

SIZE = st.floats(0.01, 0.5)


def distance_to_segment(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    axis = end - start
    along = np.clip((points - start) @ axis / max(float(axis @ axis), 1e-30), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - start - along[:, None] * axis, axis=1))


def compiled(geom: str) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><body name="b"><freejoint/>{geom}</body></worldbody></mujoco>'
    )


def unit_vectors(count: int = 2000) -> np.ndarray:
    points = np.random.default_rng(0).normal(size=(count, 3))
    return np.asarray(points / np.linalg.norm(points, axis=1, keepdims=True))


@given(st.integers(1, 40), st.integers(0, 10_000), SIZE, SIZE, SIZE)
def test_every_point_is_covered(count: int, seed: int, a: float, b: float, c: float) -> None:
    points = np.random.default_rng(seed).normal(size=(count, 3)) * [a, b, c] + [0.1, -0.2, 0.3]
    start, end, radius = cover_points(points)
    assert (distance_to_segment(points, start, end) <= radius + 1e-9).all()


def test_points_on_a_capsule_give_that_capsule_back() -> None:
    ends = np.array([[0.0, 0, -0.2], [0, 0, 0.2]])
    points = np.vstack([end + 0.05 * unit_vectors(4000) for end in ends])
    start, end, radius = cover_points(points)
    assert radius == pytest.approx(0.05, rel=0.02)
    assert np.linalg.norm(end - start) == pytest.approx(0.4, rel=0.02)


@given(SIZE, SIZE, SIZE)
def test_ellipsoid(a: float, b: float, c: float) -> None:
    model = compiled(f'<geom type="ellipsoid" size="{a} {b} {c}"/>')
    start, end, radius = covering_capsule(model, 0)
    surface = unit_vectors() * model.geom_size[0]
    distance = distance_to_segment(surface, start, end)
    assert (distance <= radius + 1e-9).all()
    assert radius == pytest.approx(sorted(model.geom_size[0])[1])


@given(SIZE, SIZE)
def test_cylinder(radius: float, half: float) -> None:
    model = compiled(f'<geom type="cylinder" size="{radius} {half}"/>')
    start, end, r = covering_capsule(model, 0)
    angle = np.linspace(0, 2 * np.pi, 500)
    rim = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(500, half)], axis=1)
    assert (distance_to_segment(np.vstack([rim, -rim]), start, end) <= r + 1e-9).all()


def test_box_is_covered_along_its_longest_edge() -> None:
    model = compiled('<geom type="box" size="0.02 0.03 0.2"/>')
    start, end, radius = covering_capsule(model, 0)
    corners = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T * [0.02, 0.03, 0.2]
    assert (distance_to_segment(corners, start, end) <= radius + 1e-9).all()
    assert abs((end - start) / np.linalg.norm(end - start)) == pytest.approx([0, 0, 1], abs=1e-9)
    assert radius < 1.6 * np.hypot(0.02, 0.03) + 1e-9


def test_spheres_and_capsules_stay_and_are_placed_in_the_body() -> None:
    model = compiled(
        '<geom name="ball" type="sphere" size="0.1" pos="0.3 0 0"/>'
        '<geom name="rod" type="capsule" fromto="0 0 0 0.1 0.2 0.3" size="0.04"/>'
        '<geom name="ghost" type="sphere" size="0.5" contype="0" conaffinity="0"/>'
    )
    ball, rod = model_capsules(model)
    assert (ball.name, ball.body, ball.radius) == ("ball", "b", 0.1)
    assert ball.start == pytest.approx([0.3, 0, 0])
    assert np.array_equal(ball.start, ball.end)
    ends = sorted([rod.start.tolist(), rod.end.tolist()])
    assert ends[0] == pytest.approx([0, 0, 0], abs=1e-12)
    assert ends[1] == pytest.approx([0.1, 0.2, 0.3])
