"""Stances that the centre of mass asks for: a load without a stance is closed, flight stays flight, feet hand over."""

from __future__ import annotations

import numpy as np
import pytest

from gmr_traj.contacts.carrying import bearing, carrying, load
from gmr_traj.contacts.detect import detect
from gmr_traj.contacts.held_longer import Standing
from gmr_traj.contacts.schedule import ContactSchedule, Stance
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot

FPS = 30.0


def of(schedule: ContactSchedule, sole: str) -> np.ndarray:
    """Frames in which any point of a sole stands.  # (T,)"""
    on = np.zeros(schedule.frames, bool)
    for stance in schedule.stances:
        if stance.sole == sole:
            on[stance.start : stance.stop] = True
    return on


def test_load_of_standing_and_of_a_throw() -> None:
    np.testing.assert_allclose(load(np.full(30, 0.7), FPS, 0.05), 1.0)
    t = np.arange(60) / FPS
    thrown = load(3.0 * t - 0.5 * 9.81 * t**2, FPS, 0.05)
    np.testing.assert_allclose(thrown[10:-10], 0.0, atol=1e-6)
    np.testing.assert_array_equal(load(np.zeros(2), FPS, 0.05), 1.0)


def test_bearing_needs_both_neighbours() -> None:
    resting = np.array([0, 1, 1, 1, 0, 1, 1, 0, 1], bool)[:, None]
    np.testing.assert_array_equal(bearing(resting)[:, 0], [0, 0, 1, 0, 0, 0, 0, 0, 0])
    np.testing.assert_array_equal(bearing(np.ones((3, 1), bool))[:, 0], [1, 1, 1])


def hovering(robot: Robot, frames: int, high: slice, height: float) -> RobotMotion:
    """Stands, and is ``height`` above the floor for a while, without falling."""
    qpos = np.tile(robot.nominal, (frames, 1))
    up = np.zeros(frames)
    up[high] = height
    qpos[:, 2] += np.convolve(up, np.hanning(15) / np.hanning(15).sum(), mode="same")
    return RobotMotion(qpos, FPS, robot.joint_names)


def test_a_robot_that_hovers_stands(g1: Robot) -> None:
    motion = hovering(g1, 90, slice(30, 60), 0.05)
    found = detect(motion, g1)
    assert not of(found, "left")[40:50].any()
    closed = carrying(found, motion, g1)
    assert of(closed, "left").all() or of(closed, "right").all()
    assert closed.height == found.height


def test_a_jump_stays_a_jump(g1: Robot) -> None:
    qpos = np.tile(g1.nominal, (90, 1))
    t = np.arange(16) / FPS
    qpos[40:56, 2] += 0.5 * 9.81 * t * (t[-1] - t)
    motion = RobotMotion(qpos, FPS, g1.joint_names)
    closed = carrying(detect(motion, g1), motion, g1)
    assert not of(closed, "left")[44:52].any() and not of(closed, "right")[44:52].any()


def test_feet_hand_over(g1: Robot) -> None:
    qpos = np.tile(g1.nominal, (60, 1))
    motion = RobotMotion(qpos, FPS, g1.joint_names)
    parts = {sole.name: sole.parts for sole in g1.soles}
    spans = {"left": (0, 30), "right": (30, 60)}
    stances = [Stance(s, k, part, *spans[s]) for s in parts for k, part in enumerate(parts[s])]
    closed = carrying(ContactSchedule(60, FPS, tuple(sorted(stances)), detect(motion, g1).height), motion, g1)
    both = of(closed, "left") & of(closed, "right")
    assert 5 <= both.sum() <= 10  # three frames in which both bear, or as many again, as heels and toes change by pairs


def test_nothing_is_added_where_all_is_well(g1: Robot) -> None:
    motion = RobotMotion(np.tile(g1.nominal, (40, 1)), FPS, g1.joint_names)
    found = detect(motion, g1)
    assert carrying(found, motion, g1) == found


@pytest.mark.parametrize(("apart", "joined"), [(0.05, True), (0.3, False)])
def test_stances_far_apart_are_not_joined(apart: float, joined: bool) -> None:
    resting = np.zeros((20, 1), bool)
    resting[:8] = resting[12:] = True
    points = np.zeros((20, 1, 3))
    points[10:, 0, 0] = apart
    standing = Standing(resting, points, points[..., 2], np.zeros((20, 1)), [[0]], 0.1)
    assert standing.add([0], 8, 12) is joined
    assert resting[8:12].all() == joined


@pytest.mark.parametrize(("turn", "stand"), [(0.2, 2), (0.8, 1)])
def test_a_foot_that_turns_stands_on_the_point_it_turns_about(turn: float, stand: int) -> None:
    frames = np.linspace(0.0, turn, 20)
    points = np.zeros((20, 2, 3))
    points[:, 1, :2] = 0.05 * np.column_stack([np.cos(frames), np.sin(frames)])
    resting = np.zeros((20, 2), bool)
    resting[:8] = True
    standing = Standing(resting, points, points[..., 2], np.repeat(frames[:, None], 2, axis=1), [[0, 1]], 0.1)
    assert standing.add([0, 1], 8, 20)
    np.testing.assert_array_equal(resting[8:, 0], True)  # the point that does not move
    assert resting[-1].sum() == stand
