from __future__ import annotations

import metrics_toy as toys
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gmr_traj.exceptions import ClipError
from gmr_traj.metrics.faithfulness import planar_alignment, target_distances
from gmr_traj.metrics.observation import observe
from gmr_traj.references import BodyTargets

BODIES = ("torso", "left_leg", "hand")


def walking() -> np.ndarray:
    qpos = toys.standing(30)
    qpos[:, 0], qpos[:, 1] = 0.05 * np.arange(30), 0.3 * np.sin(0.2 * np.arange(30))
    qpos[:, 7], qpos[:, 9] = 0.3 * np.sin(np.arange(30)), np.linspace(-1, 1, 30)
    return qpos


def targets(
    qpos: np.ndarray, weights: tuple[float, ...] = (1, 1, 1), turned: tuple[float, ...] = (1, 1, 1)
) -> BodyTargets:
    seen = observe(toys.clip(qpos), toys.toy())
    slots = [seen.robot.body_names.index(name) for name in BODIES]
    points = np.array([[0.0, 0.0, 0.1], [0.0, 0.0, -1.0], [0.02, 0.0, 0.0]])
    rotations = seen.rotations[:, slots]
    quaternions = Rotation.from_matrix(rotations.reshape(-1, 3, 3)).as_quat(scalar_first=True).reshape(-1, 3, 4)
    positions = seen.positions[:, slots] + np.einsum("tbij,bj->tbi", rotations, points)
    return BodyTargets(BODIES, positions, quaternions, np.array(weights), np.array(turned), points)


def moved(qpos: np.ndarray, angle: float, shift: tuple[float, float, float]) -> np.ndarray:
    out, turn = qpos.copy(), Rotation.from_euler("z", angle)
    out[:, :3] = turn.apply(qpos[:, :3]) + shift
    out[:, 3:7] = (turn * Rotation.from_quat(qpos[:, 3:7], scalar_first=True)).as_quat(scalar_first=True)
    return out


@pytest.mark.parametrize("angle", [0.0, 1.2, -2.9])
def test_a_clip_in_another_world_is_as_faithful(angle):
    seen = observe(toys.clip(moved(walking(), angle, (3.0, -2.0, 0.0))), toys.toy())
    found = target_distances(seen, targets(walking()), BODIES)
    assert found.turn == pytest.approx(-angle) and found.shift > 1.0
    for distances in (found.position, found.relative, found.orientation):
        np.testing.assert_allclose(distances, 0.0, atol=1e-7)


def test_height_and_posture_are_not_taken_out():
    qpos = moved(walking(), 0.5, (1.0, 1.0, 0.04))
    qpos[:, 9] += 0.2
    found = target_distances(observe(toys.clip(qpos), toys.toy()), targets(walking(), (1, 1, 0)), BODIES)
    np.testing.assert_allclose(found.position[:, :2], 0.04, atol=1e-9)
    np.testing.assert_allclose(found.relative[:, :2], 0.0, atol=1e-9)
    np.testing.assert_allclose(found.orientation, np.tile([0.0, 0.0, 0.2], (30, 1)), atol=1e-7)
    np.testing.assert_array_equal(found.placed, [True, True, False])


def test_bodies_that_do_not_count_and_a_base_without_a_target():
    seen = observe(toys.clip(walking()), toys.toy())
    found = target_distances(seen, targets(walking(), (0, 1, 1)), ("left_leg", "torso"))
    assert found.bodies == ("torso", "left_leg")
    assert np.isnan(found.relative).all()
    with pytest.raises(ClipError, match="none of the targets' bodies"):
        target_distances(seen, targets(walking()), ("arm",))


def test_targets_of_another_robot(g1):
    seen = observe(toys.clip(walking()), toys.toy())
    other = BodyTargets(("pelvis",), np.zeros((30, 1, 3)), np.tile([1.0, 0, 0, 0], (30, 1, 1)), np.ones(1), np.ones(1))
    with pytest.raises(ClipError, match="'pelvis', which robot toy does not have"):
        target_distances(seen, other, BODIES)


def test_the_alignment_is_the_best_one():
    rng = np.random.default_rng(0)
    points, wanted = rng.normal(size=(20, 3, 3)), rng.normal(size=(20, 3, 3))

    def cost(turn: float, shift: np.ndarray) -> float:
        return float(
            ((Rotation.from_euler("z", turn).apply(points.reshape(-1, 3)) + shift - wanted.reshape(-1, 3)) ** 2).sum()
        )

    turn, shift = planar_alignment(points, wanted)
    best = cost(turn, shift)
    for _ in range(50):
        assert cost(turn + 0.1 * rng.normal(), shift + 0.1 * np.append(rng.normal(size=2), 0.0)) >= best
    assert planar_alignment(points[:, :0], wanted[:, :0])[0] == 0.0
