"""A clip and its human are brought together whatever world, rate and first frame their files have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from people import walker
from scipy.spatial.transform import Rotation

from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.exceptions import ClipError
from gmr_traj.motion import RobotMotion
from gmr_traj.references import BodyTargets
from gmr_traj.resampling import resample
from gmr_traj.retarget.body_map import load_map
from gmr_traj.retarget.joining import join
from gmr_traj.retarget.retarget import Retargeted, retarget
from gmr_traj.retarget.source import person_schedule
from gmr_traj.retarget.targets import scaled_targets
from gmr_traj.robot import Robot

Walk = tuple[BodyTargets, ContactSchedule, Retargeted]


@pytest.fixture(scope="module")
def walk(g1: Robot) -> Walk:
    body_map = load_map("lafan1_to_unitree_g1", g1)
    human = walker(60)
    return scaled_targets(human, body_map), person_schedule(human, g1, body_map), retarget(human, g1, body_map)


def moved(motion: RobotMotion, yaw: float, shift: tuple[float, float, float]) -> RobotMotion:
    turn = Rotation.from_euler("z", yaw)
    qpos = motion.qpos.copy()
    qpos[:, :3] = turn.apply(qpos[:, :3]) + shift
    qpos[:, 3:7] = (turn * Rotation.from_quat(qpos[:, 3:7], scalar_first=True)).as_quat(scalar_first=True)
    return motion.with_qpos(qpos)


@pytest.mark.parametrize(("yaw", "shift"), [(0.0, (0, 0, 0)), (np.pi / 2, (3, -1, 0.2)), (-3.0, (0, 100, -0.5))])
def test_the_human_comes_to_where_the_clip_is(
    g1: Robot, walk: Walk, yaw: float, shift: tuple[float, float, float]
) -> None:
    targets, _, result = walk
    here, there = (
        join("walk", targets, 30.0, m, g1).targets for m in (result.motion, moved(result.motion, yaw, shift))
    )
    turn = Rotation.from_euler("z", yaw)
    expected = turn.apply(np.array(here.positions.reshape(-1, 3))).reshape(here.positions.shape) + shift
    np.testing.assert_allclose(there.positions, expected, atol=1e-9)
    turned = turn * Rotation.from_quat(here.quaternions.reshape(-1, 4), scalar_first=True)
    off = turned * Rotation.from_quat(there.quaternions.reshape(-1, 4), scalar_first=True).inv()
    assert off.magnitude().max() < 1e-9
    # The retargeter's own targets, which it raised with the clip, are about there.
    assert np.abs(here.positions - result.references.positions)[..., :2].max() < 0.2


@pytest.mark.parametrize("fps", [30.0, 50.0, 20.0])
def test_rates_may_differ(g1: Robot, walk: Walk, fps: float) -> None:
    targets, stances, result = walk
    motion = resample(result.motion, fps)
    joined = join("walk", targets, 30.0, motion, g1, stances)
    assert joined.targets.frames == motion.frames
    assert joined.stances is not None and joined.stances.frames == motion.frames and joined.stances.fps == fps
    assert any("resampled" in note for note in joined.notes) == (fps != 30.0)


def test_a_frame_more_or_less_is_the_same_clip(g1: Robot, walk: Walk) -> None:
    targets, _, result = walk
    for frames in (58, 59):
        cut = result.motion.with_qpos(result.motion.qpos[:frames])
        np.testing.assert_allclose(
            join("walk", targets, 30.0, cut, g1).targets.quaternions, targets.quaternions[:frames], atol=0.03
        )
    with pytest.raises(ClipError, match=r"walk lasts 2\.00 s, the clip 1\.33 s; .* cut the longer one"):
        join("walk", targets, 30.0, result.motion.with_qpos(result.motion.qpos[:40]), g1)


def test_another_motion_is_refused(g1: Robot, walk: Walk) -> None:
    targets, _, result = walk
    lying = result.motion.qpos.copy()
    lying[:, 3:7] = [np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0]
    with pytest.raises(ClipError, match=r"walk does not do what the clip does: .* cm apart"):
        join("walk", targets, 30.0, result.motion.with_qpos(lying), g1)


def test_without_contacts_there_are_no_stances(g1: Robot, walk: Walk) -> None:
    targets, _, result = walk
    assert join("walk", targets, 30.0, result.motion, g1).stances is None


def test_a_map_for_other_bodies_is_refused(g1: Robot, walk: Walk) -> None:
    targets, _, result = walk
    with pytest.raises(ClipError, match="walk: the map has no target for any body of unitree_g1"):
        join("walk", replace(targets, names=tuple(f"no_{n}" for n in targets.names)), 30.0, result.motion, g1)
