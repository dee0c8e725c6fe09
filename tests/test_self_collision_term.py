"""Self-collision: clearances against the closed form in numbers, derivatives, and an arm that leaves the body."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import random_configurations
from metrics_toy import clip, standing
from optimiser_setup import context_of, jacobian_error, kinematics_of, problem_of, residuals_of, toy, values
from robot_files import MJCF, write_robot

from gmr_traj.collision import segments
from gmr_traj.collision.capsules import radii, world_segments
from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.kinematics.casadi_kinematics import CasadiKinematics
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.motion import RobotMotion
from gmr_traj.residuals import FrameResidual
from gmr_traj.robot import Robot
from gmr_traj.robot_loading import load_robot
from gmr_traj.terms.context import stepped
from gmr_traj.terms.posture import Posture
from gmr_traj.terms.self_collision import SelfCollision, _chain
from gmr_traj.terms.tracking import Tracking
from gmr_traj.whole_clip import Task, solve_clip

TERM = SelfCollision(clearance=0.001, near=0.05, scale=0.001)


def clearances(robot: Robot, motion: RobotMotion) -> dict[str, np.ndarray]:
    """Clearance of every collision pair by the closed form in the world [m].  # of (T,)"""
    starts, ends = world_segments(robot, *placements(robot, motion.qpos))
    radius = radii(robot)
    out = {}
    for i, j in robot.collision_pairs:
        gap, _, _ = segments.distance(starts[:, i], ends[:, i], starts[:, j], ends[:, j])
        out[f"{robot.capsules[i].name}:{robot.capsules[j].name}"] = gap - radius[i] - radius[j]
    return out


def arm_at(angle: float, frames: int = 6) -> RobotMotion:
    """Standing with the arm turned into the torso: from about -0.75 rad on they overlap."""
    qpos = standing(frames)
    qpos[:, 9] = angle
    return clip(qpos)


@pytest.fixture
def offset(tmp_path: Path) -> Robot:
    """A biped whose hinges lie off their bodies' origins and whose angles do not count from zero."""
    text = MJCF.replace('name="left_hip" type="hinge"', 'name="left_hip" type="hinge" pos="0.02 0.03 0.01" ref="0.2"')
    return load_robot(write_robot(tmp_path, model=text.replace('name="right_hip"', 'name="right_hip" ref="0.1"')))


@pytest.mark.parametrize("name", ["toy", "offset", "g1", "talos"])
def test_rows_are_the_closed_form_of_the_segments(request: pytest.FixtureRequest, name: str) -> None:
    """For steps of all joints and of the base, which must not matter; every close pair and frame has its row."""
    robot = toy() if name == "toy" else request.getfixturevalue(name)
    motion = RobotMotion(random_configurations(robot, 4, seed=40), 30.0, robot.joint_names)
    term = replace(TERM, near=0.5) if name == "offset" else TERM  # so that its legs count as close
    found, variables = residuals_of(term, context_of(robot, motion))
    x = 0.3 * np.random.default_rng(1).normal(size=variables.size)
    before, after = clearances(robot, motion), clearances(robot, stepped(motion, x.reshape(4, -1)))
    rows = 0
    for residual in found:
        assert isinstance(residual, FrameResidual)
        pair = residual.name.removeprefix("self_collision/")
        np.testing.assert_array_equal(residual.frames, np.flatnonzero(before[pair] < term.near))
        np.testing.assert_allclose(values(residual, x)[0], after[pair][residual.frames], atol=2e-6)
        assert (residual.columns % variables.tangent >= 6).all()
        rows += len(residual.frames)
    assert rows == sum(int((gap < term.near).sum()) for gap in before.values()) > 0


@pytest.mark.parametrize("name", ["toy", "g1"])
def test_jacobian(request: pytest.FixtureRequest, name: str) -> None:
    robot = toy() if name == "toy" else request.getfixturevalue(name)
    motion = (
        RobotMotion(random_configurations(robot, 2, seed=41), 30.0, robot.joint_names) if name == "g1" else arm_at(-1)
    )
    found, variables = residuals_of(TERM, context_of(robot, motion))
    x = 0.05 * np.random.default_rng(2).normal(size=variables.size)
    apart = clearances(robot, stepped(motion, x.reshape(motion.frames, -1)))
    summed = radii(robot)
    checked = 0
    for residual in found[:20]:
        assert isinstance(residual, FrameResidual)
        pair = residual.name.removeprefix("self_collision/")
        i, j = next(p for p in robot.collision_pairs if pair == ":".join(robot.capsules[k].name for k in p))
        # Next to crossing axes the distance has a kink that finite differences cannot see across.
        if (apart[pair][residual.frames] + summed[i] + summed[j]).min() > 0.01:
            assert jacobian_error(residual, x, step=1e-7) < 1e-4
            checked += 1
    assert checked


def test_many_robots_do_not_mix_up_their_joints() -> None:
    """What is kept of one robot's kinematics stays its own, however many others were in use in between."""
    first, *others = [CasadiKinematics(toy()) for _ in range(12)]
    for kinematics in (first, *others):
        _chain(kinematics, "left_leg", "arm", False, False)
    chain = _chain(first, "right_leg", "arm", False, False)  # from what is known of the arm
    assert len(chain.joints) == 2 and not chain.value.has_free()


def test_only_the_joints_between_the_bodies_are_named() -> None:
    found, variables = residuals_of(TERM, context_of(toy(), arm_at(-1.0)))
    (residual,) = found
    assert isinstance(residual, FrameResidual) and residual.name == "self_collision/torso:arm"
    np.testing.assert_array_equal(residual.columns, variables.steps[:, [8]])


def test_pairs_close_in_any_visited_motion_stay() -> None:
    inside, clear = arm_at(-1.0), arm_at(0.5)
    assert residuals_of(TERM, context_of(toy(), clear))[0] == []
    (residual,) = residuals_of(TERM, context_of(toy(), clear, visited=(inside, clear)))[0]
    assert isinstance(residual, FrameResidual)
    np.testing.assert_array_equal(residual.frames, np.arange(6))
    np.testing.assert_allclose(values(residual, np.zeros(54))[0], clearances(toy(), clear)["torso:arm"], atol=1e-6)


@pytest.mark.parametrize("use", ["hard", "soft", "cost"])
def test_an_arm_in_the_torso_comes_out(use: str) -> None:
    robot, motion = toy(), arm_at(-1.0)
    assert clearances(robot, motion)["torso:arm"].max() < -0.01
    problem = problem_of(
        ("cost", Tracking(position=0.03, orientation=0.2, robust=0.05)), ("cost", Posture(joints=0.5)), (use, TERM)
    )
    task = Task(motion, motion, np.ones(6), ContactSchedule(6, motion.fps, ()), np.zeros(0, int))
    result, report = solve_clip(task, kinematics_of(robot), problem)
    assert report.status == "converged"
    # Out to the clearance and no further, by the arm and a lean of two degrees; the legs have no reason to change.
    assert clearances(robot, result)["torso:arm"] == pytest.approx(0.001, abs=1e-6 if use == "hard" else 5e-4)
    np.testing.assert_allclose(result.qpos[:, :7], motion.qpos[:, :7], atol=0.05)
    np.testing.assert_allclose(result.qpos[:, 7:9], motion.qpos[:, 7:9], atol=1e-3)
