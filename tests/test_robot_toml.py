"""robot.toml, field by field: what is wrong is said in one line that names the file and the field."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from robot_files import TOML, write_robot

from gmr_traj.exceptions import RobotError
from gmr_traj.robot_loading import load_robot
from gmr_traj.robot_toml import read_robot_toml


def test_reads_every_field(tmp_path: Path) -> None:
    file = read_robot_toml(write_robot(tmp_path))
    assert file.name == "toy"
    assert file.model == tmp_path / "toy.xml"
    assert file.joints[0].patterns == ("*_hip", "*_ankle")
    assert (file.joints[0].velocity, file.joints[0].damping) == (10.0, 2.0)
    assert file.nominal == {"*_hip": -0.2, "*_ankle": 0.2}
    assert (file.key_bodies[0].position_weight, file.key_bodies[0].orientation_weight) == (2.0, 1.0)
    assert file.soles[0].parts == ("toe", "toe", "heel", "heel")
    assert file.soles[1].points.shape == (4, 3)
    assert file.ignore_within_joints == 1


SUPPORT = '[[supports]]\nname = "seat"\nshapes = ["trunk"]\n'

# What is changed in a good file, and what the message must say.
FAULTS = {
    "not TOML": ('name = "toy"', "name = toy", "not valid TOML"),
    "missing field": ('anchor_body = "base"\n', "", "has no 'anchor_body'"),
    "misspelt field": ("effort = 50.0", "efort = 50.0", r"\[\[joints\]\] entry 1 has no 'effort'"),
    "unknown field": ("effort = 50.0", "effort = 50.0\ntorque = 1", "unknown field 'torque'"),
    "limit of zero": ("velocity = 10.0", "velocity = 0", "velocity is 0; expected a number above 0"),
    "limit below zero": (
        "acceleration = 100.0",
        "acceleration = -1.0",
        "acceleration is -1.0; expected a number above 0",
    ),
    "infinite limit": ("effort = 50.0", "effort = inf", "effort is inf; expected a number"),
    "limit as text": ("effort = 50.0", 'effort = "50"', "effort is '50'; expected a number"),
    "gain below zero": (
        "stiffness = 40.0",
        "stiffness = -40.0",
        "stiffness is -40.0; expected a number of zero or more",
    ),
    "no joints": ('names = ["*_hip", "*_ankle"]', "names = []", r"names is \[\]; expected a list of names"),
    "joint that is none": (
        'names = ["*_hip",',
        'names = ["hip_left", "*_hip",',
        r"'hip_left' is no joint of toy.xml; it has left_hip",
    ),
    "joint left out": ('names = ["*_hip", "*_ankle"]', 'names = ["*_hip"]', "joint 'left_ankle' is in 0"),
    "joint twice": (
        "[nominal]",
        '[[joints]]\nnames = ["left_hip"]\nvelocity=1\nacceleration=1\neffort=1\nstiffness=1\ndamping=1\n[nominal]',
        "'left_hip' is in 2",
    ),
    "nominal joint that is none": ('"*_ankle" = 0.2', '"*_knee" = 0.2', r"\[nominal\] '\*_knee' is no joint"),
    "nominal twice": ('"*_ankle" = 0.2', '"*_ankle" = 0.2\n"left_ankle" = 0.1', "'left_ankle' 2 values"),
    "nominal out of range": ('"*_ankle" = 0.2', '"*_ankle" = 1.2', r"left_ankle = 1.2 is outside its range -1 .. 1"),
    "anchor that is no body": ('anchor_body = "base"', 'anchor_body = "torso"', "anchor_body: 'torso' is no body"),
    "key body that is none": ('bodies = ["base",', 'bodies = ["chest",', "'chest' is no body"),
    "key body twice": ('bodies = ["base",', 'bodies = ["base", "left_foot",', "body 'left_foot' is in"),
    "sole on no body": ('body = "left_foot"', 'body = "left_toe"', "'left_toe' is no body"),
    "sole that is not flat": ("toe = [[0.1, 0.02, -0.05],", "toe = [[0.1, 0.02, -0.04],", "not in one plane"),
    "point of two numbers": (
        "toe = [[0.1, 0.02, -0.05],",
        "toe = [[0.1, 0.02],",
        r"expected a list of points \[x, y, z\]",
    ),
    "soles of one name": ('name = "right"', 'name = "left"', "the same name"),
    "support and sole of one name": (
        "[collision]",
        SUPPORT.replace("seat", "left") + "[collision]",
        "names of .* must differ; they are left, right, left",
    ),
    "support of no shape": (
        "[collision]",
        SUPPORT.replace('"trunk"', "") + "[collision]",
        r"shapes is \[\]; expected a list of names",
    ),
    "support whose shape is none": (
        "[collision]",
        SUPPORT.replace("trunk", "tail") + "[collision]",
        "no collision shape 'tail'; there are .*trunk",
    ),
    "shape in two supports": (
        "[collision]",
        SUPPORT + SUPPORT.replace("seat", "back") + "[collision]",
        r"\[\[supports\]\] 'back': shape 'trunk' is in 'seat' already",
    ),
    "support under a foot": (
        "[collision]",
        SUPPORT.replace("trunk", "left_foot") + "[collision]",
        "'left_foot' is of 'left_foot', a foot",
    ),
    "negative count": ("within_joints = 1", "within_joints = -1", "expected a whole number"),
    "ignored without reason": (
        "[collision]",
        '[[collision.ignore]]\nbodies = ["base", "left_foot"]\n[collision]',
        "has no 'reason'",
    ),
    "ignored single body": (
        "[collision]",
        '[[collision.ignore]]\nbodies = ["base"]\nreason = "x"\n[collision]',
        "expected two names",
    ),
    "ignored body that is none": (
        "[collision]",
        '[[collision.ignore]]\nbodies = ["base", "tail"]\nreason = "x"\n[collision]',
        "'tail' is no body",
    ),
    "capsule without radius": (
        "[collision]",
        '[[capsules]]\nname = "a"\nbody = "base"\nstart = [0, 0, 0]\n[collision]',
        "no 'radius'",
    ),
    "capsule name taken": (
        "[collision]",
        '[[capsules]]\nname = "left_foot"\nbody = "base"\nstart = [0, 0, 0]\nradius = 0.1\n[collision]',
        "the name 'left_foot'",
    ),
    "capsule under the sole": (
        "[collision]",
        '[[capsules]]\nname = "block"\nbody = "left_foot"\nstart = [0, 0, 0]\nradius = 0.1\n[collision]',
        "'block' of body 'left_foot' reaches 0.0.* m below the sole points",
    ),
    "model that does not exist": ('model = "toy.xml"', 'model = "toys.xml"', "toys.xml does not exist"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_are_named_in_one_line(tmp_path: Path, fault: str) -> None:
    old, new, message = FAULTS[fault]
    assert TOML.count(old) >= 1
    path = write_robot(tmp_path, TOML.replace(old, new, 1))
    with pytest.raises(RobotError, match=message) as caught:
        load_robot(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_supports_are_the_round_ends_of_shapes(tmp_path: Path) -> None:
    supports = SUPPORT.replace('"trunk"', '"trunk", "left_thigh"') + "[collision]"
    robot = load_robot(write_robot(tmp_path, TOML.replace("[collision]", supports, 1)))
    (seat,) = robot.supports
    named = {capsule.name: capsule for capsule in robot.capsules}
    assert seat.bodies == ("base", "base", "left_thigh", "left_thigh")
    for shape, own in (("trunk", slice(0, 2)), ("left_thigh", slice(2, 4))):
        ends = np.unique([named[shape].start, named[shape].end], axis=0)
        np.testing.assert_array_equal(seat.points[own], ends)
        np.testing.assert_array_equal(seat.radii[own], named[shape].radius)
    assert load_robot(write_robot(tmp_path)).supports == ()


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(RobotError, match=r"robot\.toml: cannot be read"):
        load_robot(tmp_path)


def test_model_file_instead_of_robot_toml(tmp_path: Path) -> None:
    write_robot(tmp_path)
    with pytest.raises(RobotError, match=r"toy\.xml: expected a robot\.toml"):
        load_robot(tmp_path / "toy.xml")


def test_own_capsules_replace_the_body_s_shapes(tmp_path: Path) -> None:
    capsule = '[[capsules]]\nname = "shoe"\nbody = "left_foot"\nstart = [0, 0, 0]\nradius = 0.05\n[collision]'
    robot = load_robot(write_robot(tmp_path, TOML.replace("[collision]", capsule)))
    shapes = {c.name: c for c in robot.capsules}
    assert "left_foot" not in shapes
    assert "right_foot" in shapes
    assert np.array_equal(shapes["shoe"].start, shapes["shoe"].end)
