from __future__ import annotations

import metrics_toy as toys
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from gmr_traj.contacts.schedule import ContactSchedule, Stance
from gmr_traj.references import BodyTargets
from gmr_traj.resampling import frames_within, resample, resample_schedule, resample_targets


def turning(frames: int, fps: float) -> np.ndarray:
    """Walks along x at 1 m/s, turns at 1 rad/s, swings a leg evenly."""
    time = np.arange(frames) / fps
    qpos = toys.standing(frames)
    qpos[:, 0], qpos[:, 8] = time, 0.3 * time
    qpos[:, 3:7] = Rotation.from_euler("z", time[:, None]).as_quat(scalar_first=True)
    return qpos


@given(st.sampled_from([24.0, 29.97, 30.0, 50.0, 60.0, 120.0]), st.sampled_from([25.0, 30.0, 50.0]))
def test_even_motion_is_the_same_at_any_rate(fps, new_fps):
    clip = resample(toys.clip(turning(40, fps), fps), new_fps)
    assert clip.fps == new_fps
    last = (clip.frames - 1) / new_fps
    assert last <= 39 / fps + 1e-6 and last > 39 / fps - 1 / new_fps - 1e-6
    np.testing.assert_allclose(clip.qpos, turning(clip.frames, new_fps), atol=1e-6)


def test_quaternions_of_either_sign_are_one_rotation():
    qpos = turning(10, 50.0)
    qpos[1::2, 3:7] *= -1.0
    other = resample(toys.clip(qpos, 50.0), 30.0).qpos
    turn = Rotation.from_quat(other[:, 3:7], scalar_first=True).as_euler("zyx")[:, 0]
    np.testing.assert_allclose(turn, np.arange(len(turn)) / 30.0, atol=1e-9)


def test_one_frame_and_the_same_rate():
    one = resample(toys.clip(turning(1, 50.0)), 30.0)
    assert one.frames == 1 and one.fps == 30.0
    clip = toys.clip(turning(5, 50.0))
    np.testing.assert_array_equal(resample(clip, 50.0).qpos, clip.qpos)


def test_targets():
    qpos = turning(26, 50.0)
    weights = np.ones(1)
    targets = BodyTargets(("torso",), qpos[:, None, :3], qpos[:, None, 3:7], weights, weights)
    slow = resample_targets(targets, 50.0, 30.0)
    expected = turning(slow.frames, 30.0)
    np.testing.assert_allclose(slow.positions[:, 0], expected[:, :3], atol=1e-9)
    np.testing.assert_allclose(np.abs((slow.quaternions[:, 0] * expected[:, 3:7]).sum(axis=1)), 1.0, atol=1e-9)


def test_a_schedule_holds_the_frames_within_each_stance():
    stances = (Stance("left", 0, "toe", 10, 21), Stance("left", 1, "toe", 41, 42), Stance("right", 0, "toe", 95, 100))
    slow = resample_schedule(ContactSchedule(100, 100.0, stances), 30.0, 28)
    # 0.10 to 0.20 s hold frames 3 to 6 of 30 Hz; nothing at 0.41 s; 0.95 s is frame 28.5, beyond the cut.
    assert slow.stances == (Stance("left", 0, "toe", 3, 7),)
    assert (slow.frames, slow.fps) == (28, 30.0)


@pytest.mark.parametrize(("seconds", "fps", "frames"), [(0.0, 30.0, 1), (1.0, 30.0, 31), (39 / 30, 30.0, 40)])
def test_frames_within(seconds, fps, frames):
    assert frames_within(seconds, fps) == frames
