"""MuJoCo, Pinocchio and finite differences agree about placements, Jacobians and dynamics."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from conftest import random_configurations
from robot_files import MJCF, write_robot

from gmr_traj.exceptions import RobotError
from gmr_traj.kinematics import mujoco_kinematics, pinocchio_model
from gmr_traj.robot import Robot
from gmr_traj.robot_loading import load_robot, reduce_robot

TOLERANCE = 1e-9


@pytest.fixture(params=["g1", "g1 without wrists", "talos", "joints off their bodies"])
def robot(request: pytest.FixtureRequest, tmp_path: Path) -> Robot:
    if request.param == "joints off their bodies":  # anchors, oblique axes and angles at which the file shows the robot
        text = MJCF.replace(
            'name="left_hip" type="hinge" axis="0 1 0"', 'name="left_hip" pos="0.1 0.2 0.3" axis="1 2 3"'
        )
        text = text.replace('name="right_hip" type="hinge"', 'name="right_hip" pos="0 0 0.1" ref="0.3"')
        return load_robot(write_robot(tmp_path, model=text))
    if request.param == "talos":
        robot: Robot = request.getfixturevalue("talos")
        return robot
    g1: Robot = request.getfixturevalue("g1")
    if request.param == "g1 without wrists":
        return reduce_robot(g1, [name for name in g1.joint_names if "wrist" not in name])
    return g1


def frames(model: pin.Model, robot: Robot, q: np.ndarray) -> list[pin.SE3]:
    data = model.createData()
    pin.framesForwardKinematics(model, data, pinocchio_model.to_configuration(q))
    return [data.oMf[model.getFrameId(name, pin.FrameType.BODY)] for name in robot.body_names]


def test_placements_agree(robot: Robot) -> None:
    model = pinocchio_model.build(robot)
    configurations = random_configurations(robot, 20, seed=2)
    positions, rotations = mujoco_kinematics.placements(robot, configurations)
    for t, q in enumerate(configurations):
        for b, T_world_body in enumerate(frames(model, robot, q)):
            assert np.abs(T_world_body.translation - positions[t, b]).max() < TOLERANCE
            assert np.abs(T_world_body.rotation - rotations[t, b]).max() < TOLERANCE


def test_jacobians_agree(robot: Robot) -> None:
    model = pinocchio_model.build(robot)
    for q in random_configurations(robot, 3, seed=3):
        for body in robot.body_names:
            ours = mujoco_kinematics.body_jacobian(robot, q, body)
            assert ours.shape == (6, 6 + robot.dof)
            assert np.abs(ours - pinocchio_model.body_jacobian(model, q, body)).max() < TOLERANCE


def test_jacobian_is_the_derivative_of_the_placement(robot: Robot) -> None:
    """Central differences along every tangent direction, in the stated convention: world linear, world angular."""
    step = 1e-5
    q = random_configurations(robot, 1, seed=4)[0]
    tangents = np.vstack([np.eye(6 + robot.dof), np.random.default_rng(0).normal(size=(3, 6 + robot.dof))])
    there = np.array([mujoco_kinematics.integrate(robot, q, v, sign * step) for v in tangents for sign in (1, -1)])
    positions, rotations = mujoco_kinematics.placements(robot, there)
    for b, body in enumerate(robot.body_names):
        expected = mujoco_kinematics.body_jacobian(robot, q, body) @ tangents.T  # (6, directions)
        linear = (positions[::2, b] - positions[1::2, b]) / (2 * step)
        turned = rotations[::2, b] @ rotations[1::2, b].transpose(0, 2, 1)  # about world axes
        angular = np.array([pin.log3(r) for r in turned]) / (2 * step)
        assert np.abs(np.hstack([linear, angular]).T - expected).max() < 1e-7


def test_integration_turns_the_base_about_world_axes(g1: Robot) -> None:
    q = random_configurations(g1, 1, seed=5)[0]
    omega = np.array([0.3, -0.2, 0.5])
    v = np.concatenate([[1, 2, 3], omega, np.ones(g1.dof)])
    out = mujoco_kinematics.integrate(g1, q, v)
    assert out[:3] == pytest.approx(q[:3] + [1, 2, 3])
    assert out[7:] == pytest.approx(q[7:] + 1)
    before, after = (mujoco_kinematics.base_rotation(x) for x in (q, out))
    assert np.abs(after - pin.exp3(omega) @ before).max() < 1e-12


def test_tangents_convert(g1: Robot) -> None:
    """Pinocchio's integration along the converted tangent arrives where ours does, to second order."""
    model = pinocchio_model.build(g1)
    q = random_configurations(g1, 1, seed=6)[0]
    v = np.random.default_rng(1).normal(size=6 + g1.dof) * 1e-5
    ours = mujoco_kinematics.integrate(g1, q, v)
    theirs = pin.integrate(model, pinocchio_model.to_configuration(q), pinocchio_model.tangent_map(q) @ v)
    assert np.abs(ours - pinocchio_model.from_configuration(theirs)).max() < 1e-9
    assert np.array_equal(pinocchio_model.from_configuration(pinocchio_model.to_configuration(q)), q)


def test_inertia_and_gravity_agree(robot: Robot) -> None:
    """The joint-space inertia matrix and the gravity torques, armature included."""
    model = pinocchio_model.build(robot)
    data, theirs = mujoco.MjData(robot.model), model.createData()
    for q in random_configurations(robot, 3, seed=7):
        data.qpos[:], data.qvel[:] = q, 0
        mujoco.mj_forward(robot.model, data)
        inverse = np.zeros((robot.model.nv, robot.model.nv))
        mujoco.mj_solveM(robot.model, data, inverse, np.eye(robot.model.nv))
        # From MuJoCo's tangent (world linear, base angular) to Pinocchio's (both in base axes).
        C = np.eye(robot.model.nv)
        C[:3, :3] = mujoco_kinematics.base_rotation(q).T
        configuration = pinocchio_model.to_configuration(q)
        M = pin.crba(model, theirs, configuration)
        M = np.triu(M) + np.triu(M, 1).T
        product = C.T @ M @ C @ inverse
        assert np.abs(product - np.eye(robot.model.nv)).max() < 1e-6
        gravity = C.T @ pin.computeGeneralizedGravity(model, theirs, configuration)
        assert gravity == pytest.approx(data.qfrc_bias, abs=1e-8)
    assert pin.computeTotalMass(model) == pytest.approx(robot.model.body_mass.sum())


def test_limits_come_along(g1: Robot) -> None:
    model = pinocchio_model.build(g1)
    assert np.array_equal(model.lowerPositionLimit[7:], g1.position_lower)
    assert np.array_equal(model.upperPositionLimit[7:], g1.position_upper)
    assert np.array_equal(model.velocityLimit[6:], g1.velocity_limit)
    assert np.array_equal(model.effortLimit[6:], g1.effort_limit)


def test_unknown_bodies_are_named(g1: Robot) -> None:
    with pytest.raises(RobotError, match="no body 'tail'; it has pelvis"):
        mujoco_kinematics.body_jacobian(g1, g1.nominal, "tail")
    with pytest.raises(RobotError, match="no body 'tail'"):
        pinocchio_model.body_jacobian(pinocchio_model.build(g1), g1.nominal, "tail")
