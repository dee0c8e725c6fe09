"""Quaternions of many frames at a time against SciPy's rotations."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from gmr_traj.formats.human.kinematics import world_placements
from gmr_traj.quaternions import from_euler, inverse, product, rotated

COUNT = 7
SEEDS = st.integers(0, 10_000)


def random(seed: int) -> tuple[Rotation, np.ndarray]:
    rotations = Rotation.random(COUNT, random_state=seed)
    return rotations, rotations.as_quat(scalar_first=True).T


def angle(a: Rotation, b: np.ndarray) -> float:
    """Largest angle between rotations and quaternions with the components first [rad]."""
    return float((a.inv() * Rotation.from_quat(b.T, scalar_first=True)).magnitude().max())


@given(SEEDS)
def test_products_and_turned_vectors_are_scipys(seed: int):
    (A, a), (B, b) = random(seed), random(seed + 1)
    vectors = np.random.default_rng(seed).normal(size=(COUNT, 3))
    assert angle(A * B, product(a, b)) < 1e-12
    assert angle(A.inv(), inverse(a)) < 1e-12
    np.testing.assert_allclose(rotated(a, vectors.T).T, A.apply(vectors), atol=1e-12)


@given(st.lists(st.sampled_from("XYZ"), min_size=1, max_size=3), SEEDS)
def test_turns_one_after_the_other_are_scipys(axes: list[str], seed: int):
    angles = np.random.default_rng(seed).uniform(-7.0, 7.0, (len(axes), COUNT))
    expected = Rotation.identity()
    for axis, values in zip(axes, angles, strict=True):
        expected = expected * Rotation.from_euler(axis, values[:, None])
    assert angle(expected, from_euler("".join(axes), list(angles))) < 1e-12


def test_no_axes_are_an_error():
    with pytest.raises(ValueError, match="no axes"):
        from_euler("", [])


def test_placements_follow_the_tree():
    rng = np.random.default_rng(0)
    parents = (-1, 0, 1, 0)
    offsets = rng.normal(size=(COUNT, 4, 3))
    quaternions = rng.normal(size=(COUNT, 4, 4))  # not of unit length
    positions, found = world_placements(parents, offsets, quaternions)
    local = [Rotation.from_quat(quaternions[:, j], scalar_first=True) for j in range(4)]
    R = [local[0], local[0] * local[1], local[0] * local[1] * local[2], local[0] * local[3]]
    p = [offsets[:, 0]]
    p += [p[0] + R[0].apply(offsets[:, 1])]
    p += [p[1] + R[1].apply(offsets[:, 2]), p[0] + R[0].apply(offsets[:, 3])]
    for j in range(4):
        np.testing.assert_allclose(positions[:, j], p[j], atol=1e-12)
        assert angle(R[j], found[:, j].T) < 1e-12
    still, _ = world_placements(parents, offsets[0], quaternions)  # offsets that are the same in all frames
    np.testing.assert_allclose(still[:, 1], offsets[0, 0] + R[0].apply(offsets[0, 1]), atol=1e-12)
