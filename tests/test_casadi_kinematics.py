"""CasADi's kinematics against MuJoCo, Pinocchio, SciPy and closed forms."""

from __future__ import annotations

from pathlib import Path

import casadi as ca
import mujoco
import numpy as np
import pinocchio as pin
import pytest
from conftest import random_configurations
from hypothesis import given
from hypothesis import strategies as st
from robot_files import MJCF, write_robot
from scipy.spatial.transform import Rotation

from gmr_traj.kinematics import mujoco_kinematics, pinocchio_model
from gmr_traj.kinematics.casadi_kinematics import CasadiKinematics, exp_so3, hinge_rotation, rotation_from_quaternion
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot
from gmr_traj.robot_loading import load_robot, reduce_robot
from gmr_traj.terms.composite import left_jacobian
from gmr_traj.terms.context import stepped

TOLERANCE = 1e-9
W = ca.SX.sym("w", 3)
EXP = ca.Function("exp", [W], [exp_so3(W), ca.jacobian(ca.vec(exp_so3(W)), W)])
LEFT = ca.Function("left", [W], [left_jacobian(W), ca.jacobian(ca.vec(left_jacobian(W)), W)])
DIRECTION = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1)
ANGLE = st.one_of(st.floats(0, 20), st.floats(0, 1e-3), st.sampled_from([0.0, 1e-12, 1e-4, np.pi, 2 * np.pi]))


@pytest.fixture(params=["g1", "g1 with 23 joints", "talos", "joints off their bodies"])
def robot(request: pytest.FixtureRequest, tmp_path: Path) -> Robot:
    if request.param == "joints off their bodies":
        text = MJCF.replace(
            'name="left_hip" type="hinge" axis="0 1 0"', 'name="left_hip" pos="0.1 0.2 0.3" axis="1 2 3"'
        )
        return load_robot(
            write_robot(
                tmp_path,
                model=text.replace('name="right_hip" type="hinge"', 'name="right_hip" pos="0 0 0.1" ref="0.3"'),
            )
        )
    if request.param == "talos":
        talos: Robot = request.getfixturevalue("talos")
        return talos
    g1: Robot = request.getfixturevalue("g1")
    if request.param == "g1 with 23 joints":
        missing = ("wrist_pitch", "wrist_yaw", "waist_roll", "waist_pitch")
        return reduce_robot(g1, [name for name in g1.joint_names if not any(part in name for part in missing)])
    return g1


def symbolic(robot: Robot) -> ca.Function:
    """(v, q) -> positions (3B), rotations (9B), and the derivatives of both by v; axes and centres of the hinges."""
    kinematics = CasadiKinematics(robot)
    v, q = ca.SX.sym("v", 6 + robot.dof), ca.SX.sym("q", 7 + robot.dof)
    at = kinematics.placements(v, q)
    positions, rotations = ca.vertcat(*at.positions), ca.vertcat(*[ca.vec(r.T) for r in at.rotations])
    outputs = [positions, rotations, ca.jacobian(positions, v), ca.jacobian(rotations, v)]
    return ca.Function("placements", [v, q], [*outputs, ca.horzcat(*at.axes), ca.horzcat(*at.centres)], {"cse": True})


def angular(rotation: np.ndarray, derivative: np.ndarray) -> np.ndarray:
    """World angular velocity Jacobian, ``vee(dR R')``, of a rotation whose derivative is (9, n) row by row."""
    spin = np.einsum("ijn,kj->ikn", derivative.reshape(3, 3, -1), rotation)
    return np.stack([spin[2, 1], spin[0, 2], spin[1, 0]])


def test_placements_and_jacobians_agree_with_mujoco_and_pinocchio(robot: Robot) -> None:
    function, model = symbolic(robot), pinocchio_model.build(robot)
    theirs, data = model.createData(), mujoco.MjData(robot.model)
    bodies = len(robot.body_names)
    for q in random_configurations(robot, 3, seed=11):
        out = [np.array(ca.densify(part)) for part in function(np.zeros(6 + robot.dof), q)]
        positions, rotations = out[0].reshape(bodies, 3), out[1].reshape(bodies, 3, 3)
        expected_positions, expected_rotations = mujoco_kinematics.placements(robot, q[None])
        assert np.abs(positions - expected_positions[0]).max() < TOLERANCE
        assert np.abs(rotations - expected_rotations[0]).max() < TOLERANCE
        pin.framesForwardKinematics(model, theirs, pinocchio_model.to_configuration(q))
        for b, body in enumerate(robot.body_names):
            T_world_body = theirs.oMf[model.getFrameId(body, pin.FrameType.BODY)]
            assert np.abs(T_world_body.translation - positions[b]).max() < TOLERANCE
            assert np.abs(T_world_body.rotation - rotations[b]).max() < TOLERANCE
            jacobian = np.vstack([out[2][3 * b : 3 * b + 3], angular(rotations[b], out[3][9 * b : 9 * b + 9])])
            assert np.abs(jacobian - mujoco_kinematics.body_jacobian(robot, q, body)).max() < TOLERANCE
            assert np.abs(jacobian - pinocchio_model.body_jacobian(model, q, body)).max() < TOLERANCE
        data.qpos[:] = q
        mujoco.mj_kinematics(robot.model, data)
        assert np.abs(out[4] - data.xaxis[1:].T).max() < TOLERANCE
        assert np.abs(out[5] - data.xanchor[1:].T).max() < TOLERANCE


def test_placements_and_jacobians_away_from_the_reference(robot: Robot) -> None:
    """At ``q (+) v`` with a large v: the placements of the stepped motion, the Jacobian through the left Jacobian."""
    function, rng = symbolic(robot), np.random.default_rng(12)
    bodies, size = len(robot.body_names), 6 + robot.dof
    for q in random_configurations(robot, 3, seed=13):
        v = rng.uniform(-1.5, 1.5, size)
        there = stepped(RobotMotion(q[None], 30.0, robot.joint_names), v[None]).qpos[0]
        out = [np.array(ca.densify(part)) for part in function(v, q)]
        positions, rotations = mujoco_kinematics.placements(robot, there[None])
        assert np.abs(out[0].reshape(bodies, 3) - positions[0]).max() < TOLERANCE
        assert np.abs(out[1].reshape(bodies, 3, 3) - rotations[0]).max() < TOLERANCE
        along = np.eye(size)
        along[3:6, 3:6] = np.array(LEFT(v[3:6])[0])
        for b, body in enumerate(robot.body_names):
            expected = mujoco_kinematics.body_jacobian(robot, there, body) @ along
            assert np.abs(out[2][3 * b : 3 * b + 3] - expected[:3]).max() < TOLERANCE
            assert np.abs(angular(rotations[0, b], out[3][9 * b : 9 * b + 9]) - expected[3:]).max() < TOLERANCE


@given(DIRECTION, ANGLE)
def test_exponential_and_left_jacobian(direction: tuple[float, ...], angle: float) -> None:
    w = angle * np.array(direction) / np.linalg.norm(direction)
    rotation, by_w = (np.array(part) for part in EXP(w))
    left, left_by_w = (np.array(part) for part in LEFT(w))
    np.testing.assert_allclose(rotation, Rotation.from_rotvec(w).as_matrix(), atol=1e-12)
    np.testing.assert_allclose(left, pin.Jexp3(-w), atol=1e-9)  # Pinocchio has the right one: J_l(w) = J_r(-w)
    assert np.isfinite(by_w).all() and np.isfinite(left_by_w).all()
    # dR = [J_l dw] R for every direction dw.
    spin = np.einsum("ijn,kj->ikn", by_w.reshape(3, 3, 3).transpose(1, 0, 2), rotation)
    np.testing.assert_allclose(np.stack([spin[2, 1], spin[0, 2], spin[1, 0]]), left, atol=1e-8)


@given(DIRECTION, st.floats(1e-6, 3))
def test_derivatives_by_finite_differences(direction: tuple[float, ...], angle: float) -> None:
    w, step = angle * np.array(direction) / np.linalg.norm(direction), 1e-6
    for function in (EXP, LEFT):
        numeric = [(np.array(function(w + h)[0]) - np.array(function(w - h)[0])) / (2 * step) for h in step * np.eye(3)]
        expected = np.stack([change.ravel(order="F") for change in numeric], axis=1)
        np.testing.assert_allclose(np.array(function(w)[1]), expected, atol=1e-7)


def test_branches_meet_where_the_series_takes_over() -> None:
    """On both sides of the switch at 1e-4 rad: values and derivatives differ by no more than the step does."""
    below, above = np.array([0.0, 0.6, 0.8]) * (1e-4 - 1e-9), np.array([0.0, 0.6, 0.8]) * (1e-4 + 1e-9)
    for function in (EXP, LEFT):
        for one, other in zip(function(below), function(above), strict=True):
            np.testing.assert_allclose(np.array(one), np.array(other), atol=1e-7)


@given(DIRECTION, st.floats(-7, 7))
def test_hinges_and_quaternions(direction: tuple[float, ...], angle: float) -> None:
    axis = np.array(direction) / np.linalg.norm(direction)
    expected = Rotation.from_rotvec(angle * axis)
    np.testing.assert_allclose(np.array(ca.DM(hinge_rotation(axis, angle))), expected.as_matrix(), atol=1e-12)
    quaternion = ca.DM(expected.as_quat(scalar_first=True))
    np.testing.assert_allclose(np.array(rotation_from_quaternion(quaternion)), expected.as_matrix(), atol=1e-12)


def test_hinges_keep_the_zeros_of_their_axis() -> None:
    """A joint about y leaves the zeros of its rotation structural: they cost nothing in the problem."""
    rotation = hinge_rotation(np.array([0.0, 1.0, 0.0]), ca.SX.sym("angle"))
    assert rotation.nnz() == 5
