"""A second humanoid, from another maker's URDF: nothing in the package knows the G1."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
from conftest import example_robot_file, random_configurations

from gmr_traj.kinematics import mujoco_kinematics
from gmr_traj.robot import Robot
from gmr_traj.robot_loading import load_robot, reduce_robot


def test_loads_from_its_file_and_its_folder(talos: Robot, talos_toml: Path) -> None:
    assert load_robot(talos_toml.parent).joint_names == talos.joint_names
    assert talos.dof == 32
    assert talos.model.nq == 7 + 32
    assert talos.path == talos_toml
    assert {"left_sole_link", "imu_link"} <= set(talos.body_names)  # fixed to their parents in the URDF
    assert [sole.name for sole in talos.soles] == ["left", "right"]
    for array in (talos.position_lower, talos.velocity_limit, talos.acceleration_limit, talos.stiffness):
        assert array.shape == (32,)


def test_stands_on_its_soles(talos: Robot) -> None:
    positions, rotations = mujoco_kinematics.placements(talos, talos.nominal[None])
    for sole in talos.soles:
        b = talos.body_names.index(sole.body)
        assert np.abs((positions[0, b] + sole.points @ rotations[0, b].T)[:, 2]).max() < 1e-9


def test_kinematics_agree_with_pinocchio_s_own_reading_of_the_urdf(talos: Robot) -> None:
    urdf = pin.buildModelFromUrdf(str(example_robot_file("talos_reduced.urdf")), pin.JointModelFreeFlyer())
    data = urdf.createData()
    for q in random_configurations(talos, 5, seed=1):
        configuration = pin.neutral(urdf)
        configuration[:3], configuration[3:7] = q[:3], np.roll(q[3:7], -1)
        for name, value in zip(talos.joint_names, q[7:], strict=True):
            configuration[urdf.joints[urdf.getJointId(name)].idx_q] = value
        pin.framesForwardKinematics(urdf, data, configuration)
        positions, rotations = mujoco_kinematics.placements(talos, q[None])
        for b, name in enumerate(talos.body_names):
            T_world_body = data.oMf[urdf.getFrameId(name)]
            assert np.abs(T_world_body.translation - positions[0, b]).max() < 1e-9
            assert np.abs(T_world_body.rotation - rotations[0, b]).max() < 1e-9


def test_capsules_cover_its_meshes(talos: Robot) -> None:
    model = talos.model
    by_name = {c.name: c for c in talos.capsules}
    checked = 0
    for g in range(model.ngeom):
        body = model.body(int(model.geom_bodyid[g])).name
        capsule = by_name.get(f"{body}_shape{g}")
        if capsule is None or int(model.geom_type[g]) != int(mujoco.mjtGeom.mjGEOM_MESH):
            continue
        mesh, rotation = int(model.geom_dataid[g]), np.empty(9)
        mujoco.mju_quat2Mat(rotation, model.geom_quat[g])
        first = int(model.mesh_vertadr[mesh])
        vertices = model.mesh_vert[first : first + int(model.mesh_vertnum[mesh])]
        points = model.geom_pos[g] + vertices @ rotation.reshape(3, 3).T
        axis = capsule.end - capsule.start
        along = np.clip((points - capsule.start) @ axis / max(float(axis @ axis), 1e-30), 0, 1)
        assert (np.linalg.norm(points - capsule.start - along[:, None] * axis, axis=1) < capsule.radius + 1e-6).all()
        checked += 1
    assert checked > 30


def test_pairs_leave_out_the_listed_and_keep_the_legs_apart(talos: Robot) -> None:
    bodies = {frozenset((talos.capsules[i].body, talos.capsules[k].body)) for i, k in talos.collision_pairs}
    assert frozenset(("base_link", "leg_left_4_link")) not in bodies
    assert frozenset(("base_link", "leg_right_4_link")) in bodies
    assert frozenset(("leg_left_6_link", "leg_right_6_link")) in bodies


def test_joints_can_be_locked(talos: Robot) -> None:
    legs = [name for name in talos.joint_names if name.startswith("leg_")]
    reduced = reduce_robot(talos, legs)
    assert reduced.joint_names == tuple(legs)
    assert reduced.body_names == talos.body_names
    assert len(reduced.nominal) == 7 + 12
