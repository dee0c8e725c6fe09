"""The audit against closed forms, MuJoCo's own inverse dynamics, and faults put in on purpose."""

from __future__ import annotations

import json
import time

import mujoco
import numpy as np
import pytest
from conftest import random_configurations
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from verify_setup import FAULTS, squatting, standing, with_fault

from gmr_traj.constants import GRAVITY
from gmr_traj.formats import read_clip
from gmr_traj.kinematics.mujoco_kinematics import base_rotation, to_mujoco
from gmr_traj.metrics.observation import observe
from gmr_traj.metrics.settings import shipped
from gmr_traj.motion import RobotMotion
from gmr_traj.verify.audit import audit
from gmr_traj.verify.contact_forces import pyramid, support
from gmr_traj.verify.contact_points import contact_points
from gmr_traj.verify.derivatives import derivatives
from gmr_traj.verify.inverse_dynamics import demand, inverse_dynamics


def weight(robot):
    return robot.model.body_mass.sum() * GRAVITY


def test_inverse_dynamics_agree_with_mujoco(g1):
    q = random_configurations(g1, 20, seed=3)
    rng = np.random.default_rng(4)
    v, a = rng.normal(size=(20, 35)), 10.0 * rng.normal(size=(20, 35))
    found = inverse_dynamics(g1, q, v, a)
    data = mujoco.MjData(g1.model)
    flags = g1.model.opt.disableflags
    g1.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    try:
        for t in range(20):
            data.qpos[:] = q[t]
            data.qvel[:], data.qacc[:] = to_mujoco(q[t], v[t]), to_mujoco(q[t], a[t])
            mujoco.mj_inverse(g1.model, data)
            np.testing.assert_allclose(found.force[t], data.qfrc_inverse[:3], atol=1e-6)
            np.testing.assert_allclose(found.moment[t], base_rotation(q[t]) @ data.qfrc_inverse[3:6], atol=1e-6)
            np.testing.assert_allclose(found.torque[t], data.qfrc_inverse[6:], atol=1e-6)
    finally:
        g1.model.opt.disableflags = flags


def test_derivatives_of_a_turning_falling_body_are_exact(g1):
    time_, spin = np.arange(12) / 40.0, np.array([0.3, -1.1, 0.7])
    qpos = np.tile(g1.nominal, (12, 1))
    qpos[:, :3] += np.outer(time_, [1.0, 0.5, 2.0]) - np.outer(0.5 * time_**2, [0, 0, GRAVITY])
    start = Rotation.from_quat(g1.nominal[3:7], scalar_first=True)
    qpos[:, 3:7] = (Rotation.from_rotvec(np.outer(time_, spin)) * start).as_quat(scalar_first=True)
    v, a = derivatives(RobotMotion(qpos, 40.0, g1.joint_names))
    np.testing.assert_allclose(v[:, :3], [1.0, 0.5, 2.0] - np.outer(time_, [0, 0, GRAVITY]), atol=1e-9)
    np.testing.assert_allclose(v[:, 3:6], np.tile(spin, (12, 1)), atol=1e-9)
    np.testing.assert_allclose(a[:, :3], np.tile([0, 0, -GRAVITY], (12, 1)), atol=1e-9)
    np.testing.assert_allclose(a[:, 3:], 0.0, atol=1e-9)


def test_a_robot_that_stands_is_carried_by_forces_that_add_up_to_its_weight(g1):
    found = audit(standing(g1), g1)
    np.testing.assert_allclose(found.forces.sum(axis=1), np.tile([0, 0, weight(g1)], (30, 1)), atol=1e-2)
    assert found.residual_force.max() < 1e-4 and found.residual_moment.max() < 1e-4
    assert found.passed and found.share == 0.0 and not found.faults
    assert found.zmp_margin.min() > 0.0
    # At rest the zero-moment point, the centre of pressure and the centre of mass are above one another.
    assert found.com_cop.max() < 1e-4


def test_free_fall_needs_no_force_at_all(g1):
    time_ = np.arange(20) / 50.0
    qpos = np.tile(g1.nominal, (20, 1))
    qpos[:, 2] += 2.0 - 0.5 * GRAVITY * time_**2
    found = audit(RobotMotion(qpos, 50.0, g1.joint_names, g1.name), g1)
    assert found.residual_force.max() < 1e-9 and found.residual_moment.max() < 1e-9
    assert np.abs(found.joint_torque).max() < 1e-9
    assert found.forces.shape[1] == 8 and not found.forces.any()
    assert np.isnan(found.zmp_margin).all() and np.isnan(found.com_cop).all()
    json.dumps(found.to_json(frames=True), allow_nan=False)


def test_hanging_in_the_air_needs_the_whole_weight(g1):
    found = audit(standing(g1).shifted(0.5), g1)
    np.testing.assert_allclose(found.residual_force, 1.0, atol=1e-9)
    assert found.share == 1.0 and not found.passed
    assert "100 % of the frames" in found.failures[0]


@given(st.floats(0.2, 1.5), st.floats(-1.2, 1.2), st.floats(-1.2, 1.2))
@settings(max_examples=25)
def test_forces_stay_within_the_friction_pyramid(g1, friction, x, y):
    """A robot that is pushed sideways: what the floor gives is admissible, the rest is residual, and they add up."""
    motion = standing(g1, 3)
    time_ = np.arange(3) / 50.0
    qpos = motion.qpos.copy()
    qpos[:, :2] += 0.5 * GRAVITY * np.outer((time_ - time_[1]) ** 2, [x, y])
    motion = motion.with_qpos(qpos)
    needed, points = demand(motion, g1), contact_points(observe(motion, g1), shipped("verify_audit"))
    found = support(g1, motion.qpos, needed, points, friction)
    f = found.forces
    assert (f[..., 2] >= 0.0).all()
    assert (np.abs(f[..., :2]).sum(axis=-1) <= friction * f[..., 2] + 1e-9).all()
    np.testing.assert_allclose(f.sum(axis=1) + found.force, needed.force, atol=1e-9)
    arms = points.positions - motion.qpos[:, None, :3]
    np.testing.assert_allclose(np.cross(arms, f).sum(axis=1) + found.moment, needed.moment, atol=1e-9)


def test_joint_torques_follow_from_the_virtual_work_of_the_forces(g1):
    motion = squatting(g1, seconds=0.4)
    needed, points = demand(motion, g1), contact_points(observe(motion, g1), shipped("verify_audit"))
    found = support(g1, motion.qpos, needed, points, 0.8)
    data, t = mujoco.MjData(g1.model), 10
    data.qpos[:] = motion.qpos[t]
    mujoco.mj_kinematics(g1.model, data)
    mujoco.mj_comPos(g1.model, data)
    expected = needed.torque[t].copy()
    for k, body in enumerate(points.bodies):
        jacobian = np.zeros((3, g1.model.nv))
        mujoco.mj_jac(g1.model, data, jacobian, None, points.positions[t, k], int(body) + 1)
        expected -= jacobian[:, 6:].T @ found.forces[t, k]
    np.testing.assert_allclose(found.torque[t], expected, atol=1e-9)


def test_the_pyramid_lies_inside_the_cone():
    edges = pyramid(0.8)
    np.testing.assert_allclose(np.linalg.norm(edges[:, :2], axis=1), 0.8)


def test_a_hand_on_the_floor_carries_and_a_fast_one_does_not(g1):
    """On all fours the hands are candidates."""
    motion = standing(g1, 5)
    qpos = motion.qpos.copy()
    qpos[:, 3:7] = Rotation.from_euler("y", 1.4).as_quat(scalar_first=True)
    lying = motion.with_qpos(qpos)
    lying = lying.shifted(-observe(lying, g1).lowest.min())
    points = contact_points(observe(lying, g1), shipped("verify_audit"))
    assert points.able.any() and len(points.bodies) > 8
    fast = lying.qpos.copy()
    fast[:, 0] += 0.5 / 50.0 * np.arange(5)
    points = contact_points(observe(motion.with_qpos(fast), g1), shipped("verify_audit"))
    assert not points.able.any()


@pytest.mark.parametrize("fault", [fault for fault in FAULTS if fault != "lean"])  # it can stand leaning, too
def test_faults_put_into_a_squat_fail_the_audit(g1, fault):
    clean = squatting(g1)
    assert audit(clean, g1).passed
    found = audit(with_fault(clean, fault), g1)
    assert not found.passed, found.summary()
    if fault == "sunk":
        assert found.faults[0].kind == "depth" and found.faults[0].value > 0.04
    if fault == "spike":
        middle = clean.frames // 2
        assert any(f.start <= middle + 5 and f.stop >= middle for f in found.faults)
        assert found.worst_joint == "waist_roll_joint"


def test_short_clips(g1):
    for frames in (1, 2, 3):
        found = audit(standing(g1, frames), g1)
        assert found.passed and len(found.residual_force) == frames


def test_recorded_walks(data_dir, g1):
    """Unitree's walk passes; one that GMR retargeted, whose feet skate, does not.  Half a millisecond a frame."""
    walk = read_clip(data_dir / "lafan1_unitree_csv" / "walk1_subject1.csv", g1).motion
    walk = walk.with_qpos(walk.qpos[:360])
    start = time.process_time()
    found = audit(walk, g1)
    elapsed = time.process_time() - start
    assert found.passed and found.residual_force.mean() < 0.02
    assert elapsed / 360 < 2e-3, "four times what it takes"
    for fault in FAULTS:
        assert not audit(with_fault(walk, fault), g1).passed, fault
    skating = read_clip(data_dir / "gmr_pkl" / "0807_yanjie_walk_001.pkl", g1).motion
    assert not audit(skating, g1).passed
