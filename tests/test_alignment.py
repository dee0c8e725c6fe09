"""Making maps: rest-pose alignment finds GMR's published offsets, any heading, and says where it cannot."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import TEST_DATA
from human_files import XSENS, bvh_file
from retarget_setup import dance, human_of
from scipy.spatial.transform import Rotation

from gmr_traj.exceptions import GmrTrajError, MapError, RobotError
from gmr_traj.formats.human import read_human
from gmr_traj.formats.human.mean_skeleton import mean_joints
from gmr_traj.formats.human.smpl_joints import JOINTS
from gmr_traj.formats.human.smpl_joints import parents as smpl_parents
from gmr_traj.human_motion import HumanMotion
from gmr_traj.retarget.alignment import align, carried_over, zero_pose
from gmr_traj.retarget.body_map import BodyMap, load_map
from gmr_traj.robot import Robot

HANGING = {"*_elbow_joint": np.pi / 2}
T_POSE = {**HANGING, "left_shoulder_roll_joint": np.pi / 2, "right_shoulder_roll_joint": -np.pi / 2}


def angle(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angles between orientations [rad]."""
    one, other = (Rotation.from_quat(np.array(x), scalar_first=True) for x in (a, b))
    return np.atleast_1d((one.inv() * other).magnitude())


def pairs(body_map: BodyMap) -> list[tuple[str, str, str]]:
    return [(t.joint, t.orientation_joint, t.body) for t in body_map.targets]


@pytest.fixture(scope="module")
def t_pose() -> HumanMotion:
    """SMPL's mean person in the T-pose, turned to Z up: it looks along -y."""
    names, parents = JOINTS["smpl"], smpl_parents("smpl")
    turn = Rotation.from_matrix([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    positions = turn.apply(mean_joints("smpl", np.zeros(0)))
    for joint, parent in enumerate(parents):
        positions[joint] += positions[parent] if parent >= 0 else 0.0
    quaternions = np.tile(turn.as_quat(scalar_first=True), (1, len(names), 1))
    return HumanMotion("smpl", names, parents, positions[None], quaternions, 30.0, 1.66)


def test_the_t_pose_gives_the_offsets_that_gmr_publishes(g1: Robot, t_pose: HumanMotion):
    body_map = load_map("smplx_to_unitree_g1", g1)
    found = align(t_pose, 0, g1, pairs(body_map), T_POSE)
    assert found.facing == pytest.approx(-np.pi / 2, abs=0.02)
    exact = align(t_pose, 0, g1, pairs(body_map), T_POSE, facing=-np.pi / 2)
    off = angle(exact.rotation_offsets, np.stack([t.rotation_offset for t in body_map.targets]))
    for target, difference in zip(body_map.targets, off, strict=True):
        # Of the hips GMR's are turned by hand.
        assert difference < (np.radians(6.0) if "hip" in target.joint else 1e-3), target.joint
    assert found.misfit < 0.1
    ankle = next(k for k, t in enumerate(body_map.targets) if t.joint == "left_knee")
    assert 0.8 < found.scales[ankle] < 1.1


@pytest.mark.parametrize("turn", [0.0, 0.4, -2.5])
def test_alignment_finds_the_facing_and_does_not_depend_on_it(g1: Robot, turn: float):
    """A person made from the robot itself: the map's own offsets come back, wherever the person faces."""
    body_map = load_map("lafan1_to_unitree_g1", g1)
    qpos = np.zeros((1, 36))
    qpos[0, 3:7] = Rotation.from_euler("z", turn).as_quat(scalar_first=True)
    qpos[0, 7:] = [np.pi / 2 if name.endswith("elbow_joint") else 0.0 for name in g1.joint_names]
    found = align(human_of(g1, body_map, qpos, height=1.8), 0, g1, pairs(body_map), HANGING)
    assert found.facing == pytest.approx(turn, abs=1e-9)
    expected = np.stack([t.rotation_offset for t in body_map.targets])
    np.testing.assert_allclose(angle(found.rotation_offsets, expected), 0.0, atol=1e-7)


@pytest.mark.parametrize(("name", "facing"), [("deepmimic", 0.0), ("cmu", -np.pi / 2), ("xsens", -np.pi / 2)])
def test_the_derived_maps_are_what_their_posture_gives(g1: Robot, name: str, facing: float):
    body_map = load_map(f"{name}_to_unitree_g1", g1)
    person = zero_pose(human_of(g1, body_map, dance(g1, frames=1), height=1.7), "y")
    found = align(person, 0, g1, pairs(body_map), body_map.posture, facing)
    expected = np.stack([t.rotation_offset for t in body_map.targets])
    np.testing.assert_allclose(angle(found.rotation_offsets, expected), 0.0, atol=1e-7)


def test_the_zero_pose_is_the_files_own_skeleton(tmp_path: Path):
    bvh_file(tmp_path / "walk.bvh")
    human = read_human(tmp_path / "walk.bvh")
    posed = zero_pose(human, "y")
    for bone in XSENS[1:]:
        offset = posed.positions[0, posed.index(bone.name)] - posed.positions[0, posed.index(bone.parent)]
        x, y, z = bone.offset
        np.testing.assert_allclose(offset, [x, -z, y], atol=1e-6)
    np.testing.assert_allclose(zero_pose(human, "z").quaternions[0, 0], [1, 0, 0, 0])
    with pytest.raises(MapError, match="expected y or z"):
        zero_pose(human, "x")


def test_the_map_to_talos_is_carried_over(g1: Robot, talos: Robot):
    source = load_map("lafan1_to_unitree_g1", g1)
    target = load_map(TEST_DATA / "talos" / "lafan1_to_talos.toml", talos)
    offsets = np.stack([t.rotation_offset for t in source.targets])
    found = carried_over(offsets, g1, source.bodies, HANGING, talos, target.bodies, {})
    off = angle(found, np.stack([t.rotation_offset for t in target.targets]))
    for t, difference in zip(target.targets, off, strict=True):
        assert difference < (np.radians(11.0) if "leg_left_3" in t.body or "leg_right_3" in t.body else 1e-6), t.body


def test_what_cannot_be_aligned_is_an_error(g1: Robot, t_pose: HumanMotion):
    good = pairs(load_map("smplx_to_unitree_g1", g1))
    with pytest.raises(MapError, match="no frame 5; it has frames 0 to 0"):
        align(t_pose, 5, g1, good, T_POSE)
    with pytest.raises(GmrTrajError, match="no joint 'nose'"):
        align(t_pose, 0, g1, [("nose", "nose", "pelvis")], T_POSE)
    with pytest.raises(RobotError, match="no body 'nose'"):
        align(t_pose, 0, g1, [("pelvis", "pelvis", "nose")], T_POSE)
    with pytest.raises(RobotError, match="no joint 'nose_joint'"):
        align(t_pose, 0, g1, good, {"nose_joint": 1.0})
    with pytest.raises(MapError, match="where the person faces cannot be found"):
        align(t_pose, 0, g1, good[:1], T_POSE)
    with pytest.raises(MapError, match="where the person faces cannot be found"):
        align(replace(t_pose, positions=t_pose.positions * [0, 0, 1]), 0, g1, good, T_POSE)
