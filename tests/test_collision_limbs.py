from __future__ import annotations

import numpy as np
import pytest

from gmr_traj.collision.capsules import world_segments
from gmr_traj.collision.limbs import limbs
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.robot import Robot


@pytest.fixture
def random_qpos(g1: Robot) -> np.ndarray:
    random = np.random.default_rng(1)
    qpos = np.tile(g1.nominal, (5, 1))
    qpos[:, 3:7] = random.normal(size=(5, 4))
    qpos[:, 3:7] /= np.linalg.norm(qpos[:, 3:7], axis=1, keepdims=True)
    qpos[:, 7:] = random.uniform(g1.position_lower, g1.position_upper, (5, g1.dof))
    return qpos


def test_two_arms_and_two_legs(g1: Robot) -> None:
    found = limbs(g1)
    assert [g1.body_names[limb.root] for limb in found] == ["pelvis", "pelvis", "torso_link", "torso_link"]
    assert [limb.feet for limb in found] == [True, True, False, False]
    assert [len(limb.joints) for limb in found] == [6, 6, 7, 7]
    joints = np.concatenate([limb.joints for limb in found])
    assert sorted({*range(g1.dof)} - {*joints.tolist()}) == [i for i, n in enumerate(g1.joint_names) if "waist" in n]


def test_capsules_are_where_mujoco_has_them(g1: Robot, random_qpos: np.ndarray) -> None:
    positions, rotations = placements(g1, random_qpos)
    starts, ends = world_segments(g1, positions, rotations)
    for limb in limbs(g1):
        points, _, _ = limb.ends(random_qpos[:, 7 + limb.joints])
        in_world = np.einsum("tij,tcej->tcei", rotations[:, limb.root], points) + positions[:, None, None, limb.root]
        np.testing.assert_allclose(in_world[:, :, 0], starts[:, limb.capsules], atol=1e-12)
        np.testing.assert_allclose(in_world[:, :, 1], ends[:, limb.capsules], atol=1e-12)


def test_jacobian_by_central_differences(g1: Robot, random_qpos: np.ndarray) -> None:
    for limb in limbs(g1):
        angles = random_qpos[:, 7 + limb.joints]
        jacobian = limb.jacobian(*limb.ends(angles))
        for k in range(len(limb.joints)):
            step = 1e-6 * np.eye(len(limb.joints))[k]
            slope = (limb.ends(angles + step)[0] - limb.ends(angles - step)[0]) / 2e-6
            np.testing.assert_allclose(jacobian[:, :, :, k], slope, atol=1e-8)


def test_another_robot_has_limbs(talos: Robot) -> None:
    found = limbs(talos)
    assert sum(limb.feet for limb in found) == 2
    for limb in found:
        points, _, _ = limb.ends(np.zeros((2, len(limb.joints))))
        assert points.shape == (2, len(limb.capsules), 2, 3)
