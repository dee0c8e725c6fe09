"""Trust: full where a motion is plausible, little around a fault, next to none at a spoiled start or end."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from metrics_toy import FPS, clip, standing
from scipy.spatial.transform import Rotation

from gmr_traj.trust import trust


def dancing(frames: int = 100) -> np.ndarray:
    """Lively but plausible: a second of everything at 1 Hz.  # (T, 10)"""
    t = np.arange(frames) / FPS
    qpos = standing(frames)
    qpos[:, 0] = 0.3 * np.sin(2 * np.pi * t)
    qpos[:, 3:7] = Rotation.from_rotvec(np.outer(np.sin(2 * np.pi * t), [0, 0, 1])).as_quat(scalar_first=True)
    qpos[:, 7:] = np.sin(2 * np.pi * t)[:, None]
    return qpos


def turned(qpos: np.ndarray, yaw: float) -> np.ndarray:
    """The whole clip about the vertical."""
    out, about = qpos.copy(), Rotation.from_euler("z", yaw)
    out[:, :3] = about.apply(qpos[:, :3])
    out[:, 3:7] = (about * Rotation.from_quat(qpos[:, 3:7], scalar_first=True)).as_quat(scalar_first=True)
    return out


def joint_jump(qpos: np.ndarray, at: int, size: float = 1.0) -> np.ndarray:
    out = qpos.copy()
    out[at:, 9] += size
    return out


def base_jump(qpos: np.ndarray, at: int) -> np.ndarray:
    out = qpos.copy()
    out[at:, 0] += 0.5
    return out


def base_turn(qpos: np.ndarray, at: int) -> np.ndarray:
    out = qpos.copy()
    out[at:] = turned(qpos, 1.0)[at:]
    return out


FAULTS = [joint_jump, base_jump, base_turn]


def test_a_plausible_motion_is_believed() -> None:
    np.testing.assert_array_equal(trust(clip(dancing())), 1.0)


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_not_and_the_rest_still_is(fault) -> None:  # type: ignore[no-untyped-def]
    values = trust(clip(fault(dancing(), 50)))
    assert values.shape == (100,) and (values > 0).all() and (values <= 1).all()
    assert values[49:51].max() < 0.5
    assert (values[:40] == 1).all() and (values[60:] == 1).all()


@given(st.floats(0.6, 3))
def test_the_worse_the_fault_the_less_trust(size: float) -> None:
    small, large = (trust(clip(joint_jump(standing(100), 50, s)))[50] for s in (size, 1.1 * size))
    assert large < small < 1


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("at", [1, 4])
def test_a_spoiled_start_or_end_is_not_believed_at_all(fault, at: int) -> None:  # type: ignore[no-untyped-def]
    values = trust(clip(fault(dancing(), at)))
    assert values[:at].max() < 1e-3 and (values[30:] == 1).all()
    backwards = clip(fault(dancing(), at)[::-1])
    np.testing.assert_allclose(trust(backwards), values[::-1], rtol=1e-6)


@given(st.floats(-4, 4), st.tuples(*[st.floats(-5, 5)] * 3), st.sampled_from(FAULTS))
def test_place_and_heading_do_not_matter(yaw: float, shift: tuple[float, ...], fault) -> None:  # type: ignore[no-untyped-def]
    qpos = fault(dancing(), 50)
    moved = turned(qpos, yaw)
    moved[:, :3] += shift
    np.testing.assert_allclose(trust(clip(moved)), trust(clip(qpos)), rtol=1e-6)


@given(st.sampled_from([30.0, 50.0, 120.0]))
def test_the_same_fault_counts_the_same_time_at_any_rate(fps: float) -> None:
    frames = round(4 * fps)
    values = trust(clip(joint_jump(standing(frames), frames // 2), fps=fps))
    spoiled = np.flatnonzero(values < 1)
    assert 0.1 < len(spoiled) / fps < 0.4
    assert abs(spoiled.mean() - frames / 2) < 0.1 * fps


@pytest.mark.parametrize("frames", [1, 2, 3, 4])
def test_short_clips(frames: int) -> None:
    np.testing.assert_array_equal(trust(clip(standing(frames))), 1.0)
    faulty = standing(frames)
    faulty[-1, 9] = 1.0
    assert trust(clip(faulty)).shape == (frames,)


def test_a_clip_cut_in_the_middle_of_a_fast_motion_is_believed_to_its_end() -> None:
    """A fault near the end that is no jump is as any other: what comes after it is not thrown away."""
    qpos = joint_jump(dancing(), 94, 0.3)
    values, middle = trust(clip(qpos)), trust(clip(joint_jump(dancing(), 50, 0.3)))
    np.testing.assert_allclose(values[88:99], middle[44:55], rtol=0.2)
    assert values[99] == 1.0 and values.min() > 1e-2


def test_faults_from_the_first_frame_on_are_a_transient() -> None:
    qpos = dancing()
    qpos[:4, 9] += [1.0, 0.3, 0.05, 0.0]  # on the way to the motion
    assert trust(clip(qpos))[:2].max() < 1e-3
    # The same a little later is not where the clip begins.
    qpos = dancing()
    qpos[8:12, 9] += [0.3, 0.1, 0.02, 0.0]
    assert trust(clip(qpos)).min() > 1e-3
