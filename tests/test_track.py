"""Clips made ready for showing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from metrics_toy import FPS, both_feet, clip, standing, toy

from gmr_traj.exceptions import ClipError
from gmr_traj.track import ContactForces, track

ROBOT = toy()


def jumping(frames: int = 60) -> np.ndarray:
    qpos = standing(frames)
    qpos[30, 9] = 0.2  # the shoulder, for one frame: 10 rad/s
    qpos[:, 2] -= 0.03
    return qpos


def test_stands_on_the_floor_unless_left_as_it_is():
    schedule = both_feet(60, height=0.03)
    level = track("raw", clip(jumping()), ROBOT, schedule)
    as_is = track("raw", clip(jumping()), ROBOT, schedule, level=False)
    lowest = [next(s.values.min() for s in shown.signals if s.name == "sole_height") for shown in (level, as_is)]
    assert lowest == pytest.approx([0.0, -30.0], abs=1e-9)
    assert (level.raised, as_is.raised) == (0.03, 0.0)
    assert level.schedule.height == as_is.schedule.height == 0.0
    assert level.artefacts == as_is.artefacts  # what is wrong with it is the same


def test_the_worst_artefact_is_not_one_of_the_whole_clip():
    shown = track("raw", clip(jumping()), ROBOT, both_feet(60, height=0.03))
    assert {a.kind for a in shown.artefacts} >= {"height", "jump"}
    worst = shown.worst()
    assert worst is not None and worst.kind == "jump"
    assert shown.worst(around=0.6) == worst
    assert shown.worst(around=0.6, within=0.0) == worst  # it happens then
    assert shown.worst(around=0.0, within=0.1) is None


def test_the_frame_of_a_time_is_the_one_that_has_begun():
    shown = track("raw", clip(standing(60)), ROBOT, both_feet(60))
    for frame in range(60):
        assert shown.frame(frame / FPS) == frame
        assert shown.frame((frame + 0.9) / FPS) == frame
    assert (shown.frame(-1.0), shown.frame(100.0)) == (0, 59)


def test_forces_go_up_with_the_clip():
    points = np.zeros((60, 2, 3))
    forces = ContactForces(points, np.ones((60, 2, 3)))
    shown = track("rollout", clip(jumping()), ROBOT, both_feet(60, height=0.03), forces=forces)
    assert shown.forces is not None
    np.testing.assert_allclose(shown.forces.points[..., 2], 0.03)
    with pytest.raises(ClipError, match="contact forces have 60 frames, the clip 50"):
        track("rollout", clip(standing(50)), ROBOT, both_feet(50), forces=forces)
    with pytest.raises(ClipError, match=r"expected \(T, K, 3\)"):
        replace(forces, points=np.zeros((60, 3)))
    with pytest.raises(ClipError, match="not finite"):
        replace(forces, points=np.full((60, 2, 3), np.nan))
