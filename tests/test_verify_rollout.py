"""Plant, rules, figures and controllers of tracking rollouts."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from conftest import random_configurations
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from verify_setup import squatting, standing

from gmr_traj.exceptions import ResourceError
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.resources import folder
from gmr_traj.verify.audit import audit
from gmr_traj.verify.conditions import Sensing, load_conditions
from gmr_traj.verify.controller import OpenLoop
from gmr_traj.verify.disturbance import Disturbance
from gmr_traj.verify.estimator import Estimator
from gmr_traj.verify.mpc import PRESETS, Mpc, correcting_joints, hats
from gmr_traj.verify.plant import Plant
from gmr_traj.verify.reference import CONTROL, reference
from gmr_traj.verify.residuals import rotation_difference
from gmr_traj.verify.rollout import plant_model, roll_out, starting_state
from gmr_traj.verify.simulated_robot import described_motors, simulation_model
from gmr_traj.verify.tracking import Rules, tracking
from gmr_traj.verify.trials import Choice, Job, run_jobs
from gmr_traj.verify.warnings_off import no_log_file


@pytest.fixture(scope="module")
def plant(g1):
    drive = described_motors(g1)
    return Plant(plant_model(g1, drive, load_conditions("sim").plant), drive.velocity)


def test_the_plant_is_the_robot_with_motors(g1, plant):
    model = plant.model
    np.testing.assert_allclose(model.body_mass, g1.model.body_mass)
    np.testing.assert_allclose(model.body_inertia, g1.model.body_inertia)
    np.testing.assert_allclose(model.actuator_gainprm[:, 0], g1.stiffness)
    np.testing.assert_allclose(model.actuator_biasprm[:, 2], -g1.damping)
    np.testing.assert_allclose(model.dof_armature, g1.model.dof_armature)
    assert [model.actuator(k).name for k in range(model.nu)] == list(g1.joint_names)
    assert model.opt.timestep == 0.005


def test_torques_and_speeds_stay_within_limits(g1, plant):
    """A target far away, the robot in the air: full torque, until the joint is as fast as its motor can be."""
    high = g1.nominal + np.eye(g1.model.nq)[2] * 50.0
    plant.reset(high, np.zeros(35))
    wrist = g1.joint_names.index("left_wrist_yaw_joint")
    plant.model.jnt_limited[wrist + 1] = 0
    target = g1.nominal[7:].copy()
    target[wrist] = 500.0
    fastest, marked = 0.0, False
    try:
        for _ in range(50):
            plant.advance(target)
            assert np.abs(plant.data.actuator_force[wrist]) <= g1.effort_limit[wrist] + 1e-9
            fastest = max(fastest, plant.data.qvel[6 + wrist])
            marked |= plant.over_speed
    finally:
        plant.model.jnt_limited[wrist + 1] = 1
    # One step of full torque on the joint's armature at most past the limit.
    over = g1.effort_limit[wrist] / g1.model.dof_armature[6 + wrist] * 0.005
    assert g1.velocity_limit[wrist] < fastest < g1.velocity_limit[wrist] + over
    assert marked


@no_log_file()
def test_a_simulation_that_diverges_is_noticed(g1, plant):
    plant.reset(g1.nominal, np.zeros(35))
    plant.advance(np.full(29, np.nan))
    assert plant.diverged
    plant.reset(g1.nominal, np.zeros(35))
    assert not plant.diverged
    plant.data.qvel[:3] = 1e12
    plant.advance(g1.nominal[7:])
    assert plant.diverged


def test_the_rules_of_falling(g1):
    rules = Rules(g1)
    ends = {g1.body_names[i] for i in rules.ends}
    assert ends == {f"{side}_{body}_link" for side in ("left", "right") for body in ("ankle_roll", "wrist_yaw")}
    assert g1.body_names[rules.anchor] == "torso_link"

    def verdict(qpos):
        positions, rotations = placements(g1, np.stack([qpos, g1.nominal]))
        return rules.broken(positions[0], rotations[0], positions[1], rotations[1])

    def moved(height=0.0, pitch=0.0):
        qpos = g1.nominal.copy()
        qpos[2] += height
        qpos[3:7] = Rotation.from_euler("y", pitch).as_quat(scalar_first=True)
        return qpos

    assert verdict(moved(0.24)) == "" and verdict(moved(-0.26)) == "anchor height off by 0.26 m"
    # From upright, 0.8 of projected gravity is arccos(0.2): 78.5 degrees.  The torso stays at its height meanwhile.
    torso = placements(g1, moved()[None])[0][0, rules.anchor]
    for pitch, expected in ((np.arccos(0.22), ""), (np.arccos(0.18), "anchor's projected gravity off by 0.82")):
        tilted = moved(pitch=pitch)
        tilted[:3] += torso - placements(g1, tilted[None])[0][0, rules.anchor]
        assert verdict(tilted) == expected
    assert verdict(np.full_like(g1.nominal, np.nan)) == "the simulation diverged"


def test_figures_of_a_shift_and_of_a_bent_joint(g1):
    wanted = np.tile(g1.nominal, (5, 1))
    none = np.zeros(5, dtype=bool)

    def figures(qpos, reason=""):
        rest = {"tick": CONTROL, "ticks": 9, "reason": reason, "saturated": none, "over_speed": none}
        return tracking(g1, qpos, wanted, **rest)

    shifted = figures(wanted + 0.03 * np.eye(36)[0] + 0.04 * np.eye(36)[1])
    assert shifted.g_mpbpe == pytest.approx(50.0) and shifted.mpbpe == pytest.approx(0.0, abs=1e-9)
    assert shifted.mpjpe == 0.0 and shifted.success and shifted.success_full and shifted.fell is None
    bent = wanted.copy()
    bent[:, 7:9] += 0.03, -0.04
    found = figures(bent, "anchor height off by 0.30 m")
    assert found.mpjpe == pytest.approx(70.0 / 29) and found.mpjpe_norm == pytest.approx(50.0)
    assert not found.success and found.fell == pytest.approx(0.1) and found.alive == pytest.approx(0.08)
    raised = wanted.copy()
    raised[2, 7 + g1.joint_names.index("left_shoulder_pitch_joint")] -= 2.5
    assert figures(raised).success and not figures(raised).success_full


@given(st.integers(0, 30))
def test_splines_are_linear_between_knots_and_shift_exactly_by_knots(step):
    knots = np.array([0, 6, 16, 36, 72])
    weights = hats(knots, np.array([step]))
    assert weights.sum() == pytest.approx(1.0)
    assert (weights @ (2.0 * knots + 1.0)).item() == pytest.approx(2.0 * step + 1.0)
    # A knot moves nothing before the knot in front of it: its rollouts begin there.
    basis = hats(knots, np.arange(72))
    for k in range(2, 5):
        assert not basis[: knots[k - 1] + 1, k].any() and basis[knots[k - 1] + 1, k] > 0.0


def test_the_difference_of_orientations(g1):
    a, b = (random_configurations(g1, 50, seed=seed)[:, 3:7] for seed in (1, 2))
    b = a + 0.02 * b
    b /= np.linalg.norm(b, axis=1, keepdims=True)
    turn = Rotation.from_quat(a, scalar_first=True).inv() * Rotation.from_quat(b, scalar_first=True)
    np.testing.assert_allclose(rotation_difference(a, b), turn.as_rotvec(), atol=1e-5)
    np.testing.assert_allclose(rotation_difference(a, -b), turn.as_rotvec(), atol=1e-5)


def test_legs_and_waist_correct(g1):
    names = {g1.joint_names[j] for j in correcting_joints(g1)}
    assert len(names) == 15 and all(any(part in name for part in ("hip", "knee", "ankle", "waist")) for name in names)


def test_the_reference_keeps_the_torques_that_hold_the_robot(g1):
    found = reference(standing(g1, 11), g1)
    assert found.ticks == 11 and len(found.q) == 21 + 100
    assert not found.v.any()
    knee = g1.joint_names.index("left_knee_joint")
    assert found.torque[0, knee] < -5.0, "bent knees carry the weight"
    # With the feed-forward, open-loop PD stands still where it would sag without.
    rollout = roll_out(reference(standing(g1, 26), g1), OpenLoop(), load_conditions("sim"))
    assert rollout.tracking.success and rollout.tracking.mpjpe < 20.0


@pytest.fixture(scope="module")
def squat_rollouts(g1):
    wanted = reference(squatting(g1, seconds=1.0), g1)
    return [roll_out(wanted, Mpc(g1, PRESETS["A"], threads), load_conditions("sim")) for threads in (1, 2)]


def test_mpc_follows_a_squat_the_same_with_one_thread_and_two(squat_rollouts):
    one, two = squat_rollouts
    assert one.tracking.success and one.tracking.success_full and one.controller == "mpc A"
    assert one.tracking.g_mpbpe < 25.0
    np.testing.assert_array_equal(one.motion.qpos, two.motion.qpos)
    assert one.tracking == two.tracking


def test_a_measurement_without_noise_and_delay_is_the_state_and_a_late_one_is_predicted(g1):
    drive = described_motors(g1)
    quiet = {"position": 0, "orientation": 0, "linear_velocity": 0, "angular_velocity": 0}
    quiet |= {"joint_position": 0, "joint_velocity": 0}
    for latency, tolerance in ((0, 1e-12), (1, 5e-3)):
        believed = simulation_model(g1, drive, step=0.01, friction=0.8, point_feet=True)
        exact = Sensing(**quiet, latency=latency, blend=1.0)
        estimator = Estimator(believed, exact, np.random.default_rng(0))
        plant = Plant(plant_model(g1, drive, load_conditions("sim").plant), drive.velocity)
        plant.reset(g1.nominal + np.eye(36)[2], np.eye(35)[0])  # thrown through the air, where both models agree
        target, held, errors = g1.nominal[7:] + 0.1, None, []
        for _ in range(8):
            q, _ = estimator.update(plant.data.qpos, plant.data.qvel, held)
            errors.append(np.abs(q - plant.data.qpos).max())
            held = target
            plant.advance(held)
        assert max(errors[latency + 1 :]) < tolerance


def test_the_floor_s_forces_are_those_that_move_the_robot(g1, plant):
    """Newton's second law of the whole robot: what the floor gives less its weight is what its momentum changes by."""
    bodies = [int(plant.model.body(name).id) for name in g1.body_names]
    plant.reset(g1.nominal, np.zeros(35))
    points, forces = plant.contact_forces(bodies)
    momentum, impulse, mass = [], np.zeros(3), plant.model.body_mass.sum()
    for _ in range(20):
        mujoco.mj_subtreeVel(plant.model, plant.data)
        momentum.append(mass * plant.data.subtree_linvel[1].copy())
        mujoco.mj_step1(plant.model, plant.data)
        mujoco.mj_step2(plant.model, plant.data)
        points, forces = plant.contact_forces(bodies)
        impulse += plant.model.opt.timestep * (forces.sum(axis=0) + mass * plant.model.opt.gravity)
    mujoco.mj_subtreeVel(plant.model, plant.data)
    change = mass * plant.data.subtree_linvel[1] - momentum[0]
    np.testing.assert_allclose(impulse, change, atol=0.05 * mass * 9.81 * 20 * plant.model.opt.timestep)
    feet = [g1.body_names.index(sole.body) for sole in g1.soles]
    assert (forces[feet, 2] > 50).all() and np.abs(points[feet, 2]).max() < 0.01
    others = np.delete(np.arange(len(bodies)), feet)
    assert not forces[others].any()
    np.testing.assert_array_equal(points[others], plant.data.xpos[np.array(bodies)[others]])


def test_trials_differ_by_their_seed_alone(g1):
    ranges = load_conditions("sim-dr").randomise
    draws = [Disturbance(g1, ranges, np.random.default_rng(seed)) for seed in (3, 3, 4)]
    assert draws[0].friction == draws[1].friction != draws[2].friction
    assert (np.abs(draws[0].com) <= ranges.anchor_com).all() and 0.3 <= draws[0].friction <= 1.2
    model = plant_model(g1, described_motors(g1), load_conditions("sim-dr").plant)
    draws[0].change(model)
    assert model.body_mass.sum() == pytest.approx(draws[0].mass * g1.model.body_mass.sum())
    data = mujoco.MjData(model)
    draws[0].push(data, 0.5)
    assert not data.qvel.any(), "the first push comes after a second at the earliest"
    draws[0].push(data, 3.1)
    assert data.qvel[:6].all() and (np.abs(data.qvel[:3]) <= ranges.push_linear).all()


def test_the_default_start_stands_where_the_clip_begins(g1):
    qpos = squatting(g1).qpos[20:].copy()
    qpos[:, :2] += 3.0, 4.0
    turned = Rotation.from_euler("ZY", [2.0, 0.1]).as_quat(scalar_first=True)
    qpos[:, 3:7] = turned
    q, v = starting_state(reference(standing(g1).with_qpos(qpos), g1), "default")
    np.testing.assert_allclose(q[:2], qpos[0, :2])
    np.testing.assert_allclose(q[7:], g1.nominal[7:])
    np.testing.assert_allclose(Rotation.from_quat(q[3:7], scalar_first=True).as_euler("zyx"), [2.0, 0, 0], atol=1e-9)
    assert not v.any()


def test_results_do_not_depend_on_the_number_of_workers(g1):
    motion, conditions = squatting(g1, seconds=0.4), load_conditions("sim2sim")
    jobs = [Job(g1.path, motion, conditions, Choice("pd"), (5, trial)) for trial in range(2)]
    one, two = run_jobs(jobs, 1), run_jobs(jobs, 2)
    assert [rollout.tracking for rollout in one] == [rollout.tracking for rollout in two]
    assert all(np.array_equal(a.motion.qpos, b.motion.qpos) for a, b in zip(one, two, strict=True))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("step = 0.005", "step = 0.003", r"\[plant\] step is 0.003 s; it must divide the control tick"),
        ("step = 0.005", "step = 'x'", "expected a number"),
        ('"implicitfast"', '"rk9"', "integrator is 'rk9'; there are euler, implicitfast"),
        ("mass = 0.05", "mass = 2.0", "expected a share below 1"),
        ("friction = [0.3, 1.2]", "friction = [1.2, 0.3]", r"expected \[lowest, highest\]"),
        ("[randomise]", "[randomize]", "has the unknown field 'randomize'"),
        ("joint_offset", "joint_ofset", "has no 'joint_offset'"),
        ("[0.5, 0.5, 0.2]", "[0.5, -0.5, 0.2]", "half ranges are zero or more"),
    ],
)
def test_wrong_conditions_are_named(tmp_path, old, new, message):
    text = (folder("configs") / "verify_sim_dr.toml").read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "mine.toml"
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(ResourceError, match=message):
        load_conditions(path)


def test_shipped_conditions():
    assert [load_conditions(name).random for name in ("sim", "sim-dr", "sim2sim")] == [False, True, True]
    with pytest.raises(ResourceError, match="no config of that name"):
        load_conditions("storm")


@pytest.mark.slow
def test_mpc_follows_a_recorded_walk(data_dir, g1):
    """The promise of the reference figures: no fall, E_g at most 40 mm."""
    from gmr_traj.formats import read_clip

    walk = read_clip(data_dir / "lafan1_unitree_csv" / "walk1_subject1.csv", g1).motion
    wanted = reference(walk.with_qpos(walk.qpos[150:300]), g1)
    found = roll_out(wanted, Mpc(g1, PRESETS["A"]), load_conditions("sim")).tracking
    assert found.success and found.success_full and found.g_mpbpe < 40.0
    assert not roll_out(wanted, OpenLoop(), load_conditions("sim")).tracking.success


def test_another_robot(talos):
    """Talos, from a URDF with meshes: audited, simulated and followed by what its robot.toml says."""
    still = standing(talos, 16)
    assert audit(still, talos).passed
    wanted = reference(still, talos)
    for controller in (OpenLoop(), Mpc(talos, PRESETS["A"])):
        followed = roll_out(wanted, controller, load_conditions("sim")).tracking
        assert followed.success and followed.g_mpbpe < 30.0
