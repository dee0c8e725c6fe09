"""Stances of a person's feet, on motions whose stances are known."""

from __future__ import annotations

import numpy as np
import pytest

from gmr_traj.contacts.human_contacts import human_contacts

NAMES = ("left_ankle", "right_ankle")


def steps(fps: float, noise: float = 0.0, floor: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Ankles that stand for half a second in turn and swing 0.6 m ahead and 0.15 m up in between; and the truth."""
    time = np.arange(0.1, 6, 1 / fps)
    positions = np.zeros((len(time), 2, 3))
    truth = np.zeros((len(time), 2), dtype=bool)
    for k in range(2):
        phase = time + 0.5 * k
        swing = np.clip(phase % 1.0 - 0.5, 0, None) * 2  # 0 in stance, 0 to 1 in the swing
        positions[:, k, 0] = 0.6 * (np.floor(phase) + (1 - np.cos(np.pi * swing)) / 2)
        positions[:, k, 2] = 0.09 + 0.15 * np.sin(np.pi * swing) ** 2
        truth[:, k] = swing == 0
    positions += noise * np.random.default_rng(0).normal(size=positions.shape)
    positions[..., 2] += floor
    return positions, truth


@pytest.mark.parametrize("fps", [30.0, 60.0, 120.0])
@pytest.mark.parametrize("floor", [0.0, -0.3, 1.0])
@pytest.mark.parametrize("noise", [0.0, 0.001])
def test_steps_are_found_to_a_tenth_of_a_second(fps: float, floor: float, noise: float) -> None:
    positions, truth = steps(fps, noise, floor)
    flags = human_contacts(NAMES, positions, fps, [NAMES])
    for k, name in enumerate(NAMES):
        wrong = np.flatnonzero(flags[name] != truth[:, k])
        edges = np.flatnonzero(np.diff(truth[:, k]))
        assert len(edges) > 10
        assert all(np.abs(edges - frame).min() <= 0.1 * fps for frame in wrong)
        assert np.count_nonzero(np.diff(flags[name])) == len(edges)  # one stance a step, no flicker


def test_a_foot_that_is_never_down_has_no_stance() -> None:
    positions, _ = steps(30.0)
    positions[:, 1] = (0.3, 0.0, 0.4)
    flags = human_contacts(NAMES, positions, 30.0, [NAMES])
    assert not flags["right_ankle"].any()
    assert flags["left_ankle"].mean() > 0.4


def test_a_foot_that_slides_along_the_floor_has_no_stance() -> None:
    positions = np.zeros((60, 2, 3))
    positions[:, 0, 0] = np.linspace(0, 3, 60)  # 1.5 m/s
    flags = human_contacts(NAMES, positions, 30.0, [NAMES])
    assert not flags["left_ankle"].any()
    assert flags["right_ankle"].all()


def test_flight_only_and_one_frame() -> None:
    positions = np.zeros((30, 2, 3))
    positions[..., 2] = np.linspace(0, 6, 30)[:, None]
    assert not any(flags.any() for flags in human_contacts(NAMES, positions, 30.0, [NAMES]).values())
    assert not any(flags.any() for flags in human_contacts(NAMES, positions[:1], 30.0, [NAMES]).values())
