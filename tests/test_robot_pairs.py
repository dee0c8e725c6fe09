"""Which shapes must keep apart."""

from __future__ import annotations

from pathlib import Path

from robot_files import TOML, write_robot

from gmr_traj.robot import Robot
from gmr_traj.robot_loading import load_robot, reduce_robot
from gmr_traj.robot_pairs import joints_apart


def pair_names(robot: Robot) -> set[frozenset[str]]:
    return {frozenset((robot.capsules[i].name, robot.capsules[k].name)) for i, k in robot.collision_pairs}


def test_joints_are_counted_along_the_tree(g1: Robot) -> None:
    def apart(a: str, b: str) -> int:
        return joints_apart(g1.model, g1.model.body(a).id, g1.model.body(b).id)

    assert apart("pelvis", "pelvis") == 0
    assert apart("pelvis", "torso_link") == 3
    assert apart("left_hip_yaw_link", "left_ankle_roll_link") == 3
    assert apart("left_hip_pitch_link", "waist_yaw_link") == 2
    assert apart("left_wrist_yaw_link", "right_ankle_roll_link") == 7 + 3 + 6


def test_near_bodies_are_left_out(tmp_path: Path) -> None:
    names = pair_names(load_robot(write_robot(tmp_path)))
    assert frozenset(("left_thigh", "right_foot")) in names
    assert frozenset(("trunk", "left_foot")) in names
    assert frozenset(("trunk", "left_thigh")) not in names
    wider = pair_names(load_robot(write_robot(tmp_path, TOML.replace("joints = 1", "joints = 2"))))
    assert frozenset(("trunk", "left_foot")) not in wider
    assert frozenset(("left_thigh", "right_foot")) in wider


def test_listed_bodies_are_left_out(tmp_path: Path) -> None:
    listed = '[[collision.ignore]]\nbodies = ["left_foot", "right_foot"]\nreason = "a test"\n'
    before, after = (pair_names(load_robot(write_robot(tmp_path, text))) for text in (TOML, TOML + listed))
    assert before - after == {frozenset(("left_foot", "right_foot"))}


def test_shapes_that_overlap_standing_are_left_out(tmp_path: Path) -> None:
    block = '[[capsules]]\nname = "block"\nbody = "left_thigh"\nstart = [0, -0.2, -0.1]\nradius = 0.05\n[collision]'
    names = pair_names(load_robot(write_robot(tmp_path, TOML.replace("[collision]", block))))
    assert frozenset(("block", "right_thigh")) not in names
    assert frozenset(("block", "right_foot")) in names


def test_locked_bodies_are_no_pair_but_others_stay(g1: Robot) -> None:
    reduced = reduce_robot(g1, [name for name in g1.joint_names if "wrist" not in name])
    gone = pair_names(g1) - pair_names(reduced)
    assert pair_names(reduced) < pair_names(g1)
    forearms = {f"{side}_{part}" for side in ("left", "right") for part in ("forearm", "wrist", "hand", "thumb")}
    assert gone and all(pair <= forearms and len({name.split("_")[0] for name in pair}) == 1 for pair in gone)
