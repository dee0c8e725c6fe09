"""Ends of a clip that say nothing: what stands where they end has stood before; the rest of the schedule stays."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from metrics_toy import FPS, clip, standing
from optimiser_setup import toy

from gmr_traj.contacts.ends import continued
from gmr_traj.contacts.mask import from_mask, owners, to_mask
from gmr_traj.contacts.schedule import ContactSchedule, Stance
from gmr_traj.trust import without_spoiled_ends


def schedule_of(*stances: tuple[int, int, int]) -> ContactSchedule:
    """Stances (point, start, stop) of the left foot in 20 frames."""
    parts = toy().soles[0].parts
    return ContactSchedule(20, FPS, tuple(sorted(Stance("left", k, parts[k], a, b) for k, a, b in stances)), height=0.1)


def spoiled(first: int, last: int) -> np.ndarray:
    """Believed but for the first and the last few frames.  # (20,)"""
    believed = np.ones(20, bool)
    believed[:first] = False
    believed[20 - last :] = False
    return believed


def test_what_stands_where_the_spoiled_frames_end_has_stood_since_the_first() -> None:
    found = continued(schedule_of((0, 4, 9), (1, 8, 12)), toy(), spoiled(3, 0))
    assert found == schedule_of((0, 0, 9), (1, 8, 12))


def test_likewise_at_the_end() -> None:
    assert continued(schedule_of((0, 4, 16), (1, 8, 12)), toy(), spoiled(0, 3)) == schedule_of((0, 4, 20), (1, 8, 12))


def test_a_stance_within_the_spoiled_frames_is_none() -> None:
    assert continued(schedule_of((0, 0, 3), (1, 9, 12)), toy(), spoiled(5, 0)) == schedule_of((1, 9, 12))


def test_where_all_or_nothing_is_believed_nothing_changes() -> None:
    schedule = schedule_of((0, 1, 4), (2, 17, 19))
    assert continued(schedule, toy(), np.ones(20, bool)) is schedule
    assert continued(schedule, toy(), np.zeros(20, bool)) is schedule


@given(st.integers(0, 2**32 - 1), st.integers(0, 6), st.integers(0, 6))
def test_the_middle_is_never_touched(seed: int, first: int, last: int) -> None:
    robot = toy()
    resting = np.random.default_rng(seed).random((20, len(owners(robot)))) < 0.7
    schedule = from_mask(schedule_of(), robot, resting)
    np.testing.assert_array_equal(to_mask(schedule, robot), resting)
    found = to_mask(continued(schedule, robot, spoiled(first, last)), robot)
    middle = slice(first + (2 if first else 0), 20 - last - (2 if last else 0))
    np.testing.assert_array_equal(found[middle], resting[middle])
    for k in range(found.shape[1]):  # within a spoiled end a point stands throughout or not at all
        assert len(set(found[:first, k])) <= 1 and len(set(found[20 - last :, k])) <= 1


def test_spoiled_frames_are_replaced_by_their_neighbours() -> None:
    qpos = standing(20)
    qpos[:, 0] = np.arange(20)
    replaced = without_spoiled_ends(clip(qpos), spoiled(3, 2)).qpos[:, 0]
    np.testing.assert_array_equal(replaced, np.clip(np.arange(20), 3, 17))
    whole = clip(qpos)
    assert without_spoiled_ends(whole, spoiled(0, 0)) is whole
    assert without_spoiled_ends(whole, np.zeros(20, bool)) is whole
