"""Human-to-robot maps: those that ship, files that are wrong, and writing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import TEST_DATA

from gmr_traj import resources
from gmr_traj.exceptions import GmrTrajError, MapError, ResourceError
from gmr_traj.formats.human.rigs import rigs
from gmr_traj.retarget.body_map import default_map_name, load_map, map_names
from gmr_traj.retarget.joint_ranges import joint_limits
from gmr_traj.retarget.map_writing import to_toml
from gmr_traj.robot import Robot
from gmr_traj.robot_loading import reduce_robot

RANGES = "gmr_ranges_unitree_g1"


@pytest.mark.parametrize("name", map_names())
def test_every_shipped_map_loads_and_names_joints_of_its_rigs(g1: Robot, name: str):
    body_map = load_map(name, g1)
    for rig in body_map.rigs:
        joints = rigs()[rig].joints
        for target in body_map.targets:
            assert {target.joint, target.orientation_joint} <= set(joints)
    lefts = {body for body in body_map.bodies if body.startswith("left")}
    assert {body.replace("left", "right") for body in lefts} <= set(body_map.bodies)


@pytest.mark.parametrize("rig", ["lafan1", "smplx", "smpl", "deepmimic", "cmu", "xsens"])
def test_every_rig_has_a_map_to_the_g1(rig: str):
    assert default_map_name(rig, "unitree_g1") in map_names()


def test_published_figures_are_there(g1: Robot):
    lafan1, smplx = load_map("lafan1_to_unitree_g1", g1), load_map("smplx_to_unitree_g1", g1)
    foot = next(t for t in lafan1.targets if t.joint == "LeftFoot")
    assert (foot.orientation_joint, foot.scale, foot.stage_one, foot.stage_two) == ("LeftToe", 0.9, (50, 10), (50, 10))
    np.testing.assert_allclose(lafan1.costs(2)[:, 0].tolist(), [100, 10, 10, 50, 10, 10, 50, 0, 5, 10, 10, 5, 10, 10])
    np.testing.assert_allclose(
        lafan1.costs(1)[:, 1].tolist(), [10, 10, 10, 10, 10, 10, 10, 100, 100, 10, 10, 100, 10, 10]
    )
    toe = next(t for t in smplx.targets if t.joint == "right_foot")
    np.testing.assert_allclose(toe.point, [0.1, 0, -0.02])
    np.testing.assert_allclose(toe.position_offset, [0, -0.02, 0])
    lower, upper = joint_limits(g1, lafan1.joint_ranges)
    at = g1.joint_names.index
    assert (lower[at("right_shoulder_yaw_joint")], upper[at("right_shoulder_yaw_joint")]) == (-2.0, 1.4)
    assert (lower[at("left_knee_joint")], upper[at("left_knee_joint")]) == (
        g1.position_lower[at("left_knee_joint")],
        g1.position_upper[at("left_knee_joint")],
    )


def test_a_robot_with_locked_joints_keeps_the_map(g1: Robot):
    reduced = reduce_robot(g1, [name for name in g1.joint_names if "wrist" not in name])
    assert load_map("lafan1_to_unitree_g1", reduced).bodies == load_map("lafan1_to_unitree_g1", g1).bodies


def test_the_map_to_talos_loads(talos: Robot):
    assert load_map(TEST_DATA / "talos" / "lafan1_to_talos.toml", talos).root_target.body == "base_link"


@pytest.mark.parametrize(("rig", "robot"), [("lafan1", "talos"), ("unknown", "unitree_g1"), ("kinect", "unitree_g1")])
def test_no_map_is_an_error_that_lists_them(rig: str, robot: str):
    with pytest.raises(MapError, match=r"no map .*cmu_to_unitree_g1, .*--map") as error:
        default_map_name(rig, robot)
    assert ("not known" if rig == "unknown" else rig) in str(error.value)


def test_an_unknown_name_lists_the_maps(g1: Robot):
    with pytest.raises(ResourceError, match=r"nowhere: no such file, and no map.*lafan1_to_unitree_g1"):
        load_map("nowhere", g1)


HEAD = 'rigs = ["own"]\nrobot = "unitree_g1"\nroot = "hips"\nhuman_height = 1.8\n'
TARGET = """
[[targets]]
joint = "hips"
body = "pelvis"
scale = 0.9
rotation_offset = [1, 0, 0, 0]
stage_one = { position = 0, orientation = 10 }
stage_two = { position = 100, orientation = 5 }
"""


def write(path: Path, old: str = "", new: str = "") -> Path:
    text = HEAD + TARGET
    assert old in text
    path.write_text(text.replace(old, new, 1))
    return path


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("rigs", "rig", "has no 'rigs'"),
        ('"unitree_g1"', '"talos"', "is a map to robot 'talos', not to 'unitree_g1'"),
        (
            'root = "hips"',
            'root = "pelvis"',
            r"root is 'pelvis', which is the joint of 0 \[\[targets",
        ),
        ("human_height = 1.8", "human_height = 0", "human_height is 0; expected a number above 0"),
        ("human_height = 1.8", "human_height = 1.8\nheight = 2", "unknown field 'height'"),
        ('body = "pelvis"', 'body = "tail"', r"hips -> tail: robot unitree_g1 has no body 'tail'; it has pelvis"),
        ("scale = 0.9", "", r"hips -> pelvis: has no 'scale'"),
        ("scale = 0.9", "scale = -1", "scale is -1; expected a number above 0"),
        ("[1, 0, 0, 0]", "[1, 0, 0]", r"expected a quaternion \[w, x, y, z\] of length 1"),
        ("[1, 0, 0, 0]", "[0.7, 0, 0, 0]", "expected a quaternion"),
        ("[1, 0, 0, 0]", '["a", 0, 0, 0]', "expected a quaternion"),
        ("rotation_offset = [1, 0, 0, 0]", "", "has no 'rotation_offset'"),
        ("position = 0,", "position = -1,", r"stage_one position is -1\S*; expected a number of zero or more"),
        ("position = 0,", "", "stage_one has no 'position'"),
        ("position = 0, orientation = 10", "position = 0, orientation = 0", "all costs of stage_one are zero"),
        ("scale = 0.9", "scale = 0.9\npoint = [1]", r"point is \[1\]; expected a point"),
        ("scale = 0.9", "scale = 0.9\nsclae = 1", "unknown field 'sclae'"),
        ("[[targets]]", TARGET + "[[targets]]", "gives body 'pelvis' two targets"),
        ("human_height = 1.8", 'human_height = 1.8\njoint_ranges = "none"', "none: no such file"),
        ("human_height = 1.8", 'human_height = 1.8\n[posture]\nx = "a"', r"x is 'a'; expected a number"),
        ("human_height = 1.8", "human_height = ", "is not valid TOML"),
    ],
)
def test_a_wrong_file_is_one_clear_line(tmp_path: Path, g1: Robot, old: str, new: str, message: str):
    path = write(tmp_path / "own.toml", old, new)
    with pytest.raises(GmrTrajError, match=message) as error:
        load_map(path, g1)
    assert "\n" not in str(error.value)
    assert "own.toml" in str(error.value) or "none" in str(error.value)


def test_files_that_cannot_be_read_are_errors(tmp_path: Path, g1: Robot):
    with pytest.raises(MapError, match="cannot be read"):
        load_map(tmp_path, g1)
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(MapError, match="not valid TOML"):
        load_map(tmp_path / "binary.toml", g1)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('robot = "talos"\n[ranges]\n', "joint ranges of robot 'talos', not of 'unitree_g1'"),
        ('robot = "unitree_g1"\n[ranges]\nelbow = [0, 1]\n', "'elbow' is no joint of unitree_g1; it has left_hip"),
        ('robot = "unitree_g1"\n[ranges]\n"*_knee_joint" = [1, 0]\n', r"expected \[lower, upper\] in rad"),
        ('robot = "unitree_g1"\n[ranges]\n"*_knee_joint" = [1]\n', r"expected \[lower, upper\] in rad"),
        ('robot = "unitree_g1"\n[ranges]\n"*_knee_joint" = [5, 6]\n', "nothing of its own range"),
        ('robot = "unitree_g1"\n[ranges]\n"*_knee_joint" = [0, 1]\nleft_knee_joint = [0, 1]\n', "two ranges"),
    ],
)
def test_wrong_joint_ranges_are_errors(tmp_path: Path, g1: Robot, text: str, message: str):
    (tmp_path / "narrow.toml").write_text(text)
    path = write(tmp_path / "own.toml", "human_height = 1.8", 'human_height = 1.8\njoint_ranges = "narrow.toml"')
    with pytest.raises(MapError, match=message):
        load_map(path, g1)


def test_a_draft_needs_no_rotation_offsets(tmp_path: Path, g1: Robot):
    path = write(tmp_path / "own.toml", "rotation_offset = [1, 0, 0, 0]\n", "")
    np.testing.assert_array_equal(load_map(path, g1, draft=True).targets[0].rotation_offset, [1, 0, 0, 0])


@pytest.mark.parametrize("name", map_names())
def test_what_is_written_is_read(tmp_path: Path, g1: Robot, name: str):
    before = load_map(name, g1)
    (tmp_path / f"{name}.toml").write_text(to_toml(before, comment="two\nlines", joint_ranges=RANGES))
    after = load_map(tmp_path / f"{name}.toml", g1)
    for a, b in zip(before.targets, after.targets, strict=True):
        assert (a.joint, a.orientation_joint, a.body, a.scale) == (b.joint, b.orientation_joint, b.body, b.scale)
        assert (a.stage_one, a.stage_two) == (b.stage_one, b.stage_two)
        for field in ("point", "position_offset", "rotation_offset"):
            np.testing.assert_allclose(getattr(a, field), getattr(b, field), atol=1e-8)
    assert (before.rigs, before.root, before.human_height) == (after.rigs, after.root, after.human_height)
    assert (before.joint_ranges, before.posture) == (after.joint_ranges, after.posture)


def test_names_with_quotes_are_written_as_toml(tmp_path: Path, g1: Robot):
    path = write(tmp_path / "own.toml", 'rigs = ["own"]', "rigs = ['a \"b\" \\ c']")
    body_map = load_map(path, g1)
    path.write_text(to_toml(body_map, comment=""))
    assert load_map(path, g1).rigs == ('a "b" \\ c',)


def test_method_files_are_found():
    for name in ("retarget_gmr", "retarget_gmr_code", RANGES):
        assert resources.find("configs", name).is_file()
