from __future__ import annotations

import fcl
import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear
from scipy.spatial.transform import Rotation

from gmr_traj.collision.segments import distance, normal

COORDINATE = st.integers(-3, 3).map(lambda k: k / 4) | st.floats(-1, 1)  # the grid makes special positions frequent
POINT = st.tuples(COORDINATE, COORDINATE, COORDINATE).map(np.array)
SEGMENTS = st.tuples(POINT, POINT, POINT, POINT)
UNIT = POINT.filter(lambda p: np.linalg.norm(p) > 0.1).map(lambda p: p / np.linalg.norm(p))


def random_segments(count: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(4, count, 3)) * 0.2


@pytest.mark.parametrize(
    ("segments", "expected"),
    [
        (([-1, 0, 0], [1, 0, 0], [0, -1, 2], [0, 1, 2]), (2.0, 0.5, 0.5)),  # skew, both inside
        (([0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]), (1.0, 1.0, 0.0)),  # one line, end to end
        (([0, 0, 0], [1, 0, 0], [3, 1, 0], [2, 1, 0]), (np.sqrt(2), 1.0, 1.0)),  # antiparallel, apart
        (([0, 0, 0], [0, 0, 0], [-1, 1, 0], [1, 1, 0]), (1.0, 0.0, 0.5)),  # point and segment
        (([-1, 1, 0], [1, 1, 0], [0, 0, 0], [0, 0, 0]), (1.0, 0.5, 0.0)),  # segment and point
        (([0, 0, 0], [0, 0, 0], [3, 4, 0], [3, 4, 0]), (5.0, 0.0, 0.0)),  # two points
        (([-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0]), (0.0, 0.5, 0.5)),  # crossing
        (([0, 0, 0], [1, 0, 0], [2, 1, 0], [2, 3, 0]), (np.sqrt(2), 1.0, 0.0)),  # ends
        (([0, 0, 0], [1, 0, 0], [0.5, 1, 0], [0.5, 3, 0]), (1.0, 0.5, 0.0)),  # end and inside
    ],
)
def test_known_cases(segments: tuple[list[float], ...], expected: tuple[float, float, float]) -> None:
    np.testing.assert_allclose(distance(*np.array(segments, float)), expected, atol=1e-15)


@given(SEGMENTS)
def test_is_the_minimum(segments: tuple[np.ndarray, ...]) -> None:
    """The problem is convex, so the Karush-Kuhn-Tucker conditions on the unit square prove the minimum."""
    a0, a1, b0, b1 = segments
    d, s, t = (float(x) for x in distance(*segments))
    gap = (a0 + s * (a1 - a0)) - (b0 + t * (b1 - b0))
    assert d == pytest.approx(np.linalg.norm(gap), abs=1e-15)
    for parameter, slope in ((s, gap @ (a1 - a0)), (t, -gap @ (b1 - b0))):
        assert 0.0 <= parameter <= 1.0
        assert slope >= -1e-9 or parameter == 1.0
        assert slope <= 1e-9 or parameter == 0.0


@given(UNIT, st.floats(-18, -2), st.floats(0.05, 1), st.floats(-1.5, 1.5), st.floats(0, 1))
def test_nearly_parallel(along: np.ndarray, tilt: float, length: float, shift: float, gap: float) -> None:
    side = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    side /= np.linalg.norm(side)
    up = np.cross(along, side)
    a0, a1 = np.zeros(3), along
    b0 = shift * along + gap * side
    b1 = b0 + length * (along + 10**tilt * up)
    s, t = np.meshgrid(np.linspace(0, 1, 41), np.linspace(0, 1, 41))
    grid = np.linalg.norm(s[..., None] * along - b0 - t[..., None] * (b1 - b0), axis=-1).min()
    ends = min(float(distance(a0, a1, p, p)[0]) for p in (b0, b1))
    ends = min([ends, *(float(distance(p, p, b0, b1)[0]) for p in (a0, a1))])
    assert distance(a0, a1, b0, b1)[0] <= min(grid, ends) + 1e-12


def test_against_bounded_least_squares() -> None:
    for a0, a1, b0, b1 in random_segments(100, seed=1).transpose(1, 0, 2):
        found = lsq_linear(np.stack([a1 - a0, b0 - b1], axis=1), b0 - a0, bounds=(0, 1), method="bvls", tol=1e-14)
        assert distance(a0, a1, b0, b1)[0] == pytest.approx(np.linalg.norm(found.fun), abs=1e-10)


def _model(segments: np.ndarray, radii: np.ndarray) -> mujoco.MjModel:
    geoms = "".join(
        f'<geom type="capsule" size="{r}" fromto="{" ".join(map(repr, map(float, np.r_[p, q])))}"/>'
        for (p, q), r in zip(segments, radii, strict=True)
    )
    return mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{geoms}</worldbody></mujoco>")


def test_clearance_against_mujoco_and_fcl() -> None:
    segments = random_segments(60, seed=2).transpose(1, 0, 2).reshape(-1, 2, 3)
    radii = np.random.default_rng(3).uniform(0.02, 0.15, len(segments))
    model = _model(segments, radii)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    overlaps = 0
    for k in range(0, len(segments), 2):
        clearance = float(distance(*segments[k], *segments[k + 1])[0]) - radii[k] - radii[k + 1]
        overlaps += clearance < 0
        fromto = np.zeros(6)
        assert clearance == pytest.approx(mujoco.mj_geomDistance(model, data, k, k + 1, 10.0, fromto), abs=1e-9)
        objects = [
            fcl.CollisionObject(
                fcl.Capsule(radii[g], 2 * model.geom_size[g][1]),
                fcl.Transform(data.geom_xmat[g].reshape(3, 3), data.geom_xpos[g]),
            )
            for g in (k, k + 1)
        ]
        assert clearance == pytest.approx(fcl.distance(*objects), abs=1e-9)
    assert 10 < overlaps < 50


@given(SEGMENTS, UNIT, POINT, st.floats(0.01, 100))
def test_symmetry_rigid_motion_and_scale(
    segments: tuple[np.ndarray, ...], axis: np.ndarray, shift: np.ndarray, scale: float
) -> None:
    a0, a1, b0, b1 = segments
    d = float(distance(*segments)[0])
    rotation = Rotation.from_rotvec(2.0 * axis).as_matrix()
    moved = [scale * (rotation @ p + shift) for p in segments]
    assert distance(*moved)[0] == pytest.approx(scale * d, abs=1e-7 * scale)
    for swapped in ((b0, b1, a0, a1), (a1, a0, b0, b1), (a0, a1, b1, b0)):
        assert distance(*swapped)[0] == pytest.approx(d, abs=1e-12)


@given(SEGMENTS)
def test_the_normal_is_a_unit_vector_along_the_gap(segments: tuple[np.ndarray, ...]) -> None:
    a0, a1, b0, b1 = segments
    d, s, t = distance(*segments)
    n = normal(*segments)
    assert np.linalg.norm(n) == pytest.approx(1.0)
    if d > 1e-6:
        gap = a0 + s * (a1 - a0) - b0 - t * (b1 - b0)
        np.testing.assert_allclose(n, gap / d, atol=1e-6)


def test_normal_where_segments_touch() -> None:
    x, y, o = np.eye(3)[0], np.eye(3)[1], np.zeros(3)
    np.testing.assert_allclose(np.abs(normal(-x, x, -y, y)), [0, 0, 1])
    assert normal(o, x, 0.5 * x, 2 * x) @ x == pytest.approx(0.0)  # on one line: across it
    assert np.linalg.norm(normal(o, o, o, o)) == pytest.approx(1.0)
    assert normal(o, o, -x, x) @ x == pytest.approx(0.0)  # a point on a segment


@settings(max_examples=20)
@given(st.integers(0, 2**31))
def test_broadcasts_over_leading_axes(seed: int) -> None:
    a0, a1, b0, b1 = random_segments(6, seed)
    d, s, t = distance(a0[:, None], a1[:, None], b0, b1)
    n = normal(a0[:, None], a1[:, None], b0, b1)
    assert d.shape == s.shape == t.shape == (6, 6)
    assert n.shape == (6, 6, 3)
    for i in range(6):
        for j in range(6):
            assert d[i, j] == pytest.approx(float(distance(a0[i], a1[i], b0[j], b1[j])[0]), abs=1e-15)
