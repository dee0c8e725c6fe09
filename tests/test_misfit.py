"""The source's targets: fitted to the robot, tracked, put on the floor."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from conftest import random_configurations
from hypothesis import given
from hypothesis import strategies as st
from metrics_toy import FPS, both_feet, clip, standing
from optimiser_setup import context_of, derivative, kinematics_of, residuals_of, toy
from scipy.spatial.transform import Rotation

from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.contacts.source_level import source_height
from gmr_traj.exceptions import ClipError
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.misfit import _continuous, fitted, smoothed
from gmr_traj.motion import RobotMotion
from gmr_traj.problem import load_problem
from gmr_traj.references import BodyTargets
from gmr_traj.refine import refine
from gmr_traj.residuals import FrameResidual
from gmr_traj.terms.context import stepped
from gmr_traj.terms.tracking import Tracking

TERM = Tracking(position=0.03, orientation=0.15, robust=0.05, source_weight=2.0)
NAMES = ("torso", "left_leg", "hand")
POINTS = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, -1.0], [0.0, 0.02, 0.0]])


def targets_of(motion: RobotMotion, names: tuple[str, ...] = NAMES, points: np.ndarray = POINTS) -> BodyTargets:
    """Where a motion has some points of some bodies."""
    robot = toy()
    p, r = placements(robot, motion.qpos)
    slots = [robot.body_names.index(name) for name in names]
    return BodyTargets(
        names=names,
        positions=p[:, slots] + np.einsum("tbij,bj->tbi", r[:, slots], points),
        quaternions=np.stack([Rotation.from_matrix(r[:, s]).as_quat(scalar_first=True) for s in slots], axis=1),
        position_weights=np.arange(1.0, len(names) + 1),
        orientation_weights=np.arange(len(names), 0.0, -1),
        points=points,
    )


def toy_motion(seed: int, frames: int = 2) -> RobotMotion:
    return RobotMotion(random_configurations(toy(), frames, seed), FPS, toy().joint_names)


def test_tracking_aims_at_the_targets_where_there_are_some() -> None:
    """Value by hand: bodies with a target at its weight, the others at the clip with the frame's trust."""
    centre, target, wanted = toy_motion(1), toy_motion(2), targets_of(toy_motion(3))
    context = replace(context_of(toy(), centre, target=target, trust=np.array([0.1, 0.2])), references=wanted)
    (residual,), _ = residuals_of(TERM, context)
    assert isinstance(residual, FrameResidual) and residual.gauss_newton is not None
    functions = residual.gauss_newton
    steps = np.random.default_rng(0).uniform(-0.3, 0.3, (2, 9))
    p, r = placements(toy(), stepped(centre, steps).qpos)
    target_p, target_r = placements(toy(), target.qpos)
    expected = np.zeros(2)
    for key in toy().key_bodies:
        b = toy().body_names.index(key.body)
        point, at, turned, weight = np.zeros(3), target_p[:, b], target_r[:, b], context.trust
        if key.body in NAMES:
            k = NAMES.index(key.body)
            point, at, weight = POINTS[k], wanted.positions[:, k], np.full(2, 2.0)
            turned = Rotation.from_quat(wanted.quaternions[:, k], scalar_first=True).as_matrix()
        error = np.linalg.norm(p[:, b] + r[:, b] @ point - at, axis=1)
        huber = TERM.robust**2 * (np.sqrt(1 + error**2 / TERM.robust**2) - 1)
        away = (3 - np.einsum("tij,tij->t", r[:, b], turned)) / 2
        expected += weight * key.position_weight * huber / TERM.position**2 / FPS
        expected += weight * key.orientation_weight * away / TERM.orientation**2 / FPS
    assert {key.body for key in toy().key_bodies} & set(NAMES)
    for t, parameters in enumerate(residual.parameters.T):
        value = lambda z, q=parameters: np.array(functions.value(z, q)).ravel()  # noqa: E731
        assert value(steps[t])[0] == pytest.approx(expected[t], rel=1e-9)
        numeric = derivative(value, steps[t])[0]
        gradient = np.array(functions.gradient(steps[t], parameters)).ravel()
        np.testing.assert_allclose(gradient, numeric, atol=1e-5 * np.abs(numeric).max())


def moved_source(motion: RobotMotion) -> BodyTargets:
    """The motion's own bodies, turned and shifted each by its own constant: a misfit that does not change."""
    wanted = targets_of(motion)
    turn = Rotation.from_euler("xyz", [[0.3, 0, 0], [0, -0.2, 0.1], [0, 0, 2.0]])
    turned = [turn[b] * Rotation.from_quat(wanted.quaternions[:, b], scalar_first=True) for b in range(3)]
    return replace(
        wanted,
        positions=wanted.positions + [[0.1, 0, 0], [0, 0, -0.2], [0.02, 0.03, 0]],
        quaternions=np.stack([each.as_quat(scalar_first=True) for each in turned], axis=1),
    )


def test_a_misfit_that_does_not_change_is_taken_out() -> None:
    motion = toy_motion(6, frames=40)
    for trust in (np.ones(40), np.random.default_rng(0).uniform(1e-4, 1, 40)):
        found, own = fitted(moved_source(motion), toy(), motion, trust), targets_of(motion)
        np.testing.assert_allclose(found.positions, own.positions, atol=1e-12)
        same = np.abs((found.quaternions * own.quaternions).sum(axis=-1))
        np.testing.assert_allclose(same, 1.0, atol=1e-12)


def test_a_jump_that_is_not_trusted_leaves_the_targets_with_the_source() -> None:
    human = smooth(60)
    faulty = human.qpos.copy()
    faulty[28:32, 9] -= 1.0
    trust = np.ones(60)
    trust[26:34] = 1e-4
    found = fitted(targets_of(human), toy(), human.with_qpos(faulty), trust)
    np.testing.assert_allclose(found.positions, targets_of(human).positions, atol=1e-3)
    # Trusted, it is spread over some frames, and no longer a jump.
    believed = fitted(targets_of(human), toy(), human.with_qpos(faulty), np.ones(60))
    step = np.abs(np.diff(believed.positions, axis=0)).max()
    assert step < 0.3 * np.abs(np.diff(targets_of(human.with_qpos(faulty)).positions, axis=0)).max()


def test_turns_through_half_a_turn_have_no_seam() -> None:
    """A misfit of about pi has two rotation vectors, of opposite signs; their mean would be nothing."""
    motion = clip(standing(60))
    wanted = targets_of(motion)
    angle = np.pi + 0.2 * np.sin(np.arange(60) / 5)
    turned = Rotation.from_euler("z", angle[:, None]) * Rotation.from_quat(wanted.quaternions[:, 0], scalar_first=True)
    quaternions = wanted.quaternions.copy()
    quaternions[:, 0] = turned.as_quat(scalar_first=True)
    found = fitted(replace(wanted, quaternions=quaternions), toy(), motion, np.ones(60))
    off = Rotation.from_quat(found.quaternions[:, 0], scalar_first=True).magnitude()
    assert off.max() < 0.25


def test_means_are_weighted() -> None:
    values = np.random.default_rng(1).normal(size=(50, 2, 3))
    weights = np.random.default_rng(2).uniform(0.1, 1, 50)
    times = np.arange(50)
    kernel = np.exp(-((times[:, None] - times) ** 2) / (2 * 3.0**2)) * weights
    expected = np.einsum("ts,s...->t...", kernel / kernel.sum(axis=1, keepdims=True), values)
    np.testing.assert_allclose(smoothed(values, weights, 3.0), expected, atol=1e-7)


def test_bodies_that_the_robot_has_not_are_left_out() -> None:
    motion = toy_motion(4, frames=9)
    renamed = replace(targets_of(motion), names=("torso", "tail", "hand"))
    found = fitted(renamed, toy(), motion, np.ones(9))
    assert found.names == ("torso", "hand")
    assert fitted(replace(renamed, names=("trunk", "tail", "paw")), toy(), motion, np.ones(9)).names == ()
    np.testing.assert_allclose(found.positions, renamed.positions[:, [0, 2]], atol=1e-12)


def smooth(frames: int) -> RobotMotion:
    """A toy that stands and moves its arm."""
    qpos = standing(frames)
    qpos[:, 9] = 0.8 + 0.2 * np.sin(2 * np.arange(frames) / FPS)
    return clip(qpos)


def test_the_humans_arm_is_followed_where_the_clip_loses_it() -> None:
    """For a fifth of a second the arm is elsewhere; the human's goes on as fast as it went."""
    qpos = standing(90)
    qpos[:, 9] = 0.5 + 0.5 * np.sin(10 * np.arange(90) / FPS)
    human = clip(qpos)
    faulty = qpos.copy()
    faulty[40:50, 9] = -0.6
    motion, wanted = human.with_qpos(faulty), targets_of(human, ("torso", "arm", "hand"), np.zeros((3, 3)))
    robot = toy()
    off = []
    for references in (None, wanted):
        result = refine(
            motion,
            robot,
            load_problem(),
            schedule=both_feet(90),
            references=references,
            kinematics=kinematics_of(robot),
        )
        assert result.report.status != "not converged"
        off.append(np.abs(result.motion.qpos[:, 9] - qpos[:, 9])[35:55].max())
    assert off[1] < 0.25 and off[1] < 0.5 * off[0]


@pytest.mark.parametrize("hover", [0.0, 0.03, -0.02])
def test_targets_are_put_on_the_floor_by_the_feet_in_stance(hover: float) -> None:
    """In swing, a third of the time, the feet are anywhere."""
    qpos = standing(30)
    qpos[:, 2] += hover
    qpos[20:, 2] += 0.3
    wanted = targets_of(clip(qpos), ("left_leg", "right_leg"), np.zeros((2, 3)))
    stances = tuple(replace(stance, stop=20) for stance in both_feet(30).stances)
    schedule = ContactSchedule(30, FPS, stances, height=0.01)
    assert source_height(wanted, toy(), schedule) == pytest.approx(-hover, abs=1e-12)
    # Nothing to go by: the clip's own height.
    assert source_height(wanted, toy(), ContactSchedule(30, FPS, (), height=0.01)) == 0.01
    free = replace(wanted, position_weights=np.zeros(2))
    assert source_height(free, toy(), schedule) == 0.01


def test_references_of_another_length_are_refused() -> None:
    motion = clip(standing(20))
    with pytest.raises(ClipError, match="references have 10 frames, the clip 20"):
        refine(motion, toy(), load_problem(), references=targets_of(clip(standing(10))))


def test_parts_and_heights_of_targets() -> None:
    wanted = targets_of(toy_motion(5, frames=9))
    parts = [wanted.part(a, b) for a, b in pairwise((0, 4, 9))]
    np.testing.assert_array_equal(np.concatenate([part.positions for part in parts]), wanted.positions)
    np.testing.assert_allclose(wanted.raised(0.1).positions - wanted.positions, [[[0, 0, 0.1]] * 3] * 9, atol=1e-15)


def nearest_to_the_frame_before(turn: np.ndarray) -> np.ndarray:
    """Of the two rotation vectors of each turn the one that is nearer to the vector chosen before it."""
    out = turn.copy()
    for t in range(1, len(turn)):
        for b in range(turn.shape[1]):
            v = turn[t, b]
            other = v * (1.0 - 2.0 * np.pi / max(float(np.linalg.norm(v)), 1e-9))
            out[t, b] = min(v, other, key=lambda x, before=out[t - 1, b]: float(np.linalg.norm(x - before)))
    return out


@given(st.integers(0, 10_000), st.floats(0.05, 2.0))
def test_rotation_vectors_are_continuous_whatever_their_size(seed: int, pace: float) -> None:
    """Bodies that hardly turn, and others that go round and round."""
    walk = (
        pace
        * np.cumsum(np.random.default_rng(seed).normal(size=(30, 4, 3)), axis=0)
        * np.array([0.02, 0.2, 1, 1])[:, None]
    )
    turn = Rotation.from_rotvec(walk.reshape(-1, 3)).as_rotvec().reshape(walk.shape)
    np.testing.assert_array_equal(_continuous(turn), nearest_to_the_frame_before(turn))
