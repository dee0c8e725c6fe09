"""Retargeting: targets by their formula, motions whose answer is known, and independence of heading and start."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from conftest import TEST_DATA
from retarget_setup import cut, dance, human_of, largest_difference, minks_coupling
from scipy.spatial.transform import Rotation

from gmr_traj.bench.gmr_loop import gmr_loop
from gmr_traj.exceptions import GmrTrajError, MapError
from gmr_traj.human_motion import HumanMotion
from gmr_traj.metrics.observation import observe
from gmr_traj.motion import RobotMotion
from gmr_traj.retarget import inverse_kinematics
from gmr_traj.retarget.body_map import BodyMap, load_map
from gmr_traj.retarget.retarget import Retargeted, retarget
from gmr_traj.retarget.targets import scaled_targets
from gmr_traj.robot import Robot
from gmr_traj.robot_loading import reduce_robot

NOISE = 0.02  # [m] on every human joint: no robot can be there


@pytest.fixture(scope="module")
def lafan1(g1: Robot) -> BodyMap:
    return load_map("lafan1_to_unitree_g1", g1)


@pytest.fixture(scope="module")
def human(g1: Robot, lafan1: BodyMap) -> HumanMotion:
    return human_of(g1, lafan1, dance(g1), height=1.75)


@pytest.fixture(scope="module")
def retargeted(g1: Robot, lafan1: BodyMap, human: HumanMotion) -> Retargeted:
    return retarget(human, g1, lafan1)


def test_targets_are_the_formula(lafan1: BodyMap, human: HumanMotion):
    offset = np.array([0.01, -0.02, 0.03])
    shifted = replace(lafan1, targets=tuple(replace(t, position_offset=offset) for t in lafan1.targets))
    targets = scaled_targets(human, shifted, height=1.5)
    ratio, root = 1.5 / 1.8, human.positions[:, human.index("Hips")]
    for k, target in enumerate(lafan1.targets):
        joint = human.positions[:, human.index(target.joint)]
        turned = human.quaternions[:, human.index(target.orientation_joint)]
        R = (
            Rotation.from_quat(turned, scalar_first=True).as_matrix()
            @ Rotation.from_quat(target.rotation_offset, scalar_first=True).as_matrix()
        )
        expected = ratio * (target.scale * (joint - root) + 0.9 * root) + R @ offset
        np.testing.assert_allclose(targets.positions[:, k], expected, atol=1e-12)
        found = Rotation.from_quat(np.array(targets.quaternions[:, k]), scalar_first=True).as_matrix()
        np.testing.assert_allclose(found, R, atol=1e-12)
    assert (targets.position_weights[0], np.median(targets.position_weights[targets.position_weights > 0])) == (10, 1)
    assert targets.position_weights[targets.names.index("torso_link")] == 0


@pytest.mark.parametrize(("size", "turn"), [(0.3, 1.0), (1.4, -3.0), (2.5, np.pi)])
def test_targets_scale_with_the_person_and_turn_with_the_clip(
    lafan1: BodyMap, human: HumanMotion, size: float, turn: float
):
    base = scaled_targets(human, lafan1)
    larger = replace(human, positions=size * human.positions, height=human.height / size)
    np.testing.assert_allclose(scaled_targets(larger, lafan1).positions, base.positions, atol=1e-9)
    turned = scaled_targets(cut(human, 0, human.frames, turn), lafan1)
    R = Rotation.from_euler("z", turn).as_matrix()
    np.testing.assert_allclose(turned.positions, base.positions @ R.T, atol=1e-9)


def test_a_planted_foot_stays_planted(g1: Robot, lafan1: BodyMap, human: HumanMotion):
    """The root's path is scaled as the legs are, so a foot that stays while the root moves on has targets that stay."""
    positions = np.array(human.positions)
    positions[:, human.index("LeftFoot")] = positions[0, human.index("LeftFoot")]
    targets = scaled_targets(replace(human, positions=positions), lafan1)
    foot = targets.positions[:, targets.names.index("left_ankle_roll_link")]
    np.testing.assert_allclose(foot, np.tile(foot[0], (len(foot), 1)), atol=1e-12)


def test_a_motion_the_robot_can_do_comes_back(g1: Robot, human: HumanMotion, retargeted: Retargeted):
    expected = dance(g1)
    found = retargeted.motion.qpos - [0, 0, retargeted.raised, *[0] * 33]
    assert largest_difference(g1, expected, found) < 2e-3
    assert (retargeted.motion.fps, retargeted.motion.robot) == (30.0, "unitree_g1")
    assert retargeted.notes == ()


def test_the_lowest_point_is_on_the_floor_and_the_references_are_raised_too(
    g1: Robot, lafan1: BodyMap, human: HumanMotion, retargeted: Retargeted
):
    seen = observe(retargeted.motion, g1)
    soles = min(points[..., 2].min() for points in (*seen.soles, *seen.outlines))
    assert min(soles, seen.lowest.min()) == pytest.approx(0.0, abs=1e-9)
    rise = retargeted.references.positions - scaled_targets(human, lafan1).positions
    np.testing.assert_allclose(rise, np.broadcast_to([0, 0, retargeted.raised], rise.shape), atol=1e-12)


def test_a_clip_that_one_frame_lifts_off_the_floor_has_a_note(g1: Robot, lafan1: BodyMap):
    qpos = dance(g1, frames=40)
    qpos[20, 2] -= 0.2
    notes = retarget(human_of(g1, lafan1, qpos, height=1.75), g1, lafan1).notes
    assert len(notes) == 1
    assert "in frame 20 is the lowest point" in notes[0]


@pytest.mark.parametrize("first", [0, 7, 15])
def test_heading_does_not_matter(g1: Robot, lafan1: BodyMap, human: HumanMotion, first: int):
    one, other = (retarget(cut(human, first, 12, turn, NOISE), g1, lafan1).motion.qpos for turn in (0.0, np.pi))
    assert largest_difference(g1, one, other, np.pi) < 1e-6


def test_the_start_does_not_matter(g1: Robot, lafan1: BodyMap, human: HumanMotion):
    noisy = cut(human, 0, human.frames, noise=NOISE)
    whole = retarget(noisy, g1, lafan1)
    for first in (5, 14, 22):
        part = retarget(cut(noisy, first, 6), g1, lafan1).motion.shifted(0.0)
        both = whole.motion.qpos[first : first + 6], part.qpos
        np.testing.assert_allclose(both[0][5:, 7:], both[1][5:, 7:], atol=1e-3)


def test_the_first_frame_is_settled(g1: Robot, lafan1: BodyMap, human: HumanMotion):
    """A clip that stands still is the same in every frame, the first one included."""
    noisy = cut(human, 3, 1, noise=NOISE)
    still = replace(
        noisy, positions=np.repeat(noisy.positions, 4, axis=0), quaternions=np.repeat(noisy.quaternions, 4, axis=0)
    )
    qpos = retarget(still, g1, lafan1).motion.qpos
    np.testing.assert_allclose(qpos, np.tile(qpos[0], (4, 1)), atol=1e-6)
    assert np.abs(np.diff(retarget(still, g1, lafan1, method="gmr-code").motion.qpos, axis=0)).max() > 1e-5


@pytest.mark.parametrize("method", ["gmr", "gmr-code"])
@pytest.mark.parametrize("factor", [0.02, 0.2])
def test_the_velocity_limit_holds_from_frame_to_frame(
    g1: Robot, lafan1: BodyMap, human: HumanMotion, method: str, factor: float
):
    noisy = cut(human, 0, human.frames, noise=NOISE)
    free = np.abs(np.diff(retarget(noisy, g1, lafan1, method=method).motion.qpos[:, 7:], axis=0)) * human.fps
    qpos = retarget(noisy, g1, lafan1, method=method, velocity_limit=factor).motion.qpos
    share = np.abs(np.diff(qpos[:, 7:], axis=0)) * human.fps / (factor * g1.velocity_limit)
    assert share.max() <= 1.0 + 1e-9
    assert (free / g1.velocity_limit).max() > factor  # it had something to do
    assert share.max() > 0.99


def test_joint_ranges_of_the_map_hold(g1: Robot, lafan1: BodyMap, human: HumanMotion):
    elbow = g1.joint_names.index("left_elbow_joint")
    bent = dance(g1)[:, 7 + elbow].max()
    narrow = replace(lafan1, joint_ranges={"left_elbow_joint": (-0.5, bent - 0.1)})
    for method in ("gmr", "gmr-code"):
        assert retarget(human, g1, narrow, method=method).motion.qpos[:, 7 + elbow].max() <= bent - 0.1 + 1e-9


def test_gmr_code_is_gmrs_loop(g1: Robot, lafan1: BodyMap, human: HumanMotion, monkeypatch: pytest.MonkeyPatch):
    noisy = cut(human, 0, 12, noise=NOISE)
    plain = gmr_loop(g1, lafan1, scaled_targets(noisy, lafan1, height=1.75)).qpos
    result = retarget(noisy, g1, lafan1, method="gmr-code")
    assert result.raised == 0.0
    assert largest_difference(g1, plain, result.motion.qpos) < 3e-3  # what its tolerance leaves open
    monkeypatch.setattr(inverse_kinematics, "coupling", minks_coupling)
    assert largest_difference(g1, plain, retarget(noisy, g1, lafan1, method="gmr-code").motion.qpos) < 1e-7


def test_gmr_code_takes_every_lafan1_performer_for_as_tall(g1: Robot, lafan1: BodyMap, human: HumanMotion):
    taller = retarget(replace(human, height=1.9), g1, lafan1, method="gmr-code")
    as_it_is = retarget(human, g1, lafan1, method="gmr-code")
    np.testing.assert_allclose(taller.motion.qpos, as_it_is.motion.qpos, atol=1e-9)
    by_the_paper = retarget(replace(human, height=1.9), g1, lafan1)
    assert largest_difference(g1, taller.motion.qpos, by_the_paper.motion.qpos) > 0.01


def test_a_point_of_a_body_is_where_its_target_is(g1: Robot):
    smplx = load_map("smplx_to_unitree_g1", g1)
    qpos = dance(g1, frames=8)
    result = retarget(human_of(g1, smplx, qpos, height=1.7), g1, smplx)
    assert largest_difference(g1, qpos, result.motion.qpos - [0, 0, result.raised, *[0] * 33]) < 2e-3
    seen = observe(result.motion, g1)
    b, k = g1.body_names.index("left_ankle_roll_link"), result.references.names.index("left_ankle_roll_link")
    toe = seen.positions[:, b] + seen.rotations[:, b] @ result.references.points[k]
    np.testing.assert_allclose(toe, result.references.positions[:, k], atol=2e-3)


def test_a_robot_with_locked_wrists_follows_too(g1: Robot, lafan1: BodyMap, human: HumanMotion):
    reduced = reduce_robot(g1, [name for name in g1.joint_names if "wrist" not in name])
    motion = retarget(human, reduced, load_map("lafan1_to_unitree_g1", reduced)).motion
    assert motion.joint_names == reduced.joint_names
    ankle = [i for i, name in enumerate(reduced.joint_names) if "knee" in name]
    full = [g1.joint_names.index(reduced.joint_names[i]) for i in ankle]
    assert np.abs(motion.qpos[:, [7 + i for i in ankle]] - dance(g1)[:, [7 + i for i in full]]).max() < 0.05


def test_the_same_input_gives_the_same_output_bit_for_bit(g1: Robot, lafan1: BodyMap, human: HumanMotion):
    noisy = cut(human, 0, 10, noise=NOISE)
    for method in ("gmr", "gmr-code"):
        one, other = (retarget(noisy, g1, lafan1, method=method) for _ in range(2))
        np.testing.assert_array_equal(one.motion.qpos, other.motion.qpos)


def test_progress_is_told(g1: Robot, lafan1: BodyMap, human: HumanMotion):
    seen: list[tuple[str, int, int]] = []
    retarget(human, g1, lafan1, progress=lambda *report: seen.append(report))
    assert seen[-1] == ("retargeting", 30, 30)
    assert [done for _, done, _ in seen] == sorted(done for _, done, _ in seen)


def test_wrong_calls_are_errors(g1: Robot, lafan1: BodyMap, human: HumanMotion):
    with pytest.raises(GmrTrajError, match="no retargeting method 'magic'; there are gmr, gmr-code"):
        retarget(human, g1, lafan1, method="magic")
    for factor in (0.0, -1.0, float("nan")):
        with pytest.raises(GmrTrajError, match="expected a positive factor"):
            retarget(human, g1, lafan1, velocity_limit=factor)
    with pytest.raises(MapError, match="made for lafan1, and the motion is of the rig cmu"):
        retarget(replace(human, rig="cmu"), g1, lafan1)
    other = replace(human, rig="unknown", names=tuple(name.replace("LeftToe", "Toe") for name in human.names))
    with pytest.raises(MapError, match="the motion has no joint 'LeftToe'; it has Hips"):
        retarget(other, g1, lafan1)
    assert retarget(cut(replace(human, rig="unknown"), 0, 2), g1, lafan1).motion.frames == 2


def test_another_robot_follows_too(talos: Robot):
    body_map = load_map(TEST_DATA / "talos" / "lafan1_to_talos.toml", talos)
    expected = dance(talos, frames=8)
    result = retarget(human_of(talos, body_map, expected, height=1.75), talos, body_map)
    seen, meant = observe(result.motion, talos), observe(RobotMotion(expected, 30.0, talos.joint_names), talos)
    for body in body_map.bodies:
        b = talos.body_names.index(body)
        off = seen.positions[:, b] - [0, 0, result.raised] - meant.positions[:, b]
        assert np.linalg.norm(off, axis=1).max() < 5e-3, body
