from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gmr_traj.collision.broadphase import candidates
from gmr_traj.collision.elastic_band import relax
from gmr_traj.collision.limbs import Limb, limbs
from gmr_traj.collision.push_out import Surroundings, deepest, normal_equations, push_out
from gmr_traj.collision.tangles import _stretches
from gmr_traj.collision.untangle import _surroundings, untangle
from gmr_traj.collision.ways_out import directions, end_points, ways_out
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot

FRAMES = 45


@pytest.fixture(scope="module")
def right_arm(g1: Robot) -> Limb:
    return next(limb for limb in limbs(g1) if any(g1.joint_names[j] == "right_elbow_joint" for j in limb.joints))


def swing(robot: Robot, frames: int = FRAMES, **angles: float) -> RobotMotion:
    """From the nominal configuration to some joint angles and back."""
    qpos = np.tile(robot.nominal, (frames, 1))
    share = np.sin(np.pi * np.arange(frames) / (frames - 1)) ** 2
    for joint, angle in angles.items():
        column = 7 + robot.joint_names.index(joint)
        qpos[:, column] += share * (angle - qpos[0, column])
    return RobotMotion(qpos, 30.0, robot.joint_names)


@pytest.fixture(scope="module")
def through_the_belly(g1: Robot) -> RobotMotion:
    """The right forearm is turned in until it is in the middle of the trunk."""
    return swing(g1, right_shoulder_yaw_joint=1.2)


def depth(robot: Robot, motion: RobotMotion) -> np.ndarray:
    out = np.zeros(motion.frames)
    for candidate in candidates(robot, *placements(robot, motion.qpos), 0.0):
        out[candidate.frames] = np.maximum(out[candidate.frames], -candidate.clearance)
    return out


def wall(limb: Limb, wanted: np.ndarray, away: float = 0.0) -> Surroundings:
    """A level capsule across the limb's last capsule, some way above it."""
    at = limb.ends(wanted)[0][0, -1].mean(axis=0) + [0.0, 0.0, away]
    others = np.array([[at - [0.0, 0.5, 0.0], at + [0.0, 0.5, 0.0]]])
    return Surroundings(
        limb, np.array([[len(limb.capsules) - 1, 0]]), np.array([0.06]), np.tile(others, (len(wanted), 1, 1, 1))
    )


def test_an_arm_in_the_trunk_is_taken_out(g1: Robot, right_arm: Limb, through_the_belly: RobotMotion) -> None:
    assert depth(g1, through_the_belly).max() > 0.08
    out, (tangle,) = untangle(g1, through_the_belly)
    assert tangle.limb.bodies == right_arm.bodies
    assert depth(g1, out).max() < 0.002
    changed = np.abs(out.qpos - through_the_belly.qpos).max(axis=1) > 0
    assert not changed[: tangle.first].any()
    assert not changed[tangle.last + 1 :].any()
    columns = np.flatnonzero(np.abs(out.qpos - through_the_belly.qpos).max(axis=0))
    assert set(columns.tolist()) <= set((7 + right_arm.joints).tolist())
    speed = np.abs(np.diff(out.qpos[:, 7:], axis=0)).max() * out.fps
    assert speed < g1.velocity_limit.min()


def test_the_same_wherever_the_robot_stands(g1: Robot, through_the_belly: RobotMotion) -> None:
    qpos = through_the_belly.qpos.copy()
    turn = Rotation.from_rotvec([0.3, -0.2, 2.0])
    qpos[:, :3] = turn.apply(qpos[:, :3]) + [3.0, -1.0, 0.5]
    qpos[:, 3:7] = (turn * Rotation.from_quat(qpos[:, 3:7], scalar_first=True)).as_quat(scalar_first=True)
    here, _ = untangle(g1, through_the_belly)
    there, _ = untangle(g1, through_the_belly.with_qpos(qpos))
    np.testing.assert_allclose(there.qpos[:, 7:], here.qpos[:, 7:], atol=1e-5)


def test_the_same_twice(g1: Robot, through_the_belly: RobotMotion) -> None:
    one, two = untangle(g1, through_the_belly)[0], untangle(g1, through_the_belly)[0]
    assert one.qpos.tobytes() == two.qpos.tobytes()


def test_nothing_to_untangle(g1: Robot) -> None:
    shallow = swing(g1, right_shoulder_roll_joint=0.1)
    assert 0.0 < depth(g1, shallow).max() < 0.05
    out, found = untangle(g1, shallow)
    assert out is shallow
    assert found == []


@pytest.mark.parametrize("part", [slice(20, 45), slice(0, 25), slice(20, 25), slice(22, 23)])
def test_a_clip_that_begins_or_ends_in_a_tangle(g1: Robot, through_the_belly: RobotMotion, part: slice) -> None:
    out, found = untangle(g1, through_the_belly.with_qpos(through_the_belly.qpos[part]))
    assert found
    assert depth(g1, out).max() < 0.002


def test_of_two_arms_the_deeper_one_makes_way(g1: Robot, right_arm: Limb) -> None:
    across = swing(
        g1,
        right_shoulder_pitch_joint=0.9,
        right_shoulder_yaw_joint=1.5,
        right_elbow_joint=0.2,
        right_shoulder_roll_joint=0.2,
    )
    out, found = untangle(g1, across)
    assert {tangle.limb.bodies for tangle in found} == {right_arm.bodies}
    assert depth(g1, out).max() < 0.002


def test_deep_stretches_with_doubt_are_joined_and_widened() -> None:
    deep = np.zeros(40, dtype=bool)
    deep[[2, 3, 10, 11, 20, 21, 35]] = True
    doubtful = np.zeros(40, dtype=bool)
    doubtful[[3, 11, 35]] = True
    assert _stretches(deep, doubtful, bridge=3, widen=2) == [(0, 5), (8, 13), (33, 37)]
    assert _stretches(deep, doubtful, bridge=6, widen=2) == [(0, 13), (33, 37)]
    assert _stretches(deep, doubtful, bridge=3, widen=5) == [(0, 16), (30, 39)]
    assert _stretches(deep, np.zeros(40, dtype=bool), bridge=3, widen=2) == []


@pytest.mark.parametrize("along", [False, True])
def test_normal_equations_by_central_differences(right_arm: Limb, along: bool) -> None:
    random = np.random.default_rng(2)
    angles = random.uniform(-0.2, 0.2, (4, len(right_arm.joints)))
    around = wall(right_arm, angles, 0.1)
    wanted = angles + random.normal(scale=0.2, size=angles.shape)
    target, _, _ = right_arm.ends(wanted)
    direction = (np.tile([0.6, 0.0, 0.8], (4, 1)), np.ones((4, 1), dtype=bool)) if along else None
    value, hessian, gradient = normal_equations(around, wanted, target, angles, 0.3, direction)
    assert (around.clearances(right_arm.ends(angles)[0]) < 0.3).all()
    for k in range(angles.shape[1]):
        step = 1e-6 * np.eye(angles.shape[1])[k]
        up = normal_equations(around, wanted, target, angles + step, 0.3, direction)[0]
        down = normal_equations(around, wanted, target, angles - step, 0.3, direction)[0]
        np.testing.assert_allclose(gradient[:, k], (up - down) / 2e-6, rtol=1e-5, atol=1e-3 * np.sqrt(value.max()))
    assert (np.linalg.eigvalsh(hessian) > 0).all()


def test_pushed_out_to_the_side_of_the_direction(right_arm: Limb) -> None:
    wanted = np.zeros((2, len(right_arm.joints)))
    around = wall(right_arm, wanted)
    up = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    away = push_out(around, wanted, wanted, 0.01, 30, directions=up, along=np.ones((2, 1), dtype=bool))
    heights = right_arm.ends(away)[0][:, -1, :, 2]
    assert heights[0].min() > around.ends[0, 0, 0, 2] + 0.06
    assert heights[1].max() < around.ends[0, 0, 0, 2] - 0.06


def test_ways_out_are_clear_and_apart(right_arm: Limb) -> None:
    wanted = np.zeros((3, len(right_arm.joints)))
    around = wall(right_arm, wanted)
    assert deepest(around, end_points(around, wanted[:, None])).min() > 0.03
    angles, used = ways_out(around, wanted)
    assert used[:, :2].all()
    assert deepest(around, end_points(around, angles))[used].max() < 1e-3
    np.testing.assert_allclose(np.linalg.norm(directions(), axis=1), 1.0)
    np.testing.assert_allclose(directions().sum(axis=0), 0.0, atol=1e-12)


def test_band_is_straight_where_nothing_is_in_the_way(right_arm: Limb) -> None:
    frames, size = 20, len(right_arm.joints)
    wanted = np.full((frames, size), 0.2)
    around = wall(right_arm, wanted, 5.0)
    path = wanted.copy()
    path[8:12] += 0.3
    for fixed in ([0, 1, 18, 19], [18, 19], [0], []):
        at = np.isin(np.arange(frames), fixed)
        np.testing.assert_allclose(relax(around, wanted, path, 0.01, 1 / 30, at), wanted, atol=2e-3)
    short = replace(around, ends=around.ends[:2])
    np.testing.assert_array_equal(relax(short, wanted[:2], path[:2], 0.01, 1 / 30, np.zeros(2, dtype=bool)), path[:2])


def test_retargeted_dance(g1: Robot, right_arm: Limb, data_dir: Path) -> None:
    """An arm that is in the trunk for six seconds is outside all the time, and on the way."""
    with np.load(data_dir / "gmr_reference" / "dance2_subject3_hand.npz") as file:
        motion = RobotMotion(file["qpos"][100:220], 30.0, g1.joint_names)
    out, found = untangle(g1, motion)
    assert {tangle.limb.bodies for tangle in found} == {right_arm.bodies}
    assert depth(g1, motion)[32:].max() > 0.09
    halfway = out.qpos[:-1].copy()
    halfway[:, 7:] += 0.5 * np.diff(out.qpos[:, 7:], axis=0)
    between = out.with_qpos(halfway)
    for path, allowed in ((out, 0.006), (between, 0.02)):
        inside = depth(g1, path)
        assert max(inside[tangle.first : tangle.last].max() for tangle in found) < allowed


def test_what_is_too_close_is_found_among_all_pairs(g1: Robot, right_arm: Limb) -> None:
    """Spheres first, then exact distances: the same as exact distances of all pairs."""
    qpos = np.tile(g1.nominal, (40, 1))
    qpos[:, 7 + right_arm.joints] += np.random.default_rng(3).normal(0.0, 0.8, (40, len(right_arm.joints)))
    around = _surroundings(g1, right_arm, *placements(g1, qpos))
    points, _, _ = right_arm.ends(qpos[:, 7 + right_arm.joints])
    exact = around.clearances(points)
    n, p, gap, normals, share = around.rows(points, 0.03)
    assert n.size and np.array_equal(np.nonzero(exact < 0.03), (n, p))
    np.testing.assert_array_equal(gap, exact[n, p])
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
    assert ((share >= 0.0) & (share <= 1.0)).all()
    np.testing.assert_array_equal(around.depths(points), np.maximum(0.0, -exact.min(axis=1)))
