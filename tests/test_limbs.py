"""When hands and knees rest: balls whose way is known, a robot on all fours, and clips in which nothing may change."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from limb_clips import HANDS, KNEES, on_all_fours
from metrics_toy import FPS, clip, standing
from optimiser_setup import toy

from gmr_traj.contacts.carrying import carrying
from gmr_traj.contacts.detect import detect
from gmr_traj.contacts.ends import continued
from gmr_traj.contacts.limbs import limb_points, lowest_of_feet, resting_limbs
from gmr_traj.contacts.mask import from_mask, limbs_to_mask, to_mask
from gmr_traj.contacts.schedule import LIMB, ContactSchedule, Stance
from gmr_traj.contacts.schedule_json import to_json
from gmr_traj.formats import read_clip
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.metrics.foot_contact import stance_mask
from gmr_traj.metrics.observation import observe
from gmr_traj.metrics.stances import stance_tracks
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import BodySupport, Robot
from gmr_traj.runs import runs


def with_arm(balls: int = 1) -> Robot:
    """The toy with its arm as a support of so many balls."""
    arm = BodySupport("arm", ("arm",), ("arm",) * balls, np.tile([0.0, 0.0, -0.3], (balls, 1)), np.full(balls, 0.04))
    return replace(toy(), supports=(arm,))


def found(height: np.ndarray, along: np.ndarray) -> list[tuple[int, int]]:
    """Stances of one ball that moves so.  # (T,), (T,)"""
    centre = np.stack([along, 0 * along, height], axis=1)[:, None]
    return runs(resting_limbs(with_arm(), centre, height[:, None], FPS)[:, 0])


def test_a_hand_that_hovers_and_creeps_rests() -> None:
    t = np.arange(100) / FPS
    assert found(0.02 * np.sin(1.5 * t), 0.02 * t) == [(0, 100)]
    assert found(-0.03 + 0 * t, 0 * t) == [(0, 100)]  # in the floor


def test_a_hand_that_swings_past_the_floor_does_not() -> None:
    angle = 1.2 * np.cos(5.0 * np.arange(200) / FPS)
    assert found(0.5 * (1 - np.cos(angle)), 0.5 * np.sin(angle)) == []


@pytest.mark.parametrize(
    ("frames", "speed", "height"),
    [(8, 0.0, 0.0), (100, 0.15, 0.0), (100, 0.0, 0.028)],
    ids=["a short touch", "dragged over a third of a metre", "three centimetres up"],
)
def test_what_is_not_sure_is_no_stance(frames: int, speed: float, height: float) -> None:
    at = np.full(160, 0.3)
    at[30 : 30 + frames] = height
    assert found(at, speed * np.arange(160) / FPS) == []


def test_a_stance_ends_where_the_hand_rises() -> None:
    height = np.concatenate([np.zeros(60), np.linspace(0.0, 0.2, 60)])  # 0.17 m/s
    ((start, stop),) = found(height, 0 * height)
    assert start == 0 and height[stop - 1] <= 0.01 < height[stop]


def test_a_tilted_limb_rests_on_its_lowest_ball() -> None:
    centres = np.zeros((50, 2, 3))
    for above, expected in ((0.015, False), (0.003, True)):
        height = np.tile([0.0, above], (50, 1))
        on = resting_limbs(with_arm(2), centres, height, FPS)
        assert on[:, 0].all() and (on[:, 1] == expected).all()


@given(st.integers(0, 2**32 - 1))
def test_noise_does_not_make_it_flap(seed: int) -> None:
    rng = np.random.default_rng(seed)
    height = rng.uniform(0.0, 0.015) + rng.normal(0.0, 0.002, 150)
    found_runs = found(height, rng.normal(0.0, 0.0015, 150))
    assert len(found_runs) == 1 and found_runs[0][1] - found_runs[0][0] > 120


def test_on_all_fours(g1: Robot) -> None:
    motion = on_all_fours(g1, 150)
    schedule = detect(motion, g1)
    assert schedule.height == pytest.approx(0.0, abs=1e-3)
    own = {name: [(s.start, s.stop) for s in schedule.stances if s.sole == name] for name in HANDS + KNEES}
    assert len(schedule.stances) == sum(map(len, own.values())) == 5
    for name in (*KNEES, "right_hand"):
        assert own[name] == [(0, 150)]
    # The left hand is off the floor from frame 60 to 90; it leaves and arrives slowly.
    (first, last) = own["left_hand"]
    assert first[0] == 0 and 60 <= first[1] < 68 and 82 < last[0] <= 90 and last[1] == 150
    # Hands and knees bear it: no foot is put into stance that does not stand.
    assert carrying(schedule, motion, g1).stances == schedule.stances
    # Feet are judged by stances of feet.
    seen = observe(motion, g1)
    assert stance_tracks(seen, schedule) == () and not stance_mask(schedule, g1).any()


def test_a_clip_without_declared_supports_is_as_before(g1: Robot) -> None:
    schedule = detect(on_all_fours(g1, 30), replace(g1, supports=()))
    assert all(stance.part != LIMB for stance in schedule.stances)


def test_the_floor_is_where_the_feet_or_else_the_hands_are(g1: Robot) -> None:
    fours = on_all_fours(g1, 3, step=False).qpos
    upside_down = np.tile(g1.nominal, (3, 1))
    upside_down[:, 2:7] = [1.0, 0.0, 1.0, 0.0, 0.0]
    upside_down[:, 7 + g1.joint_names.index("left_shoulder_pitch_joint")] = -3.0  # an arm up, now down
    for qpos in (np.tile(g1.nominal, (3, 1)), fours, upside_down):
        placed = placements(g1, qpos)
        seen = observe(RobotMotion(qpos, 30.0, g1.joint_names), g1)
        soles = np.concatenate(seen.soles, axis=1)[..., 2].min(axis=1)
        centres, radii = limb_points(g1, placed)
        low = lowest_of_feet(g1, placed, soles, centres[..., 2] - radii)
        expected = seen.lowest.min(axis=1) if qpos is not upside_down else (centres[..., 2] - radii).min(axis=1)
        np.testing.assert_allclose(low, expected, atol=2e-3)


def test_balls_are_where_their_shapes_are(g1: Robot) -> None:
    motion = on_all_fours(g1, 4)
    centres, radii = limb_points(g1, placements(g1, motion.qpos))
    seen, last = observe(motion, g1), 0
    names = [capsule.name for capsule in g1.capsules]
    for support in g1.supports:
        own = slice(last, last := last + len(support.points))
        shapes = seen.lowest[:, [names.index(shape) for shape in support.shapes]].min(axis=1)
        np.testing.assert_allclose((centres[..., 2] - radii)[:, own].min(axis=1), shapes, atol=1e-12)
    assert last == centres.shape[1] == len(radii)


def test_masks_keep_soles_and_limbs_apart() -> None:
    robot = with_arm()
    both = ContactSchedule(20, FPS, (Stance("arm", 0, LIMB, 3, 9), Stance("left", 1, "toe", 5, 12)))
    soles, limbs = to_mask(both, robot), limbs_to_mask(both, robot)
    assert (soles.sum(), limbs.sum()) == (7, 6)
    assert from_mask(both, robot, soles) == both == from_mask(both, robot, soles, limbs)
    assert from_mask(both, robot, 0 * soles > 0).stances == both.stances[:1]
    # A hand that stands where a spoiled beginning ends has stood since the first frame.
    assert continued(both, robot, np.arange(20) >= 3).stances[0] == Stance("arm", 0, LIMB, 0, 9)


def test_nothing_changes_for_a_robot_on_its_feet(g1: Robot, data_dir: Path) -> None:
    bare = replace(g1, supports=())
    for name in ("0807_yanjie_walk_002.pkl", "0807_yanjie_walk_006.pkl", "0807_yanjie_walk_010.pkl"):
        motion = read_clip(data_dir / "gmr_pkl" / name, g1).motion
        one, other = (carrying(detect(motion, robot), motion, robot) for robot in (g1, bare))
        assert to_json(one) == to_json(other)


def test_on_hands_a_foot_stands_on_its_tip() -> None:
    """Contact points of a tilted foot are above the floor; its lowest point is what is judged while an arm stands."""
    qpos = standing(6)
    qpos[:, 3:7] = [np.cos(0.2), 0.0, np.sin(0.2), 0.0]  # leant forward, the outline ahead of the toes
    robot, motion = with_arm(), clip(qpos)
    toes = ContactSchedule(6, FPS, (Stance("left", 0, "toe", 0, 6),))
    (alone,) = stance_tracks(observe(motion, robot), toes)
    (leaning,) = stance_tracks(
        observe(motion, robot), replace(toes, stances=(Stance("arm", 0, LIMB, 2, 4), *toes.stances))
    )
    seen = observe(motion, robot)
    np.testing.assert_array_equal(alone.height, seen.soles[0][:, 0, 2])
    np.testing.assert_array_equal(leaning.height[[0, 1, 4, 5]], alone.height[[0, 1, 4, 5]])
    lowest = np.minimum(seen.outlines[0][..., 2].min(axis=1), seen.lowest[:, 1])  # of the left leg
    np.testing.assert_allclose(leaning.height[2:4], lowest[2:4])
    assert leaning.height[2] < alone.height[2]


def test_a_toy_without_supports() -> None:
    motion = clip(standing(5))
    assert limb_points(toy(), placements(toy(), motion.qpos))[0].shape == (5, 0, 3)
    assert detect(motion, toy()).stances
