from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gmr_traj.collision.broadphase import Candidate, candidates, renewed
from gmr_traj.collision.capsules import radii, world_segments
from gmr_traj.collision.segments import distance
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.robot import Capsule, Robot


def brute_force(robot: Robot, positions: np.ndarray, rotations: np.ndarray) -> dict[tuple[int, int], np.ndarray]:
    starts, ends = world_segments(robot, positions, rotations)
    r = radii(robot)
    return {
        (i, j): distance(starts[:, i], ends[:, i], starts[:, j], ends[:, j])[0] - r[i] - r[j]
        for i, j in robot.collision_pairs
    }


def assert_complete(found: list[Candidate], clearances: dict[tuple[int, int], np.ndarray], margin: float) -> None:
    """Exactly the frames below the margin, give or take rounding at the margin itself."""
    pairs = [candidate.pair for candidate in found]
    assert pairs == [pair for pair in clearances if pair in pairs]
    frames = {candidate.pair: set(candidate.frames.tolist()) for candidate in found}
    for pair, clearance in clearances.items():
        assert set(np.flatnonzero(clearance < margin - 1e-12).tolist()) <= frames.get(pair, set()), pair
    for candidate in found:
        assert candidate.frames.size
        assert (np.diff(candidate.frames) > 0).all()
        np.testing.assert_allclose(candidate.clearance, clearances[candidate.pair][candidate.frames], atol=1e-12)
        assert (candidate.clearance < margin).all()


def smooth_walk(robot: Robot, frames: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    knots = np.linspace(0, frames - 1, max(2, frames // 15 + 1))
    angles = rng.uniform(robot.position_lower, robot.position_upper, (len(knots), robot.dof))
    qpos = np.tile(robot.nominal, (frames, 1))
    for joint, column in enumerate(angles.T):
        qpos[:, 7 + joint] = np.interp(np.arange(frames), knots, column)
    qpos[:, :2] += np.cumsum(rng.normal(size=(frames, 2)) * 0.02, axis=0)
    return qpos


@pytest.mark.parametrize("chunk", [1, 7, 16, 1000])
@pytest.mark.parametrize("margin", [-0.01, 0.0, 0.05])
def test_complete_on_a_wild_motion(g1: Robot, chunk: int, margin: float) -> None:
    at = placements(g1, smooth_walk(g1, 130, seed=5))
    found = candidates(g1, *at, margin, chunk=chunk)
    assert len(found) > 5
    assert_complete(found, brute_force(g1, *at), margin)


@settings(max_examples=30)
@given(st.integers(0, 2**31), st.integers(1, 40), st.floats(-0.2, 0.5), st.integers(1, 20))
def test_complete_on_loose_capsules(g1: Robot, seed: int, frames: int, margin: float, chunk: int) -> None:
    rng = np.random.default_rng(seed)
    count = 6
    ends = rng.normal(size=(count, 2, 3)) * 0.1 * rng.integers(0, 2, (count, 1, 1))  # half of them spheres
    capsules = tuple(Capsule(f"c{c}", f"b{c}", *ends[c], float(rng.uniform(0.02, 0.2))) for c in range(count))
    robot = replace(
        g1,
        body_names=tuple(f"b{c}" for c in range(count)),
        capsules=capsules,
        collision_pairs=tuple(p for p in combinations(range(count), 2) if rng.random() < 0.7),
    )
    positions = np.cumsum(rng.normal(size=(frames, count, 3)) * 0.1, axis=0) + rng.normal(size=(count, 3)) * 0.4
    rotations = np.broadcast_to(np.eye(3), (frames, count, 3, 3))
    found = candidates(robot, positions, rotations, margin, chunk=chunk)
    assert_complete(found, brute_force(robot, positions, rotations), margin)


@settings(max_examples=10)
@given(st.integers(0, 2**31))
def test_changed_frames_alone_are_searched_again(g1: Robot, seed: int) -> None:
    """What was found, renewed in the frames that changed, is what a whole new search finds."""
    qpos, other = smooth_walk(g1, 60, seed), smooth_walk(g1, 60, seed + 1)
    frames = np.flatnonzero(np.random.default_rng(seed).random(60) < 0.3)
    found = candidates(g1, *placements(g1, qpos), 0.0)
    qpos[frames] = other[frames]
    fresh = candidates(g1, *placements(g1, qpos[frames]), 0.0)
    expected = {c.pair: c for c in candidates(g1, *placements(g1, qpos), 0.0)}
    result = renewed(found, frames, fresh)
    assert {c.pair for c in result} == set(expected) and len(result) == len(expected)
    for candidate in result:
        np.testing.assert_array_equal(candidate.frames, expected[candidate.pair].frames)
        np.testing.assert_allclose(candidate.clearance, expected[candidate.pair].clearance, atol=1e-12)


def test_boxes_with_one_centre(g1: Robot) -> None:
    """Nested capsules share the centre of their boxes; each is still told from the other."""

    def along(name: str, half: float) -> Capsule:
        return Capsule(name, name, np.array([0, 0, -half]), np.array([0, 0, half]), 0.05)

    robot = replace(
        g1,
        body_names=("a", "b", "c"),
        capsules=(along("a", 0.1), along("b", 0.2), along("c", 0.1)),
        collision_pairs=((0, 1), (2, 0), (1, 2)),
    )
    positions = np.zeros((3, 3, 3))
    positions[:, 2, 0] = 0.09
    found = candidates(robot, positions, np.broadcast_to(np.eye(3), (3, 3, 3, 3)), 0.0)
    assert [(c.pair, c.frames.tolist()) for c in found] == [(p, [0, 1, 2]) for p in robot.collision_pairs]
    np.testing.assert_allclose([c.clearance[0] for c in found], [-0.1, -0.01, -0.01], atol=1e-12)


def test_nothing_to_do(g1: Robot) -> None:
    at = placements(g1, g1.nominal[None])
    assert candidates(g1, *at, 0.0) == []
    assert candidates(g1, at[0][:0], at[1][:0], 1.0) == []
    assert candidates(replace(g1, collision_pairs=()), *at, 1.0) == []


@pytest.mark.parametrize("name", ["walk1_subject1_walk2", "dance2_subject3_hand", "dance1_subject1"])
def test_complete_on_retargeted_clips(g1: Robot, data_dir: Path, name: str) -> None:
    with np.load(data_dir / "gmr_reference" / f"{name}.npz") as file:
        at = placements(g1, file["qpos"])
    found = candidates(g1, *at, 0.02)
    assert min(candidate.clearance.min() for candidate in found) < -0.02
    assert_complete(found, brute_force(g1, *at), 0.02)
