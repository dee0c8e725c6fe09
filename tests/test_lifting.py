"""Feet that turn about their toes: which points rise, from when on, and how far they may."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from optimiser_setup import toy

from gmr_traj.contacts.mask import owners
from gmr_traj.contacts.release import turning
from gmr_traj.terms.lifting import FREE, alone, ceilings

HEEL, TOE = (2, 3), (0, 1)  # of the left foot, which comes first


def a_step(heel_down: int, heel_up: int, toe_down: int, toe_up: int, frames: int = 40) -> np.ndarray:
    resting = np.zeros((frames, len(owners(toy()))), bool)
    for points, start, stop in ((HEEL, heel_down, heel_up), (TOE, toe_down, toe_up)):
        resting[start:stop, points] = True
    return resting


def test_a_heel_turns_from_where_it_rises_while_the_toes_stand() -> None:
    resting, height = a_step(5, 25, 5, 30), np.zeros((40, len(owners(toy()))))
    height[:, HEEL] = 0.02  # it hovers, as retargeted feet do
    height[21:, HEEL] = 0.02 + 0.012 * np.arange(1, 20)[:, None]
    found = turning(resting, height, toy())
    np.testing.assert_array_equal(np.flatnonzero(found[:, HEEL[0]]), [21, 22, 23, 24])
    assert not found[:, TOE].any()
    # Toes that leave the floor with the heel do not hold the foot: it does not turn.
    resting[24:, TOE] = False
    assert not turning(resting, height, toy()).any()


def test_toes_turn_until_they_are_down_while_the_heel_stands() -> None:
    resting, height = a_step(5, 30, 8, 30), np.zeros((40, len(owners(toy()))))
    height[:11, TOE] = 0.03 - 0.001 * np.arange(11)[:, None]
    found = turning(resting, height, toy())
    np.testing.assert_array_equal(np.flatnonzero(found[:, TOE[1]]), [8, 9, 10])
    # A heel that comes down with its toes turns about nothing.
    resting[5:8, HEEL] = False
    assert not turning(resting, height, toy())[8].any()


@given(
    st.lists(st.tuples(st.integers(0, 7), st.integers(0, 30), st.integers(1, 20)), max_size=12), st.integers(0, 2**31)
)
def test_what_turns_is_at_an_end_of_a_stance_that_keeps_a_core(spans: list[tuple[int, int, int]], seed: int) -> None:
    rng = np.random.default_rng(seed)
    resting = np.zeros((40, len(owners(toy()))), bool)
    for k, start, length in spans:
        resting[start : start + length, k] = True
    height = np.cumsum(0.01 * rng.normal(size=resting.shape), axis=0)
    found = turning(resting, height, toy())
    assert not (found & ~resting).any()
    for on, turns in zip(resting.T, found.T, strict=True):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], on.astype(int), [0]])))
        for start, stop in edges.reshape(-1, 2).tolist():
            core = np.flatnonzero(~turns[start:stop])
            # One run of frames in the middle, of three at least where anything was taken away.
            assert core.size and (np.diff(core) == 1).all()
            assert core.size == stop - start or core.size >= 3
    np.testing.assert_array_equal(turning(resting, height + 1.0, toy()), found)  # whatever the level


def test_a_part_alone_is_a_whole_part_and_no_other() -> None:
    robot, firm = toy(), a_step(0, 3, 0, 5, frames=6)
    firm[5, TOE[0]] = True
    found = alone(robot, firm)
    np.testing.assert_array_equal(np.flatnonzero(found[:, TOE[0]]), [3, 4])
    assert not found[:, HEEL].any() and not found[:, 4:].any()


def stepping(share: float, rise: float = 0.006) -> np.ndarray:
    """Ceilings of a foot that stands for 5-30, its heel down till 25 in a clip that lifts it from 21 on."""
    resting = a_step(5, 25, 5, 30)
    lifted = np.zeros_like(resting)
    lifted[21:25, HEEL] = True
    return ceilings(resting, lifted, alone(toy(), resting & ~lifted), rise, share)


def test_ceilings_are_low_but_next_to_the_swing() -> None:
    low = stepping(0.0)
    assert (low[21:25, HEEL] == 0.006).all() and (low[21:30, TOE] == 0.006).all()
    assert np.count_nonzero(low) == 2 * 4 + 2 * 9
    # Of 90 frames of points 4 % are 3: enough for the heel's last frame, not for the toes' as well.
    some = stepping(0.04)
    np.testing.assert_array_equal(np.argwhere(some == FREE), [[24, 2], [24, 3]])
    more = stepping(0.06)
    assert np.count_nonzero(more == FREE) == 4 and (more[29, TOE] == FREE).all()
    np.testing.assert_array_equal(more > 0.0, low > 0.0)


@pytest.mark.parametrize("share", [0.0, 0.01, 0.05, 0.2, 1.0])
def test_no_more_than_the_share_is_free(share: float) -> None:
    found = stepping(share)
    assert np.count_nonzero(found == FREE) <= share * 90
    assert not stepping(share, rise=0.0).any()
