"""Meshes of the links, where a package or the model itself has them."""

from __future__ import annotations

import shutil
from importlib import metadata

import numpy as np
import pytest
from conftest import example_robot_file

from gmr_traj.exceptions import RobotError
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.link_meshes import link_meshes
from gmr_traj.metrics.capsules import point_segment_distance
from gmr_traj.robot import Robot
from gmr_traj.robot_loading import load_robot


def outside(robot: Robot) -> np.ndarray:
    """How far each vertex, of the standing robot, is outside the closest collision shape [m]."""
    positions, rotations = placements(robot, robot.nominal[None])
    place = {name: i for i, name in enumerate(robot.body_names)}
    world = [
        positions[0, place[mesh.body]] + mesh.vertices[::40] @ rotations[0, place[mesh.body]].T
        for mesh in link_meshes(robot)
    ]
    points = np.concatenate(world)
    least = np.full(len(points), np.inf)
    for capsule in robot.capsules:
        R, p = rotations[0, place[capsule.body]], positions[0, place[capsule.body]]
        ends = [np.broadcast_to(p + R @ end, points.shape) for end in (capsule.start, capsule.end)]
        least = np.minimum(least, point_segment_distance(points.copy(), *ends) - capsule.radius)
    return least


def test_meshes_of_the_g1_are_where_its_shapes_are(g1):
    example_robot_file("g1_29dof_rev_1_0.urdf")  # or skip
    assert {mesh.body for mesh in link_meshes(g1)} == set(g1.body_names)
    found = outside(g1)
    assert (found < 0.016).mean() > 0.98 and found.max() < 0.03  # as robot.toml says of its shapes


def test_meshes_of_a_model_are_its_own(talos):
    found = link_meshes(talos)
    assert len(found) > 30 and {mesh.body for mesh in found} <= set(talos.body_names)
    assert np.quantile(outside(talos), 0.99) < 0.02


def test_normals_point_outwards(g1):
    example_robot_file("g1_29dof_rev_1_0.urdf")
    mesh = next(m for m in link_meshes(g1) if m.body == "torso_link")
    assert mesh.faces.max() < len(mesh.vertices) == len(mesh.normals)
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-3)
    corners = mesh.vertices[mesh.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    agree = np.einsum("fi,fi->f", across, mesh.normals[mesh.faces[:, 0]]) > 0.0
    assert agree[np.linalg.norm(across, axis=1) > 1e-9].mean() > 0.85  # a few of its panels have two sides


def test_without_the_package_there_are_none(g1, monkeypatch):
    def absent(name: str) -> None:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "files", absent)
    assert link_meshes(g1) == ()


def test_looks_that_are_not_there_are_named(g1, tmp_path):
    example_robot_file("g1_29dof_rev_1_0.urdf")
    shutil.copytree(g1.path.parent, tmp_path / "robot")
    path = tmp_path / "robot" / "robot.toml"
    path.write_text(path.read_text().replace("g1_29dof_rev_1_0.urdf", "nothing.urdf"))
    with pytest.raises(RobotError, match=r"robot\.toml: \[looks\] .* has no file nothing\.urdf"):
        link_meshes(load_robot(path))
    path.write_text(path.read_text().replace('package = "example-robot-data"', "packages = 3"))
    with pytest.raises(RobotError, match=r"\[looks\] has no 'package'"):
        load_robot(path)
