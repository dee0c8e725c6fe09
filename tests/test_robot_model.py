"""Compiling model files: what is added, what is dropped, what is refused."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from robot_files import MJCF, TOML, write_robot

from gmr_traj.exceptions import RobotError
from gmr_traj.robot_loading import load_robot, reduce_robot

URDF = """<robot name="toy">
  <link name="base">
    <inertial><mass value="5"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
  </link>
  {links}
  {joints}
</robot>
"""
LINK = """<link name="{name}">
    <inertial><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>
    <visual><geometry><mesh filename="package://nowhere/{name}.stl"/></geometry></visual>
    <collision><geometry>{shape}</geometry></collision>
  </link>"""
JOINT = """<joint name="{name}" type="{type}"><parent link="{parent}"/><child link="{child}"/><origin xyz="{xyz}"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="50" velocity="10"/></joint>"""


def urdf(shape: str = '<sphere radius="0.03"/>') -> str:
    """A biped whose ankles carry their feet by fixed joints."""
    links, joints = [], []
    for side, y in (("left", 0.1), ("right", -0.1)):
        links += [LINK.format(name=f"{side}_{part}", shape=shape) for part in ("thigh", "shank", "foot")]
        joints += [
            JOINT.format(name=f"{side}_hip", type="revolute", parent="base", child=f"{side}_thigh", xyz=f"0 {y} -0.2"),
            JOINT.format(
                name=f"{side}_ankle", type="revolute", parent=f"{side}_thigh", child=f"{side}_shank", xyz="0 0 -0.4"
            ),
            JOINT.format(
                name=f"{side}_weld", type="fixed", parent=f"{side}_shank", child=f"{side}_foot", xyz="0 0 -0.02"
            ),
        ]
    return URDF.format(links="\n".join(links), joints="\n".join(joints))


def test_world_shapes_actuators_and_keyframes_go(tmp_path: Path) -> None:
    model = load_robot(write_robot(tmp_path)).model
    assert (model.nu, model.nkey) == (0, 0)
    assert "floor" not in {model.geom(g).name for g in range(model.ngeom)}


def test_a_base_without_a_free_joint_gets_one(tmp_path: Path) -> None:
    fixed = MJCF.replace("<freejoint/>", "").replace('qpos="0 0 1 1 0 0 0 ', 'qpos="')
    free, added = load_robot(write_robot(tmp_path)), load_robot(write_robot(tmp_path, model=fixed))
    assert int(added.model.jnt_type[0]) == int(mujoco.mjtJoint.mjJNT_FREE)
    assert added.joint_names == free.joint_names
    assert np.allclose(added.nominal, free.nominal)


def test_urdf_keeps_the_bodies_of_fixed_joints(tmp_path: Path) -> None:
    robot = load_robot(write_robot(tmp_path, TOML.replace("toy.xml", "toy.urdf"), urdf(), "toy.urdf"))
    assert robot.joint_names == ("left_hip", "left_ankle", "right_hip", "right_ankle")
    assert {"left_foot", "right_foot"} <= set(robot.body_names)
    assert robot.model.nq == 11
    assert robot.nominal[2] == pytest.approx(0.2 + 0.4 * np.cos(0.2) + 0.02 + 0.05)


def test_missing_collision_mesh_is_named_or_ignored_on_request(tmp_path: Path) -> None:
    text = urdf('<mesh filename="package://nowhere/solid.stl"/>')
    toml = TOML.replace("toy.xml", "toy.urdf")
    with pytest.raises(RobotError, match=r"body 'left_thigh': collision mesh 'solid' is not found.*mesh_folder"):
        load_robot(write_robot(tmp_path, toml, text, "toy.urdf"))
    robot = load_robot(write_robot(tmp_path, "ignore_missing_meshes = true\n" + toml, text, "toy.urdf"))
    assert robot.capsules == ()


def test_mesh_is_found_in_the_mesh_folder(tmp_path: Path) -> None:
    """A tetrahedron with edges of 6 cm, as a binary STL."""
    corners = np.array([[0, 0, 0], [0.06, 0, 0], [0, 0.06, 0], [0, 0, 0.06]], dtype="<f4")
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    triangles = np.zeros(4, record)
    triangles["corners"] = corners[[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]]
    (tmp_path / "shapes").mkdir()
    content = bytes(80) + np.uint32(4).tobytes() + triangles.tobytes()
    (tmp_path / "shapes" / "solid.stl").write_bytes(content)
    toml = 'mesh_folder = "shapes"\n' + TOML.replace("toy.xml", "toy.urdf")
    text = urdf('<mesh filename="package://nowhere/meshes/solid.stl"/>')
    robot = load_robot(write_robot(tmp_path, toml, text, "toy.urdf"))
    assert len(robot.capsules) == 6
    for capsule in robot.capsules:
        axis = capsule.end - capsule.start
        reach = np.clip((corners - capsule.start) @ axis / max(axis @ axis, 1e-30), 0, 1)
        distance = np.linalg.norm(corners - capsule.start - reach[:, None] * axis, axis=1)
        assert (distance <= capsule.radius + 1e-9).all()


BODY = '<body name="other"><freejoint/><geom type="sphere" size="0.1"/></body>'
FAULTS = {
    "two robots": ("</worldbody>", f"{BODY}</worldbody>", r"holds 2 trees of bodies \(base, other\)"),
    "slide joint": (
        'name="left_hip" type="hinge"',
        'name="left_hip" type="slide"',
        "joint 'left_hip' of body 'left_thigh'",
    ),
    "ball joint": (
        'name="left_hip" type="hinge" axis="0 1 0" range="-1 1"',
        'name="left_hip" type="ball"',
        "joint 'left_hip' of body 'left_thigh'",
    ),
    "two joints in a body": (
        '<joint name="left_ankle"',
        '<joint name="left_roll" axis="1 0 0" range="-1 1"/><joint name="left_ankle"',
        "at most one hinge",
    ),
    "hinge at the base": (
        "<freejoint/>",
        '<joint name="spin" axis="0 0 1" range="-1 1"/>',
        "one free joint at the base",
    ),
    "no range": ('name="left_hip" type="hinge" axis="0 1 0" range="-1 1"', 'name="left_hip" axis="0 1 0"', "no range"),
    "not a model": ("<worldbody>", "<wordbody>", "MuJoCo cannot read it"),
    "no bodies": (MJCF, "<mujoco/>", "holds 0 trees of bodies"),
    "no mass": (
        '<geom name="left_thigh" type="capsule"',
        '<geom mass="0" name="left_thigh" type="capsule"',
        "MuJoCo cannot compile",
    ),
    "a plane on a body": (
        '<geom name="trunk" type="box"',
        '<geom name="trunk" type="plane"',
        "cannot compile|no capsule",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_models_that_are_refused(tmp_path: Path, fault: str) -> None:
    old, new, message = FAULTS[fault]
    assert old in MJCF
    path = write_robot(tmp_path, model=MJCF.replace(old, new, 1))
    with pytest.raises(RobotError, match=message) as caught:
        load_robot(path)
    assert "toy.xml" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_locked_joints_leave_the_bodies(tmp_path: Path) -> None:
    full = load_robot(write_robot(tmp_path))
    reduced = reduce_robot(full, ("right_hip", "left_hip"))
    assert reduced.joint_names == ("left_hip", "right_hip")
    assert reduced.body_names == full.body_names
    assert reduced.model.nq == 9
    assert reduced.model.body_mass.sum() == pytest.approx(full.model.body_mass.sum())
    with pytest.raises(RobotError, match="no joint 'left_knee'; it has left_hip"):
        reduce_robot(full, ("left_knee",))
    with pytest.raises(RobotError, match="no joint 'left_ankle'"):
        reduce_robot(reduced, ("left_ankle",))
    with pytest.raises(RobotError, match="no hinges"):
        reduce_robot(full, ())
