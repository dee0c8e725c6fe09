from __future__ import annotations

import metrics_toy as toys
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gmr_traj.contacts.schedule import ContactSchedule, Stance
from gmr_traj.metrics.floor_depth import lowest_points
from gmr_traj.metrics.foot_contact import contact_shares, slide_speeds, sole_heights, stance_mask
from gmr_traj.metrics.observation import observe


def test_a_foot_is_in_stance_where_any_of_its_points_is():
    stances = (Stance("left", 0, "toe", 2, 4), Stance("left", 3, "heel", 3, 6), Stance("right", 1, "toe", 0, 1))
    mask = stance_mask(ContactSchedule(8, 50.0, stances), toys.toy())
    np.testing.assert_array_equal(np.flatnonzero(mask[:, 0]), [2, 3, 4, 5])
    np.testing.assert_array_equal(np.flatnonzero(mask[:, 1]), [0])


def test_a_foot_that_slides_and_one_that_turns_on_a_point():
    robot, frames = toys.toy(), 5
    qpos = toys.standing(frames)
    qpos[:, 0] = 0.01 * np.arange(frames)
    everywhere = np.ones((frames, 2), dtype=bool)
    np.testing.assert_allclose(slide_speeds(observe(toys.clip(qpos), robot), everywhere), 0.01 * toys.FPS)

    # The base turns about the left foot's first toe point, which stays: the foot does not slide.
    pivot = np.array([0.1, 0.13, 0.0])
    turn = Rotation.from_euler("z", 0.1 * np.arange(frames)[:, None])
    qpos = toys.standing(frames)
    qpos[:, :3] = pivot + turn.apply(qpos[:, :3] - pivot)
    qpos[:, 3:7] = turn.as_quat(scalar_first=True)
    speeds = slide_speeds(observe(toys.clip(qpos), robot), everywhere).reshape(2, -1)
    np.testing.assert_allclose(speeds[0], 0.0, atol=1e-9)
    assert (speeds[1] > 0.1).all()


def test_only_steps_within_a_stance_count():
    qpos = toys.standing(6)
    qpos[:, 0] = [0.0, 1.0, 1.0, 1.0, 2.0, 3.0]
    mask = np.zeros((6, 2), dtype=bool)
    mask[1:4, 0] = True
    np.testing.assert_allclose(slide_speeds(observe(toys.clip(qpos), toys.toy()), mask), [0.0, 0.0], atol=1e-12)


def test_heights():
    qpos = toys.standing(2)
    qpos[1, 2] -= 0.03
    observation = observe(toys.clip(qpos), toys.toy())
    np.testing.assert_allclose(sole_heights(observation), [[0.0, 0.0], [-0.03, -0.03]], atol=1e-12)
    lowest, bodies = lowest_points(observation)
    assert lowest.shape == (2, len(bodies)) and bodies[:2] == ("left_leg", "right_leg")
    assert lowest.min() == pytest.approx(-0.03)


def test_contacts_kept_and_added():
    heights = np.array([[0.0, 0.5], [0.0, 0.0], [0.1, 0.0], [0.1, 0.1]])
    mask = np.array([[True, False], [False, True], [True, True], [True, False]])
    kept, added = contact_shares(heights, mask, 0.02)
    assert kept == pytest.approx(3 / 5) and added == pytest.approx(1 / 4)
    assert contact_shares(heights + 1.0, mask, 0.02) == (0.0, None)
    assert contact_shares(heights, np.zeros_like(mask), 0.02) == (None, 1.0)
