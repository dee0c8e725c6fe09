"""The signals that plots show are those whose extremes are the figures."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import random_configurations
from metrics_toy import FPS, both_feet, clip, standing, toy

from gmr_traj.contacts.detect import detect
from gmr_traj.contacts.schedule import ContactSchedule, Stance
from gmr_traj.metrics.capsules import segment_distance
from gmr_traj.metrics.figures import figures
from gmr_traj.metrics.observation import observe
from gmr_traj.metrics.self_collision import clearance
from gmr_traj.metrics.signals import REACH, signals
from gmr_traj.motion import RobotMotion

ROBOT = toy()
LEFT, SHOULDER = 7, 9  # columns of qpos


def by_name(qpos: np.ndarray, schedule: ContactSchedule | None = None) -> dict[str, np.ndarray]:
    seen = observe(clip(qpos), ROBOT)
    return {s.name: s.values for s in signals(seen, both_feet(len(qpos)) if schedule is None else schedule)}


def test_standing_still():
    found = by_name(standing(20))
    assert np.isnan(found["joint_speed"][0]) and (found["joint_speed"][1:] == 0.0).all()
    assert np.isnan(found["joint_acceleration"][[0, -1]]).all() and (found["joint_acceleration"][1:-1] == 0.0).all()
    np.testing.assert_allclose(found["sole_height"], 0.0, atol=1e-9)
    np.testing.assert_allclose(found["stance_height"], 0.0, atol=1e-9)
    np.testing.assert_allclose(found["slide"][1:], 0.0, atol=1e-9)
    np.testing.assert_allclose(found["base_height"], 1.0)


def test_a_jump_stands_where_it_happens():
    qpos = standing(30)
    qpos[12:, SHOULDER] = 0.1  # 5 rad/s at 50 Hz; the shoulder's limit is 10 rad/s
    found = by_name(qpos)
    assert np.flatnonzero(found["joint_speed"] > 0.0).tolist() == [12]
    assert found["joint_speed"][12] == pytest.approx(50.0)
    assert np.flatnonzero(found["joint_acceleration"] > 0.0).tolist() == [11, 12]
    assert found["joint_acceleration"][11] == pytest.approx(0.1 * FPS**2)


def test_a_foot_slides_and_floats_only_in_stance():
    qpos = standing(30)
    qpos[:, 0] = 0.2 * np.arange(30) / FPS  # 200 mm/s
    qpos[:, 2] += 0.004
    schedule = ContactSchedule(30, FPS, (Stance("left", 0, "toe", 10, 20),))
    found = by_name(qpos, schedule)
    assert np.flatnonzero(np.isfinite(found["slide"])).tolist() == list(range(11, 20))
    np.testing.assert_allclose(found["slide"][11:20], 200.0)
    assert np.flatnonzero(np.isfinite(found["stance_height"])).tolist() == list(range(10, 20))
    np.testing.assert_allclose(found["stance_height"][10:20], 4.0)
    np.testing.assert_allclose(found["sole_height"], 4.0)


def test_extremes_are_the_figures(g1):
    motion = RobotMotion(random_configurations(g1, 12, seed=3), 30.0, g1.joint_names, g1.name)
    seen, schedule = observe(motion, g1), detect(motion, g1)
    found = {s.name: s.values for s in signals(seen, schedule)}
    expected = figures(seen, schedule)
    assert np.nanmax(found["joint_speed"]) == pytest.approx(100.0 * expected.speed_ratio)
    assert np.nanmax(found["joint_acceleration"]) == pytest.approx(expected.acceleration_max)
    assert found["sole_height"].min() == pytest.approx(expected.sole_lowest)
    assert expected.self_depth > 0.0
    assert found["clearance"].min() == pytest.approx(-expected.self_depth)


def test_clearance_is_that_of_the_closest_pair(g1):
    motion = RobotMotion(random_configurations(g1, 40, seed=5), 30.0, g1.joint_names, g1.name)
    seen = observe(motion, g1)
    radii = np.array([capsule.radius for capsule in g1.capsules])
    found = clearance(seen.starts, seen.ends, radii, g1.collision_pairs, REACH)
    every = np.min(
        [
            segment_distance(seen.starts[:, i], seen.ends[:, i], seen.starts[:, j], seen.ends[:, j])
            - radii[i]
            - radii[j]
            for i, j in g1.collision_pairs
        ],
        axis=0,
    )
    np.testing.assert_allclose(found, np.minimum(every, REACH), atol=1e-12)
    np.testing.assert_allclose(np.maximum(0.0, -found), seen.overlaps.by_frame(), atol=1e-12)
    free = standing(3)
    free[:, SHOULDER] = 1.4  # the arm is held out
    nothing_near = observe(clip(free), ROBOT)
    radii = np.array([capsule.radius for capsule in ROBOT.capsules])
    assert (clearance(nothing_near.starts, nothing_near.ends, radii, ROBOT.collision_pairs, REACH) == REACH).all()


def test_one_and_two_frames_have_signals():
    for frames in (1, 2):
        found = by_name(standing(frames))
        assert all(len(values) == frames for values in found.values())
        assert np.isnan(found["joint_acceleration"]).all()
