from __future__ import annotations

import fcl
import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from gmr_traj.metrics.capsules import point_segment_distance, segment_distance
from gmr_traj.metrics.self_collision import overlaps

coordinate = st.floats(-1.0, 1.0)
point = st.tuples(coordinate, coordinate, coordinate).map(np.array)


def distance(*ends: np.ndarray) -> float:
    return float(segment_distance(*(np.asarray(e, float)[None] for e in ends))[0])


@pytest.mark.parametrize(
    ("ends", "expected"),
    [
        (([0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]), 1.0),  # parallel, side by side
        (([0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]), 1.0),  # in one line
        (([0, 0, 0], [1, 0, 0], [0.5, 0, 0], [3, 0, 0]), 0.0),  # in one line, overlapping
        (([-1, 0, 0], [1, 0, 0], [0, -1, 0.3], [0, 1, 0.3]), 0.3),  # crossing
        (([0, 0, 0], [1, 0, 0], [2, 1, 0], [2, 3, 0]), np.sqrt(2.0)),  # end to end
        (([0, 0, 0], [0, 0, 0], [3, 4, 0], [3, 4, 0]), 5.0),  # two points
        (([0, 0, 2], [0, 0, 2], [-1, 0, 0], [1, 0, 0]), 2.0),  # a point and a segment
    ],
)
def test_closed_forms(ends, expected):
    assert distance(*ends) == pytest.approx(expected, abs=1e-12)


@given(point, point, point, point)
def test_is_the_minimum_over_both_segments(a0, a1, b0, b1):
    def gap(x):
        return float(np.sum((a0 + x[0] * (a1 - a0) - b0 - x[1] * (b1 - b0)) ** 2))

    grid = min(((s, t) for s in np.linspace(0, 1, 6) for t in np.linspace(0, 1, 6)), key=gap)
    found = minimize(gap, grid, bounds=[(0, 1), (0, 1)], options={"ftol": 1e-16, "gtol": 1e-12})
    assert distance(a0, a1, b0, b1) == pytest.approx(np.sqrt(found.fun), abs=1e-5)
    assert distance(a0, a1, b0, b1) <= np.sqrt(found.fun) + 1e-9


@given(point, point, point, point)
def test_order_does_not_matter(a0, a1, b0, b1):
    expected = distance(a0, a1, b0, b1)
    assert distance(b0, b1, a0, a1) == pytest.approx(expected, abs=1e-9)
    assert distance(a1, a0, b1, b0) == pytest.approx(expected, abs=1e-9)


def test_point_segment():
    p = np.array([[0.5, 2.0, 0.0], [-3.0, 4.0, 0.0], [1.0, 0.0, 1.0]])
    a, b = np.zeros((3, 3)), np.tile([1.0, 0.0, 0.0], (3, 1))
    np.testing.assert_allclose(point_segment_distance(p, a, b), [2.0, 5.0, 1.0], atol=1e-12)


def test_agrees_with_mujoco_and_fcl():
    rng = np.random.default_rng(3)
    ends = rng.uniform(-0.4, 0.4, size=(40, 4, 3))
    radius = (0.05, 0.08)
    ours = segment_distance(*ends.transpose(1, 0, 2)) - sum(radius)
    for expected, (a0, a1, b0, b1) in zip(ours, ends, strict=True):
        geoms = "".join(
            f'<geom type="capsule" size="{r}" fromto="{" ".join(map(str, (*p, *q)))}"/>'
            for p, q, r in ((a0, a1, radius[0]), (b0, b1, radius[1]))
        )
        model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{geoms}</worldbody></mujoco>")
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        assert mujoco.mj_geomDistance(model, data, 0, 1, 10.0, np.zeros(6)) == pytest.approx(expected, abs=1e-6)
        if expected > 1e-3:  # fcl's distance of shapes that overlap is only an indicator
            one, two = _fcl_capsule(a0, a1, radius[0]), _fcl_capsule(b0, b1, radius[1])
            assert fcl.distance(one, two, fcl.DistanceRequest(), fcl.DistanceResult()) == pytest.approx(
                expected, abs=1e-4
            )


def _fcl_capsule(start: np.ndarray, end: np.ndarray, radius: float) -> fcl.CollisionObject:
    axis = end - start
    rotation, _ = Rotation.align_vectors([axis / np.linalg.norm(axis)], [[0.0, 0.0, 1.0]])
    shape = fcl.Capsule(radius, float(np.linalg.norm(axis)))
    return fcl.CollisionObject(shape, fcl.Transform(rotation.as_matrix(), 0.5 * (start + end)))


def test_overlaps_find_every_pair_and_only_those_asked_for():
    rng = np.random.default_rng(5)
    lengths = rng.uniform(0.0, 0.3, size=6)
    radii = rng.uniform(0.03, 0.1, size=6)
    starts = rng.uniform(-0.3, 0.3, size=(50, 6, 3))
    direction = rng.normal(size=(50, 6, 3))
    ends = starts + direction / np.linalg.norm(direction, axis=2, keepdims=True) * lengths[:, None]
    pairs = ((0, 1), (2, 5), (4, 3))
    found = overlaps(starts, ends, radii, pairs)
    dense = np.zeros((50, 3))
    for p, (i, j) in enumerate(pairs):
        gap = segment_distance(starts[:, i], ends[:, i], starts[:, j], ends[:, j])
        dense[:, p] = np.maximum(0.0, radii[i] + radii[j] - gap)
    got = np.zeros_like(dense)
    got[found.frame, found.pair] = found.depth
    assert dense.any()
    np.testing.assert_allclose(got, dense, atol=1e-12)
    np.testing.assert_allclose(found.by_frame(), dense.max(axis=1), atol=1e-12)


def test_no_pairs_no_overlaps():
    found = overlaps(np.zeros((4, 1, 3)), np.ones((4, 1, 3)), np.ones(1), ())
    assert found.depth.size == 0
    np.testing.assert_array_equal(found.by_frame(), np.zeros(4))
