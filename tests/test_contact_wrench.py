"""The wrench three frames need: against Pinocchio, finite differences, free fall; and the rows that bound it."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from metrics_toy import FPS, clip, standing
from optimiser_setup import context_of, kinematics_of, residuals_of, toy

from gmr_traj.constants import GRAVITY
from gmr_traj.contacts.schedule import ContactSchedule, Stance
from gmr_traj.contacts.support import edges
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.motion import RobotMotion
from gmr_traj.residuals import FrameResidual
from gmr_traj.robot import Robot
from gmr_traj.terms.centroidal import FOOT, wrench
from gmr_traj.terms.contact_wrench import ContactWrench
from gmr_traj.terms.stance_support import hinges, leg, weight_torques
from gmr_traj.verify.inverse_dynamics import demand, inverse_dynamics

TERM = ContactWrench(force=0.05, moment=0.05, torque=0.02, robust=3.0, friction=0.7, margin=0.01, effort=0.75)


def swinging(robot: Robot, frames: int, fps: float) -> RobotMotion:
    """All joints and the base swing, each at a pace of its own, with up to 10 rad/s."""
    rng = np.random.default_rng(3)
    t = np.arange(frames)[:, None] / fps
    pace, phase = rng.uniform(3.0, 9.0, robot.dof), rng.uniform(0.0, 6.0, robot.dof)
    qpos = np.tile(robot.nominal, (frames, 1))
    qpos[:, 7:] += 0.2 * np.sin(pace * t + phase)
    qpos[:, :3] += 0.1 * np.sin(np.array([4.0, 5.0, 6.0]) * t)
    angle = 0.3 * np.sin(5.0 * t[:, 0])
    qpos[:, 3:7] = np.stack([np.cos(angle / 2), np.sin(angle / 2), 0 * angle, 0 * angle], axis=1)
    return RobotMotion(qpos, fps, robot.joint_names)


def needed(robot: Robot, motion: RobotMotion, t: int, origin: np.ndarray) -> np.ndarray:
    value, _ = wrench(kinematics_of(robot))
    feet = np.zeros(FOOT * len(robot.soles))
    q, k = motion.qpos[t - 1 : t + 2].ravel(), motion.fps**2 / GRAVITY
    return np.array(value(np.zeros(3 * (6 + robot.dof)), q, origin, k, feet)).ravel()


def test_wrench_is_that_of_inverse_dynamics(g1: Robot) -> None:
    motion = swinging(g1, 40, 240.0)
    weight = float(g1.model.body_mass.sum()) * GRAVITY
    found = demand(motion, g1)
    origin = np.array([0.2, -0.1, 0.0])
    for t in (5, 17, 33):
        moment = found.moment[t] + np.cross(motion.qpos[t, :3] - origin, found.force[t])
        expected = np.concatenate([found.force[t], moment]) / weight
        # Bodies of next to no inertia are points here; what is left is the step of time.
        np.testing.assert_allclose(needed(g1, motion, t, origin), expected, atol=2e-3)


def test_jacobian_is_the_derivative(g1: Robot) -> None:
    value, jacobian = wrench(kinematics_of(g1))
    rng = np.random.default_rng(0)
    motion = swinging(g1, 3, 30.0)
    z, feet = 0.05 * rng.normal(size=3 * (6 + g1.dof)), rng.normal(size=FOOT * len(g1.soles))
    rest = (motion.qpos.ravel(), np.array([0.1, 0.2, 0.0]), 3.0, feet)
    exact = np.array(jacobian(z, *rest))
    for i in range(0, len(z), 4):
        h = np.zeros(len(z))
        h[i] = 1e-6
        numeric = (np.array(value(z + h, *rest)) - np.array(value(z - h, *rest))).ravel() / 2e-6
        np.testing.assert_allclose(exact[:, i], numeric, atol=1e-6 * max(1.0, np.abs(numeric).max()))


def test_free_fall_needs_nothing(g1: Robot) -> None:
    fps = 30.0
    qpos = np.tile(g1.nominal, (3, 1))
    qpos[:, 2] += 1.0 - 0.5 * GRAVITY * (np.arange(3) / fps) ** 2
    qpos[:, 0] += 2.0 * np.arange(3) / fps
    motion = RobotMotion(qpos, fps, g1.joint_names)
    np.testing.assert_allclose(needed(g1, motion, 1, np.zeros(3)), 0.0, atol=1e-9)


def test_the_moment_goes_with_the_feet(g1: Robot) -> None:
    motion = swinging(g1, 3, 30.0)
    value, _ = wrench(kinematics_of(g1))
    sole = g1.soles[0]
    z, k = np.zeros(3 * (6 + g1.dof)), 900.0 / GRAVITY
    feet = np.zeros((len(g1.soles), FOOT))
    at = needed(g1, motion, 1, np.zeros(3))
    feet[0] = [1.0, *sole.points[0], 0.0, 0.0]
    moved = np.array(value(z, motion.qpos.ravel(), np.zeros(3), k, feet.ravel())).ravel()
    np.testing.assert_allclose(moved[:3], at[:3])
    # The foot is expected at the world's origin, so the moment is about where it is.
    positions, rotations = placements(g1, motion.qpos[1:2])
    slot = g1.body_names.index(sole.body)
    point = positions[0, slot] + rotations[0, slot] @ sole.points[0]
    np.testing.assert_allclose(moved[3:], at[3:] - np.cross([point[0], point[1], 0.0], at[:3]), atol=1e-12)


def test_weight_torques_are_static_inverse_dynamics(g1: Robot) -> None:
    motion = swinging(g1, 6, 30.0)
    still = np.zeros((6, 6 + g1.dof))
    expected = inverse_dynamics(g1, motion.qpos, still, still).torque
    placed = context_of(g1, motion).placements
    found = weight_torques(g1, placed, *hinges(g1, placed))
    np.testing.assert_allclose(found * float(g1.model.body_mass.sum()) * GRAVITY, expected, atol=1e-9)


def test_leg_is_six_joints_from_the_foot_up(g1: Robot) -> None:
    names = [g1.joint_names[j] for j in leg(g1, "left_ankle_roll_link")]
    assert names[0] == "left_ankle_roll_joint" and names[-1] == "left_hip_pitch_joint" and len(names) == 6


@pytest.mark.parametrize("count", [1, 2, 4])
def test_edges_enclose_the_points(count: int) -> None:
    points = np.array([[0.3, 0.1], [0.5, 0.3], [0.3, 0.3], [0.5, 0.1]])[:count]
    normals, offsets = edges(points, 0.01)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
    inside = normals @ points.T - offsets[:, None]
    assert inside.min() >= (-1e-9 if count == 4 else 0.01 - 1e-9)
    assert (normals @ (points.mean(axis=0) + [0.5, 0.0]) - offsets).min() < 0.0
    assert len(normals) == 4


def whole_stance(frames: int, robot: Robot, soles: tuple[str, ...]) -> ContactSchedule:
    stances = [
        Stance(sole.name, k, part, 0, frames)
        for sole in robot.soles
        if sole.name in soles
        for k, part in enumerate(sole.parts)
    ]
    return ContactSchedule(frames, FPS, tuple(sorted(stances)))


def cost(motion: RobotMotion, robot: Robot, schedule: ContactSchedule, term: ContactWrench = TERM) -> np.ndarray:
    (residual,), variables = residuals_of(term, context_of(robot, motion, schedule=schedule))
    assert isinstance(residual, FrameResidual) and residual.gauss_newton is not None
    x = variables.initial()
    value = residual.gauss_newton.value.map(len(residual.frames))
    return np.array(value(x[residual.columns].T, residual.parameters)).ravel() * FPS


def test_standing_costs_nothing_and_leaning_does(g1: Robot) -> None:
    qpos = np.tile(g1.nominal, (5, 1))
    names = tuple(sole.name for sole in g1.soles)
    both = whole_stance(5, g1, names)
    still = RobotMotion(qpos, FPS, g1.joint_names)
    np.testing.assert_allclose(cost(still, g1, both), 0.0, atol=1e-12)
    # On one foot the centre of mass is beside it.
    assert cost(still, g1, whole_stance(5, g1, names[:1])).min() > 0.1
    # Nothing there to stand on, and no fall: the whole weight is missing.
    e = 1.0 / TERM.force
    alone = cost(still, g1, ContactSchedule(5, FPS, ()))
    assert alone.min() >= TERM.robust**2 * (np.sqrt(1 + (e / TERM.robust) ** 2) - 1) - 1e-9


def test_gradient_and_hessian(g1: Robot) -> None:
    rng = np.random.default_rng(1)
    motion = swinging(g1, 5, FPS)
    schedule = whole_stance(5, g1, (g1.soles[0].name,))
    (residual,), _ = residuals_of(TERM, context_of(g1, motion, schedule=schedule))
    assert isinstance(residual, FrameResidual) and residual.gauss_newton is not None
    functions, p = residual.gauss_newton, residual.parameters[:, 1]
    z = 0.01 * rng.normal(size=residual.columns.shape[1])
    gradient = np.array(functions.gradient(z, p)).ravel()
    for i in range(0, len(z), 5):
        h = np.zeros(len(z))
        h[i] = 1e-6
        numeric = float(functions.value(z + h, p) - functions.value(z - h, p)) / 2e-6
        assert gradient[i] == pytest.approx(numeric, rel=1e-4, abs=1e-5 * np.abs(gradient).max())
    upper = np.array(ca.DM(functions.hessian(z, p)))
    hessian = upper + np.triu(upper, 1).T
    assert np.linalg.eigvalsh(hessian).min() > -1e-6 * np.abs(hessian).max()


def test_a_robot_with_other_feet_and_too_short_a_clip() -> None:
    robot = toy()
    schedule = ContactSchedule(4, FPS, (Stance("left", 0, "toe", 0, 4),))
    (residual,), _ = residuals_of(TERM, context_of(robot, clip(standing(4)), schedule=schedule))
    np.testing.assert_array_equal(residual.frames, [1, 2])
    assert residuals_of(TERM, context_of(robot, clip(standing(2))))[0] == []


def test_what_stances_do_not_explain_has_no_rows(g1: Robot) -> None:
    frames = 30
    still = RobotMotion(np.tile(g1.nominal, (frames, 1)), FPS, g1.joint_names)
    np.testing.assert_array_equal(cost(still, g1, ContactSchedule(frames, FPS, ())), 0.0)
    # Lying: the whole robot is on the floor, whatever the feet do.
    qpos = np.tile(g1.nominal, (5, 1))
    qpos[:, 2:7] = [0.1, np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0]
    lying = RobotMotion(qpos, FPS, g1.joint_names)
    np.testing.assert_array_equal(cost(lying, g1, whole_stance(5, g1, (g1.soles[0].name,))), 0.0)
