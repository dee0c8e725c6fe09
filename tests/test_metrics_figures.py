from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from metrics_toy import FPS, both_feet, clip, standing, toy
from scipy.spatial.transform import Rotation

from gmr_traj.contacts.schedule import ContactSchedule, Stance
from gmr_traj.exceptions import ClipError, ScheduleError
from gmr_traj.metrics import Figures, measure
from gmr_traj.motion import RobotMotion

ROBOT = toy()
FRAMES = 60
LEFT, RIGHT, SHOULDER = 7, 8, 9  # columns of qpos


def figures(qpos: np.ndarray, schedule: ContactSchedule | None = None) -> Figures:
    return measure(clip(qpos), ROBOT, both_feet(len(qpos)) if schedule is None else schedule)


def test_standing_still_is_perfect():
    f = figures(standing(FRAMES))
    zero = ("speed_max", "speed_ratio", "over_frames", "limit_frames", "limit_excess", "jumps", "acceleration_rms",
            "acceleration_max", "jerk_rms", "drift_p95", "drift_max", "slide_mean", "slide_p95", "self_depth",
            "self_share")  # fmt: skip
    assert {name: getattr(f, name) for name in zero} == dict.fromkeys(zero, 0)
    assert f.float_p95 == pytest.approx(0.0, abs=1e-9)
    assert f.sole_lowest == pytest.approx(0.0, abs=1e-9)
    assert f.floor_lowest == pytest.approx(0.0, abs=1e-9)
    assert (f.frames, f.fps, f.seconds, f.stances) == (FRAMES, FPS, FRAMES / FPS, 8)


def test_a_joint_of_constant_speed():
    qpos = standing(FRAMES)
    qpos[:, SHOULDER] = 1.2 * np.arange(FRAMES) / FPS - 0.5  # 1.2 rad/s
    f = figures(qpos)
    assert f.speed_max == pytest.approx(1.2)
    assert f.speed_ratio == pytest.approx(0.12)
    assert f.speed_joint == "shoulder"
    assert f.acceleration_max == pytest.approx(0.0, abs=1e-9)
    assert f.over_frames == 0


def test_the_worst_joint_is_the_one_nearest_to_its_own_limit():
    qpos = standing(FRAMES)
    qpos[30, LEFT], qpos[30, SHOULDER] = 12.0 / FPS, 11.0 / FPS  # limits 20 and 10 rad/s
    f = figures(qpos)
    assert f.speed_max == pytest.approx(12.0)
    assert (f.speed_joint, f.over_frames) == ("shoulder", 2)
    assert f.speed_ratio == pytest.approx(1.1)


def test_constant_acceleration_and_jerk():
    t = np.arange(FRAMES) / FPS
    qpos = standing(FRAMES)
    qpos[:, LEFT] = 0.5 * 1.5 * t**2
    f = figures(qpos)
    assert f.acceleration_max == pytest.approx(1.5)
    assert f.acceleration_rms == pytest.approx(1.5 / np.sqrt(3.0))  # one joint of three
    assert f.acceleration_ratio == pytest.approx(1.5 / 500.0)
    assert f.acceleration_joint == "left_hip"
    assert f.jerk_rms == pytest.approx(0.0, abs=1e-6)
    qpos[:, LEFT] = 0.7 * t**3 / 6.0  # the clip is at 50 Hz, so resampling changes nothing
    assert figures(qpos).jerk_rms == pytest.approx(0.7 / np.sqrt(3.0), rel=1e-6)


def test_jerk_does_not_grow_with_the_frame_rate():
    def jerk(fps):
        t = np.arange(round(4 * fps)) / fps
        qpos = standing(len(t))
        qpos[:, LEFT] = 0.3 * np.sin(2 * np.pi * 0.5 * t)
        return measure(clip(qpos, fps), ROBOT, ContactSchedule(len(t), fps, ())).jerk_rms

    assert jerk(200.0) == pytest.approx(jerk(50.0), rel=0.01)


def test_jumps_and_ranges():
    qpos = standing(FRAMES)
    qpos[20:, RIGHT] = 0.31
    qpos[40:44, SHOULDER] = 1.6  # 0.1 beyond, and a jump there and back
    qpos[50, LEFT] = 2.00005  # within the tolerance, but a jump there and back
    f = figures(qpos)
    assert f.jumps == 5
    assert (f.limit_frames, f.limit_joint) == (4, "shoulder")
    assert f.limit_excess == pytest.approx(0.1)


def test_a_sole_that_slides_at_a_known_speed():
    qpos = standing(FRAMES)
    qpos[:, 0] = 0.06 * np.arange(FRAMES) / FPS
    qpos[:, 1] = 0.08 * np.arange(FRAMES) / FPS  # 100 mm/s along (3, 4)
    f = figures(
        qpos, ContactSchedule(FRAMES, FPS, (Stance("left", 0, "toe", 10, 31), Stance("right", 2, "heel", 0, 11)))
    )
    assert f.slide_mean == pytest.approx(100.0)
    assert f.slide_p95 == pytest.approx(100.0)
    assert (f.stances, f.drift_sole) == (2, "left")
    assert f.drift_max == pytest.approx(100.0 * 20 / FPS)  # 21 frames are 20 steps
    assert f.drift_p95 == pytest.approx(100.0 * (10 + 0.95 * 10) / FPS)  # between the two stances


def test_drift_counts_from_touchdown_and_forgives_no_return():
    qpos = standing(FRAMES)
    qpos[20:30, 0] = 0.04
    f = figures(qpos)
    assert f.drift_max == pytest.approx(40.0)
    assert f.slide_mean == pytest.approx(2 * 40.0 * FPS / (FRAMES - 1))


def test_a_foot_in_the_air_floats_and_a_foot_in_the_floor_does_not():
    qpos = standing(100)
    qpos[:10, 2] = 1.02
    assert figures(qpos).float_p95 == pytest.approx(20.0)
    qpos[:10, 2] = 0.98
    f = figures(qpos)
    assert f.float_p95 == pytest.approx(0.0, abs=1e-9)
    assert f.sole_lowest == pytest.approx(-20.0)
    assert f.floor_lowest == pytest.approx(-20.0)
    assert f.floor_body in ("left_leg", "right_leg")


def test_the_outline_of_a_sole_counts_as_its_points_do():
    qpos = standing(FRAMES)
    qpos[6, LEFT] = 0.2  # about y: a point (x, -1) of the leg comes to z = -x sin 0.2 - cos 0.2
    lowest = 1.0 - 0.15 * np.sin(0.2) - np.cos(0.2)
    f = figures(qpos)
    assert f.sole_lowest == pytest.approx(1e3 * lowest)
    assert f.sole_name == "left"
    assert lowest < 1.0 - 0.1 * np.sin(0.2) - np.cos(0.2)


@pytest.mark.parametrize("angle", [0.6, 0.9, 1.2])
def test_an_arm_in_the_torso_by_a_known_depth(angle):
    qpos = standing(FRAMES)
    qpos[10:16, SHOULDER] = -angle  # the hand reaches y = 0.3 - 0.3 sin(angle)
    f = figures(qpos)
    assert f.self_depth == pytest.approx(1e3 * max(0.0, 0.14 - 0.3 + 0.3 * np.sin(angle)), abs=1e-6)
    assert f.self_pair == ("torso - arm" if f.self_depth else "")
    assert f.self_share == (0.1 if f.self_depth > 1.0 else 0.0)


def test_without_stances_the_feet_have_no_figures():
    f = figures(standing(FRAMES), ContactSchedule(FRAMES, FPS, ()))
    assert (f.stances, f.drift_p95, f.drift_max, f.slide_mean, f.float_p95, f.drift_sole) == (0, 0, 0, 0, 0, "")


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_the_shortest_clips(frames):
    f = figures(standing(frames))
    assert (f.speed_max, f.acceleration_max, f.jerk_rms, f.slide_mean) == (0.0, 0.0, 0.0, 0.0)


def test_figures_are_plain_numbers_and_words():
    content = json.loads(json.dumps(figures(standing(FRAMES)).to_json(), allow_nan=False))
    assert tuple(content) == Figures.names()
    assert all(type(value) in (int, float, str) for value in figures(standing(FRAMES)).to_json().values())


def _wander(seed: int, frames: int = 40) -> np.ndarray:
    rng = np.random.default_rng(seed)
    qpos = standing(frames)
    qpos[:, :3] += np.cumsum(rng.normal(scale=0.01, size=(frames, 3)), axis=0)
    qpos[:, 7:] = np.clip(np.cumsum(rng.normal(scale=0.2, size=(frames, 3)), axis=0), -1.8, 1.8)
    turn = Rotation.from_rotvec(np.cumsum(rng.normal(scale=0.05, size=(frames, 3)), axis=0))
    qpos[:, 3:7] = turn.as_quat(scalar_first=True)
    return qpos


@settings(max_examples=25)
@given(st.integers(0, 10_000), st.floats(-np.pi, np.pi), st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
def test_a_clip_measures_the_same_wherever_it_stands_and_faces(seed, yaw, x, y):
    qpos = _wander(seed)
    turn = Rotation.from_euler("z", yaw)
    moved = qpos.copy()
    moved[:, :3] = turn.apply(qpos[:, :3]) + [x, y, 0.0]
    moved[:, 3:7] = (turn * Rotation.from_quat(qpos[:, 3:7], scalar_first=True)).as_quat(scalar_first=True)
    here, there = figures(qpos), figures(moved)
    for name in Figures.names():
        assert getattr(there, name) == pytest.approx(getattr(here, name), abs=1e-6), name


@settings(max_examples=25)
@given(st.integers(0, 10_000), st.floats(-0.3, 0.3))
def test_raising_a_clip_raises_what_is_measured_from_the_floor(seed, height):
    motion = clip(_wander(seed))
    low, high = measure(motion, ROBOT, both_feet(40)), measure(motion.shifted(height), ROBOT, both_feet(40))
    assert high.float_p95 - low.float_p95 == pytest.approx(1e3 * height, abs=1e-6)
    assert high.sole_lowest - low.sole_lowest == pytest.approx(1e3 * height, abs=1e-6)
    assert high.drift_max == pytest.approx(low.drift_max, abs=1e-6)
    assert high.self_depth == pytest.approx(low.self_depth, abs=1e-6)


@pytest.mark.parametrize(
    ("schedule", "words"),
    [
        (both_feet(FRAMES - 1), "59 frames, the clip has 60"),
        (ContactSchedule(FRAMES, FPS, (Stance("middle", 0, "toe", 0, 5),)), "robot toy has left, right"),
        (ContactSchedule(FRAMES, FPS, (Stance("left", 4, "toe", 0, 5),)), "whose last is 3"),
        (ContactSchedule(FRAMES, FPS, (Stance("left", 0, "toe", 5, 5),)), "0 <= start < stop <= 60"),
        (ContactSchedule(FRAMES, FPS, (Stance("left", 0, "toe", 50, 61),)), "0 <= start < stop <= 60"),
    ],
)
def test_a_schedule_that_does_not_fit(schedule, words):
    with pytest.raises(ScheduleError, match=words):
        figures(standing(FRAMES), schedule)


def test_joints_that_are_not_the_robots():
    motion = RobotMotion(standing(5)[:, :9], FPS, ("left_hip", "shoulder"), "toy")
    with pytest.raises(ClipError, match=r"2 joints \(joint 1 is shoulder, not right_hip\); robot toy has 3"):
        measure(motion, ROBOT, both_feet(5))
    renamed = replace(clip(standing(5)), joint_names=("a", "right_hip", "shoulder"))
    with pytest.raises(ClipError, match="joint 0 is a"):
        measure(renamed, ROBOT, both_feet(5))
