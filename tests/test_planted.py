"""Feet that come close once they are planted: against feet that are put there, and as rows of the problem."""

from __future__ import annotations

import numpy as np
from optimiser_setup import context_of, residuals_of

from gmr_traj.collision.broadphase import candidates
from gmr_traj.contacts.schedule import ContactSchedule, Stance
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.motion import RobotMotion
from gmr_traj.residuals import FrameResidual
from gmr_traj.robot import Robot
from gmr_traj.terms.planted import planted_close
from gmr_traj.terms.self_collision import SelfCollision

FPS, FRAMES = 30.0, 24


def feet_apart(robot: Robot) -> float:
    """Clearance of the feet in the nominal configuration [m]."""
    feet = {sole.body for sole in robot.soles}
    return min(
        float(found.clearance.min())
        for found in candidates(robot, *placements(robot, robot.nominal[None]), 0.5)
        if {robot.capsules[k].body for k in found.pair} == feet
    )


def test_feet_that_stay_where_they_are_are_as_close_as_they_are(g1: Robot) -> None:
    qpos = np.tile(g1.nominal, (5, 1))
    qpos[:, 7 + g1.joint_names.index("right_hip_roll_joint")] += 0.19
    stances = [Stance(s.name, k, part, 0, 5) for s in g1.soles for k, part in enumerate(s.parts)]
    motion = RobotMotion(qpos, FPS, g1.joint_names)
    context = context_of(g1, motion, schedule=ContactSchedule(5, FPS, tuple(sorted(stances))))
    feet = {sole.body for sole in g1.soles}
    for within in (0.02, 0.05, 0.1):
        expected = {
            found.pair: found.frames
            for found in candidates(g1, *placements(g1, qpos), within)
            if {g1.capsules[k].body for k in found.pair} == feet
        }
        found = planted_close(context, within)
        assert found.keys() == expected.keys()
        for pair, frames in found.items():
            np.testing.assert_array_equal(frames, expected[pair])


def test_a_foot_that_slides_is_where_it_slides_to_in_the_mean(g1: Robot) -> None:
    """All of the robot slides sideways; the left foot stands throughout, the right one in the first frames only."""
    qpos = np.tile(g1.nominal, (FRAMES, 1))
    qpos[:, 1] += 0.002 * np.arange(FRAMES)  # towards the left
    motion = RobotMotion(qpos, FPS, g1.joint_names)
    ends = {"left": FRAMES, "right": 4}
    stances = [Stance(s.name, k, part, 0, ends[s.name]) for s in g1.soles for k, part in enumerate(s.parts)]
    context = context_of(g1, motion, schedule=ContactSchedule(FRAMES, FPS, tuple(sorted(stances))))
    clearance = feet_apart(g1)
    # Feet side by side: the left one is planted where it is in the mean frame, the right one in the mean of its four.
    expected = clearance + 0.002 * ((FRAMES - 1) / 2 - 1.5)
    assert planted_close(context, expected - 1e-3) == {}
    close = planted_close(context, expected + 1e-3)
    assert close and all(frames.tolist() == [0, 1, 2, 3] for frames in close.values())


def test_one_foot_has_no_pairs(g1: Robot) -> None:
    motion = RobotMotion(np.tile(g1.nominal, (FRAMES, 1)), FPS, g1.joint_names)
    left = tuple(Stance("left", k, part, 0, FRAMES) for k, part in enumerate(g1.soles[0].parts))
    context = context_of(g1, motion, schedule=ContactSchedule(FRAMES, FPS, left))
    assert planted_close(context, 1.0) == {}


def test_the_problem_has_rows_where_planted_feet_come_close(g1: Robot) -> None:
    """Far apart in the clip in every frame, but one stands where the other slides to: rows in both stances' frames."""
    qpos = np.tile(g1.nominal, (FRAMES, 1))
    qpos[:, 1] += feet_apart(g1) / 9.0 * np.arange(FRAMES)  # from the mean of frames 0-13 to that of 8-23
    spans = {"left": (0, 14), "right": (8, FRAMES)}
    stances = [Stance(s.name, k, part, *spans[s.name]) for s in g1.soles for k, part in enumerate(s.parts)]
    context = context_of(
        g1, RobotMotion(qpos, FPS, g1.joint_names), schedule=ContactSchedule(FRAMES, FPS, tuple(sorted(stances)))
    )
    found, _ = residuals_of(SelfCollision(clearance=0.001, near=0.02, scale=0.001), context)
    rows = [residual for residual in found if isinstance(residual, FrameResidual) and residual.frames.tolist()]
    assert rows and all(set(residual.frames.tolist()) <= set(range(8, 14)) for residual in rows)
    assert any("left_sole" in residual.name and "right_sole" in residual.name for residual in rows)
