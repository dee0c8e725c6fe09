"""The source's targets: their cost in numbers, their place in the problem, their height."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from conftest import random_configurations
from metrics_toy import FPS, both_feet, clip, standing
from optimiser_setup import context_of, derivative, kinematics_of, residuals_of, toy
from scipy.spatial.transform import Rotation

from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.contacts.source_level import source_height
from gmr_traj.exceptions import ClipError
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.motion import RobotMotion
from gmr_traj.problem import load_problem
from gmr_traj.references import BodyTargets
from gmr_traj.refine import refine
from gmr_traj.residuals import FrameResidual
from gmr_traj.terms.context import stepped
from gmr_traj.terms.source_tracking import SourceTracking
from gmr_traj.terms.tracking import Tracking

TERM = SourceTracking(position=0.06, orientation=0.15, robust=0.5)
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


def test_value_and_derivatives() -> None:
    centre, wanted = toy_motion(1), targets_of(toy_motion(2))
    context = replace(context_of(toy(), centre, trust=np.array([0.1, 0.2])), references=wanted)
    (residual,), _ = residuals_of(TERM, context)
    assert isinstance(residual, FrameResidual) and residual.gauss_newton is not None
    steps = np.random.default_rng(0).uniform(-0.3, 0.3, (2, 9))
    reached = targets_of(stepped(centre, steps))
    error = np.linalg.norm(reached.positions - wanted.positions, axis=-1)
    huber = 0.5**2 * (np.sqrt(1 + error**2 / 0.5**2) - 1)
    turn = [
        (Rotation.from_quat(reached.quaternions[:, b]) * Rotation.from_quat(wanted.quaternions[:, b]).inv()).magnitude()
        for b in range(3)
    ]
    # (3 - tr R) / 2 = 1 - cos of the angle of R.
    away = 1 - np.cos(np.stack(turn, axis=1))
    expected = huber @ wanted.position_weights**2 / 0.06**2 + away @ wanted.orientation_weights**2 / 0.15**2
    for t, p in enumerate(residual.parameters.T):
        value = lambda z, p=p: np.array(residual.gauss_newton.value(z, p)).ravel()  # noqa: E731
        assert value(steps[t])[0] == pytest.approx(expected[t] / FPS, rel=1e-9)
        numeric = derivative(value, steps[t])[0]
        gradient = np.array(residual.gauss_newton.gradient(steps[t], p)).ravel()
        np.testing.assert_allclose(gradient, numeric, atol=1e-5 * np.abs(numeric).max())


def test_without_targets_there_is_nothing_and_with_them_the_clip_counts_less() -> None:
    motion = toy_motion(3)
    context = context_of(toy(), motion)
    assert residuals_of(TERM, context)[0] == []
    term = Tracking(position=0.03, orientation=0.15, robust=0.05, beside_source=0.25)
    away = np.full(9, 0.1)
    costs = []
    for known in (context, replace(context, references=targets_of(motion))):
        (residual,), _ = residuals_of(term, known)
        assert isinstance(residual, FrameResidual) and residual.gauss_newton is not None
        costs.append(float(residual.gauss_newton.value(away, residual.parameters[:, 0])))
    assert costs[1] == pytest.approx(0.25 * costs[0])


def test_bodies_that_the_robot_has_not_are_left_out() -> None:
    motion = toy_motion(4)
    known = targets_of(motion)
    renamed = replace(known, names=("torso", "tail", "hand"))
    (residual,), _ = residuals_of(TERM, replace(context_of(toy(), motion), references=renamed))
    assert isinstance(residual, FrameResidual) and residual.gauss_newton is not None
    assert float(residual.gauss_newton.value(np.zeros(9), residual.parameters[:, 0])) == pytest.approx(0, abs=1e-12)


def test_the_humans_arm_is_followed_where_the_clip_loses_it() -> None:
    """For a third of the clip the arm hangs where the human's is raised: a jump there and back, and a wrong stretch."""
    qpos = standing(90)
    qpos[:, 9] = 0.8 + 0.2 * np.sin(2 * np.arange(90) / FPS)
    human = clip(qpos)
    faulty = qpos.copy()
    faulty[30:60, 9] = 0.1
    motion, wanted = human.with_qpos(faulty), targets_of(human, ("torso", "arm", "hand"), np.zeros((3, 3)))
    schedule = both_feet(90)
    robot = toy()
    off = []
    for references in (None, wanted):
        result = refine(
            motion, robot, load_problem(), schedule=schedule, references=references, kinematics=kinematics_of(robot)
        )
        assert result.report.status != "not converged"
        off.append(np.abs(result.motion.qpos[:, 9] - qpos[:, 9])[25:65].max())
    assert off[0] > 0.4 and off[1] < 0.5 * off[0]


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
