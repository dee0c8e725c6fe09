"""Stance detection: a walker whose steps are known, feet that skate, clips that float, sink, fly or are short."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from metrics_toy import FPS, clip, standing
from optimiser_setup import EXAMPLE, toy
from scipy.spatial.transform import Rotation

from gmr_traj.contacts.detect import detect, sole_points
from gmr_traj.contacts.mask import owners
from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.formats import read_clip
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot

LIFT = 0.6  # rad at the hip: 17 cm of height
POINTS = [(side, k) for side in ("left", "right") for k in range(4)]


def stepping(steps: int = 4, stand: int = 25, swing: int = 25) -> tuple[np.ndarray, np.ndarray]:
    """Legs of the toy swung out and back in turn, and whether each foot is at rest.  # (T, 10), (T, 2)"""
    bump = LIFT * np.sin(np.pi * np.arange(swing) / swing) ** 2
    angle, down = np.zeros((stand, 2)), np.ones((stand, 2), bool)
    for step in range(steps):
        part, rest = np.zeros((swing, 2)), np.ones((swing, 2), bool)
        part[:, step % 2], rest[:, step % 2] = bump, False
        angle = np.vstack([angle, part, np.zeros((stand, 2))])
        down = np.vstack([down, rest, np.ones((stand, 2), bool)])
    qpos = standing(len(angle))
    qpos[:, 7:9] = angle
    return qpos, down


def resting(schedule: ContactSchedule) -> np.ndarray:
    """Whether each point of the toy's soles is in stance.  # (T, 2, 4)"""
    out = np.zeros((schedule.frames, 2, 4), bool)
    for stance in schedule.stances:
        out[stance.start : stance.stop, ("left", "right").index(stance.sole), stance.point] = True
    return out


def walked(qpos: np.ndarray, heading: float, shift: np.ndarray) -> np.ndarray:
    about = Rotation.from_euler("z", heading)
    out = qpos.copy()
    out[:, :3] = about.apply(out[:, :3]) + shift
    out[:, 3:7] = (about * Rotation.from_quat(qpos[:, 3:7], scalar_first=True)).as_quat(scalar_first=True)
    return out


def check(schedule: ContactSchedule) -> None:
    """What every schedule promises: sorted, inside the clip, no overlap of one point, parts as the robot has them."""
    assert list(schedule.stances) == sorted(schedule.stances)
    soles = {sole.name: sole for sole in toy().soles}
    for stance in schedule.stances:
        assert 0 <= stance.start < stance.stop <= schedule.frames
        assert soles[stance.sole].parts[stance.point] == stance.part
    for one, other in zip(schedule.stances, schedule.stances[1:], strict=False):
        if (one.sole, one.point) == (other.sole, other.point):
            assert one.stop < other.start


def test_a_stepping_robot() -> None:
    qpos, down = stepping()
    schedule = detect(clip(qpos), toy())
    check(schedule)
    # The toy's feet tilt as they swing, so that a toe dips a few millimetres under the floor at either end of a swing.
    assert schedule.height == pytest.approx(0.0, abs=0.005) and (schedule.frames, schedule.fps) == (len(qpos), FPS)
    found = resting(schedule)
    # Certain well inside a stance and a swing; within a tenth of a second of a change either will do.
    certain = np.ones(len(qpos), bool)
    for foot in (0, 1):
        for t in np.flatnonzero(np.diff(down[:, foot])):
            certain[max(0, t - 6) : t + 7] = False
    assert certain.mean() > 0.4
    np.testing.assert_array_equal(found[certain], np.repeat(down[certain][:, :, None], 4, axis=2))
    # Every stance and swing is found once: nothing flickers.
    for point in found.reshape(len(qpos), -1).T:
        changes = np.count_nonzero(np.diff(point))
        assert changes == 4  # up and down twice a foot


def test_heel_and_toe_lift_one_after_the_other() -> None:
    """A foot that rolls over its toe: the heel's stances end while the toe's go on."""
    robot, qpos = toy(), standing(100)
    roll = np.zeros(100)
    roll[40:60] = 0.6 * np.sin(np.pi * np.arange(20) / 19)
    # The left sole turns about its toe edge, 0.1 m ahead of and 1 m below the hip; the right leg swings out of the way.
    edge = np.array([0.1, 0.0, -1.0])
    qpos[:, 7], qpos[:, 8] = roll, 1.5 * roll
    qpos[:, :3] += edge - Rotation.from_rotvec(np.outer(roll, [0, 1, 0])).apply(np.tile(edge, (100, 1)))
    schedule = detect(clip(qpos), robot)
    check(schedule)
    left = resting(schedule)[:, 0]
    assert left[50, :2].all() and not left[50, 2:].any()
    assert left[:38].all() and left[63:].all()


@pytest.mark.parametrize("speed", [0.1, 0.2])
def test_a_skating_foot_still_stands(speed: float) -> None:
    """Feet that slide at the speed at which retargeted feet do are in stance throughout."""
    qpos = standing(80)
    qpos[:, 0] = speed * np.arange(80) / FPS
    assert resting(detect(clip(qpos), toy())).all()


def test_a_foot_carried_along_fast_does_not() -> None:
    qpos = standing(80)
    qpos[:, 0] = 1.5 * np.arange(80) / FPS
    assert detect(clip(qpos), toy()).stances == ()


@pytest.mark.parametrize("height", [-0.3, -0.03, 0.08, 1.0])
def test_one_height_for_a_clip_that_floats_or_sinks(height: float) -> None:
    qpos, _ = stepping(2)
    expected = detect(clip(qpos), toy())
    schedule = detect(clip(qpos).shifted(height), toy())
    assert schedule.height == pytest.approx(expected.height - height, abs=1e-9)
    assert schedule.stances == expected.stances


@given(st.floats(-4, 4), st.tuples(*[st.floats(-20, 20)] * 3))
def test_place_heading_and_height_do_not_matter(heading: float, shift: tuple[float, ...]) -> None:
    qpos, _ = stepping(2)
    schedule = detect(clip(walked(qpos, heading, np.array(shift))), toy())
    expected = detect(clip(qpos), toy())
    assert schedule.stances == expected.stances
    assert schedule.height == pytest.approx(expected.height - shift[2], abs=1e-9)


@pytest.mark.parametrize("rate", [30.0, 60.0, 120.0])
def test_the_rate_does_not_matter(rate: float) -> None:
    """The same steps, sampled at other rates: stances begin and end at the same times, to a few frames."""
    qpos, _ = stepping(2)
    t = np.arange(len(qpos)) / FPS
    times = np.arange(0, t[-1], 1 / rate)
    sampled = standing(len(times))
    sampled[:, 7:9] = np.stack([np.interp(times, t, qpos[:, c]) for c in (7, 8)], axis=1)
    schedule, expected = detect(clip(sampled, fps=rate), toy()), detect(clip(qpos), toy())
    assert len(schedule.stances) == len(expected.stances)
    for one, other in zip(schedule.stances, expected.stances, strict=True):
        assert (one.sole, one.point) == (other.sole, other.point)
        assert one.start / rate == pytest.approx(other.start / FPS, abs=0.07)
        assert one.stop / rate == pytest.approx(other.stop / FPS, abs=0.07)


def test_flight_has_no_stance() -> None:
    """Half a second 30 cm up and down again; the floor is still where the feet stand most of the time."""
    qpos = standing(150)
    qpos[60:85, 2] += 0.3 * np.sin(np.pi * np.arange(25) / 24)
    schedule = detect(clip(qpos), toy())
    check(schedule)
    found = resting(schedule)
    assert not found[64:81].any() and found[:55].all() and found[90:].all()
    assert schedule.height == pytest.approx(0.0, abs=1e-9)


def test_a_single_spike_does_not_move_the_floor() -> None:
    qpos, _ = stepping(2)
    expected = detect(clip(qpos), toy())
    qpos[3, 2] -= 0.2
    schedule = detect(clip(qpos), toy())
    assert schedule.height == pytest.approx(expected.height, abs=0.005)


@pytest.mark.parametrize("frames", [1, 2, 3, 5, 8])
def test_short_clips(frames: int) -> None:
    schedule = detect(clip(standing(frames) - 0.1 * np.eye(10)[2]), toy())
    check(schedule)
    assert schedule.frames == frames and schedule.height == pytest.approx(0.1, abs=1e-9)


def test_points_are_those_of_the_placements(g1: Robot) -> None:
    motion = read_clip(EXAMPLE, g1).motion
    points, owned = sole_points(motion, g1), owners(g1)
    positions, rotations = placements(g1, motion.qpos)
    assert points.shape == (motion.frames, len(owned), 3)
    for column, (name, k, part) in enumerate(owned):
        sole = next(s for s in g1.soles if s.name == name)
        b = g1.body_names.index(sole.body)
        expected = positions[:, b] + rotations[:, b] @ sole.points[k]
        np.testing.assert_allclose(points[:, column], expected, atol=1e-12)
        assert sole.parts[k] == part


@pytest.mark.parametrize("change", [lambda q: q + 0.7 * np.eye(q.shape[1])[2], lambda q: walked(q, 2.0, np.ones(3))])
def test_invariance_on_a_real_clip(g1: Robot, change: Callable[[np.ndarray], np.ndarray]) -> None:
    motion: RobotMotion = read_clip(EXAMPLE, g1).motion
    expected, found = detect(motion, g1), detect(motion.with_qpos(change(motion.qpos)), g1)
    assert found.stances == expected.stances and len(found.stances) > 4


def test_a_fault_of_one_frame_does_not_end_a_stance(g1):
    """A joint that jumps away and back for one frame makes the foot fast; the stance goes on across it."""
    qpos = np.tile(g1.nominal, (40, 1))
    calm = detect(RobotMotion(qpos, 30.0, g1.joint_names, g1.name), g1)
    qpos[20, 7] += 0.06
    faulty = detect(RobotMotion(qpos, 30.0, g1.joint_names, g1.name), g1)
    assert [s for s in faulty.stances if s.sole == "left"] == [s for s in calm.stances if s.sole == "left"]
