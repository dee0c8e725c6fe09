"""Ground: heights from MuJoCo's placements, which rows are built, and a sunk clip that ends at the floor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from conftest import random_configurations
from metrics_toy import clip, standing
from optimiser_setup import context_of, jacobian_error, kinematics_of, problem_of, residuals_of, toy, values

from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.motion import RobotMotion
from gmr_traj.residuals import FrameResidual
from gmr_traj.robot import Robot
from gmr_traj.terms.context import stepped
from gmr_traj.terms.ground import Ground
from gmr_traj.terms.posture import Posture
from gmr_traj.terms.tracking import Tracking
from gmr_traj.whole_clip import Task, solve_clip

TERM = Ground(clearance=0.002, near=0.06, scale=0.001)


def heights(robot: Robot, motion: RobotMotion, name: str) -> np.ndarray:
    """Heights of a shape's points over the floor [m], less its radius.  # (m, T)"""
    positions, rotations = placements(robot, motion.qpos)
    sole = next((s for s in robot.soles if f"{s.name} sole" == name), None)
    if sole is not None:
        body, points, radius = sole.body, sole.outline if len(sole.outline) else sole.points, 0.0
    else:
        capsule = next(c for c in robot.capsules if c.name == name)
        body, radius = capsule.body, capsule.radius
        points = np.unique(np.stack([capsule.start, capsule.end]), axis=0)
    b = robot.body_names.index(body)
    world = positions[:, b, None] + np.einsum("tij,kj->tki", rotations[:, b], points)
    return world[..., 2].T - radius


def sole_height(robot: Robot, motion: RobotMotion, name: str) -> np.ndarray:
    """Height of the sole of the foot that a capsule is of; infinite for other shapes.  # (T,)"""
    body = next((c.body for c in robot.capsules if c.name == name), "")
    sole = next((s for s in robot.soles if s.body == body), None)
    if sole is None:
        return np.full(motion.frames, np.inf)
    return heights(robot, motion, f"{sole.name} sole").min(axis=0)


@pytest.mark.parametrize("name", ["toy", "g1"])
def test_rows_are_heights(request: pytest.FixtureRequest, name: str) -> None:
    robot = toy() if name == "toy" else request.getfixturevalue(name)
    qpos = random_configurations(robot, 3, seed=30)
    qpos[:, 2] = 0.0
    motion = RobotMotion(qpos, 30.0, robot.joint_names)
    found, _ = residuals_of(TERM, context_of(robot, motion))
    assert len(found) >= 2
    x = 0.2 * np.random.default_rng(0).normal(size=3 * (6 + robot.dof))
    after = stepped(motion, x.reshape(3, -1))
    for residual in found:
        assert isinstance(residual, FrameResidual)
        shape = residual.name.removeprefix("ground/")
        np.testing.assert_allclose(values(residual, x), heights(robot, after, shape)[:, residual.frames], atol=1e-9)
        before = heights(robot, motion, shape)[:, residual.frames]
        built = (before < TERM.near) & (before < sole_height(robot, motion, shape)[residual.frames] - 0.001)
        np.testing.assert_array_equal(np.isfinite(residual.lower), built)
        assert np.isposinf(residual.upper).all() and set(residual.lower[built]) == {TERM.clearance}
    for residual in found[:3]:
        assert isinstance(residual, FrameResidual)
        assert jacobian_error(residual, x) < 1e-8


def test_every_shape_and_frame_near_the_floor_has_rows_and_no_other() -> None:
    robot = toy()
    qpos = standing(20)
    qpos[:10, 2] += 0.5
    qpos[5, 2] = -0.3  # the whole robot under the floor for one frame
    found, _ = residuals_of(TERM, context_of(robot, clip(qpos)))
    frames = {r.name: set(r.frames.tolist()) for r in found}
    assert frames == {
        "ground/left sole": {5, *range(10, 20)},
        "ground/right sole": {5, *range(10, 20)},
        "ground/torso": {5},
        "ground/arm": {5},
    }


def test_a_foot_on_its_side_rests_on_its_capsule() -> None:
    """Turned by a right angle the toy's right leg lies on its capsule, 5 cm thick."""
    qpos = standing(3)
    qpos[:, 2], qpos[:, 3:7] = 0.14, [np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0]
    found, _ = residuals_of(TERM, context_of(toy(), clip(qpos)))
    rows = {r.name: values(r, np.zeros(27)).min() for r in found}
    assert rows["ground/right_leg"] == pytest.approx(0.14 - 0.1 - 0.05)
    assert rows["ground/right sole"] == pytest.approx(0.14 - 0.1)


def test_rows_near_any_visited_motion_stay() -> None:
    low, high = clip(standing(5)), clip(standing(5) + np.eye(10)[2])
    assert residuals_of(TERM, context_of(toy(), high))[0] == []
    found, _ = residuals_of(TERM, context_of(toy(), high, visited=(low, high)))
    assert {r.name for r in found} == {"ground/left sole", "ground/right sole"}


@pytest.mark.parametrize("use", ["hard", "soft", "cost"])
def test_a_sunk_clip_ends_at_the_floor(use: str) -> None:
    """Feet 4 cm under the floor throughout: up to the clearance and not beyond, whatever use is made of the term."""
    # Without an outline the four contact points count, so that tilting a foot gains nothing.
    robot = replace(toy(), soles=tuple(replace(sole, outline=np.zeros((0, 3))) for sole in toy().soles))
    motion = clip(standing(8) - 0.04 * np.eye(10)[2])
    problem = problem_of(
        ("cost", Tracking(position=0.03, orientation=0.2, robust=0.05)), ("cost", Posture(joints=0.02)), (use, TERM)
    )
    task = Task(motion, motion, np.ones(8), ContactSchedule(8, motion.fps, ()), np.zeros(0, int))
    result, report = solve_clip(task, kinematics_of(robot), problem)
    assert report.status == "converged"
    lowest = min(heights(robot, result, f"{sole.name} sole").min() for sole in robot.soles)
    assert lowest == pytest.approx(TERM.clearance, abs=1e-6 if use == "hard" else 1e-3)
    assert result.qpos[:, 2] == pytest.approx(np.full(8, 1 + TERM.clearance), abs=0.002)
