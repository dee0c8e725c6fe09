"""Feet, steps, the centre of mass and the legs of a lead."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gmr_traj.constants import GRAVITY
from gmr_traj.contacts.detect import detect
from gmr_traj.contacts.schedule import Stance
from gmr_traj.formats.human import read_human
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.lead import Leads, extend
from gmr_traj.lead.arrival import Moving, arrival, standing
from gmr_traj.lead.centre_path import JERK, OFF, centre_path
from gmr_traj.lead.feet import LIFT, feet_of, foot_path, place_of, standing_feet
from gmr_traj.lead.legs import bend_legs
from gmr_traj.lead.steps import DOUBLE, QUICKEST, SHIFT, STEP, pressed_at, shortest, step_plans
from gmr_traj.motion import RobotMotion
from gmr_traj.retarget.body_map import default_map_name, load_map
from gmr_traj.retarget.retarget import retarget

FPS = 50.0
EVERYTHING = ("left", "right")


def feet_at(robot, q, resting):
    """Feet of a robot that stays in one configuration, all of the points of some of its soles at rest."""
    motion = RobotMotion(np.tile(q, (8, 1)), FPS, robot.joint_names, robot.name)
    stances = tuple(
        Stance(sole.name, k, part, 0, 8)
        for sole in robot.soles
        for k, part in enumerate(sole.parts)
        if sole.name in resting
    )
    return feet_of(arrival(motion, robot), motion, robot, stances)


def test_a_robot_that_stands_where_the_clip_has_it_takes_no_step(g1):
    feet = feet_at(g1, g1.nominal, EVERYTHING)
    stands = standing_feet(feet, g1, np.array(g1.nominal))
    (plan,) = step_plans(feet, stands, 1.0)
    assert plan.swings == () and shortest(feet, stands) == pytest.approx(QUICKEST * SHIFT)


def test_feet_that_stand_elsewhere_step_one_after_the_other_in_either_order(g1):
    feet = feet_at(g1, g1.nominal, EVERYTHING)
    stands = standing_feet(feet, g1, standing(g1, np.array([-0.3, 0.0]), 0.0))
    plans = step_plans(feet, stands, 2.0)
    assert sorted(tuple(swing.foot for swing in plan.swings) for plan in plans) == [(0, 1), (1, 0)]
    for plan in plans:
        first, second = plan.swings
        assert -plan.active < first.lifts < first.lands < second.lifts < second.lands < 0.0
        assert 2.0 >= plan.active
    least = QUICKEST * (SHIFT + 2 * (STEP + DOUBLE))
    assert shortest(feet, stands) == pytest.approx(least)
    assert step_plans(feet, stands, least - 1e-6) == [] and step_plans(feet, stands, least + 1e-6)


def test_a_foot_in_the_air_is_lifted_into_the_clip(g1):
    q = np.array(g1.nominal)
    q[7 + g1.joint_names.index("left_hip_pitch_joint")] -= 0.8
    feet = feet_at(g1, q, ("right",))
    assert [foot.stands for foot in feet] == [False, True]
    (plan,) = step_plans(feet, standing_feet(feet, g1, np.array(g1.nominal)), 1.0)
    (swing,) = plan.swings
    assert (swing.foot, swing.lands) == (0, None) and -plan.active < swing.lifts < 0.0


def test_a_foot_that_hovers_low_and_slow_is_meant_to_stand(g1):
    q = np.array(g1.nominal)
    q[2] += 0.03
    assert all(foot.stands and not foot.resting for foot in feet_at(g1, q, ()))


def test_a_foot_that_creeps_stands_where_it_is_on_average(g1):
    qpos = np.tile(g1.nominal, (8, 1))
    qpos[:, 0] += np.linspace(0.0, 0.07, 8)
    motion = RobotMotion(qpos, FPS, g1.joint_names, g1.name)
    foot = feet_of(arrival(motion, g1), motion, g1, (Stance("left", 0, "toe", 0, 4),))[0]
    assert foot.place[0] == pytest.approx(foot.at.value[0] + 0.015) and foot.heading == pytest.approx(0.0)


@settings(max_examples=12)
@given(st.floats(-0.4, 0.4), st.floats(-0.2, 0.2), st.floats(-0.4, 0.4))
def test_a_step_leaves_flat_comes_down_flat_and_clears_the_floor(g1, x, y, turn):
    feet = feet_at(g1, g1.nominal, EVERYTHING)
    stands = standing_feet(feet, g1, standing(g1, np.array([x, y]), turn))
    times = np.arange(-60, 1) / FPS
    path = foot_path(feet[0], stands[0], times, -1.0, -0.5)
    planted = times <= -1.0
    np.testing.assert_allclose(path.at[planted], np.tile(stands[0].at, (planted.sum(), 1)), atol=1e-12)
    place = place_of(feet[0], stands[0])
    np.testing.assert_allclose(path.at[times >= -0.5], np.tile(place.at, ((times >= -0.5).sum(), 1)), atol=1e-9)
    assert path.at[:, 2].min() > -1e-9
    assert path.at[:, 2].max() == pytest.approx(LIFT, rel=0.02)
    upright = path.turned.as_matrix()[:, 2, 2]
    np.testing.assert_allclose(upright, 1.0, atol=1e-9)  # the soles of the default posture are flat
    rest = placements(g1, np.array(g1.nominal)[None])[1][0, feet[0].slot]
    np.testing.assert_allclose(path.turned[-1].as_matrix(), rest, atol=1e-9)


def test_the_floor_presses_under_the_foot_that_stands_while_the_other_is_in_the_air(g1):
    feet = feet_at(g1, g1.nominal, EVERYTHING)
    stands = standing_feet(feet, g1, standing(g1, np.array([-0.3, 0.0]), 0.0))
    times = np.arange(-150, 1) / FPS
    for plan in step_plans(feet, stands, 3.0):
        pressed = pressed_at(plan, feet, stands, np.zeros(2), times)
        first, second = plan.swings
        during = (times >= first.lifts) & (times <= first.lands)
        np.testing.assert_allclose(pressed[during], np.tile(stands[second.foot].middle[:2], (during.sum(), 1)))
        landed = place_of(feet[first.foot], stands[first.foot]).middle[:2]
        during = (times >= second.lifts) & (times <= second.lands)
        np.testing.assert_allclose(pressed[during], np.tile(landed, (during.sum(), 1)), atol=1e-12)
        np.testing.assert_allclose(pressed[-1], 0.0, atol=1e-12)
        np.testing.assert_allclose(pressed[0], np.mean([s.middle[:2] for s in stands], axis=0))


def test_a_centre_of_mass_that_has_nowhere_to_go_stays(g1):
    still = Moving(np.array([0.1, 0.2]), np.zeros(2), np.zeros(2))
    path = centre_path(still.value, still, np.full(53, 0.7), np.tile(still.value, (51, 1)), FPS)
    np.testing.assert_allclose(path.at, np.tile(still.value, (51, 1)), atol=1e-9)
    assert path.cost == pytest.approx(0.0, abs=1e-12)


def test_the_way_of_the_centre_of_mass_keeps_its_ends_and_is_the_best(g1):
    rng = np.random.default_rng(3)
    end = Moving(np.array([0.3, 0.05]), np.array([0.6, -0.1]), np.array([0.5, 0.2]))
    height, pressed = 0.7 + 0.01 * np.sin(np.arange(53) / 8.0), np.tile([0.05, 0.1], (51, 1))
    start = np.array([0.0, 0.02])
    path = centre_path(start, end, height, pressed, FPS)
    np.testing.assert_allclose(path.at[:3], np.tile(start, (3, 1)))
    np.testing.assert_allclose(path.at[-1], end.value)

    def cost(at):
        """The module's formula, written down a second time."""
        after = np.arange(1, 3)[:, None] / FPS
        ahead = end.value + after * end.velocity + 0.5 * after**2 * end.acceleration
        c = np.concatenate([at, ahead])
        second, third = np.diff(c, 2, axis=0) * FPS**2, np.diff(c, 3, axis=0) * FPS**3
        lift = GRAVITY + np.diff(height, 2) * FPS**2
        zmp = c[1:-1] - (height[1:-1] / lift)[:, None] * second
        off = zmp[: len(at) - 1] - pressed[1:]
        return np.sum(np.square(third[: len(at) - 1])) / JERK**2 + np.sum(np.square(off)) / OFF**2

    best = cost(path.at)
    assert best / (2 * 2 * 50) == pytest.approx(path.cost)  # a mean over both axes, of jerks and offsets
    for _ in range(20):
        other = path.at.copy()
        other[3:-1] += 1e-4 * rng.normal(size=other[3:-1].shape)
        assert cost(other) > best


def test_legs_put_the_feet_where_they_should_be(g1):
    feet = feet_at(g1, g1.nominal, EVERYTHING)
    stands = standing_feet(feet, g1, standing(g1, np.array([-0.1, 0.02]), 0.1))
    times = np.arange(-50, 1) / FPS
    paths = (
        foot_path(feet[0], stands[0], times, -0.8, -0.4),
        foot_path(feet[1], stands[1], times, None, None),
    )
    qpos = np.tile(standing(g1, np.array([-0.05, 0.01]), 0.05), (len(times), 1))
    bent = bend_legs(g1, qpos, feet, paths)
    positions, rotations = placements(g1, bent)
    for foot, path in zip(feet, paths, strict=True):
        at = positions[:, foot.slot] + rotations[:, foot.slot] @ foot.pivot
        assert np.abs(at - path.at).max() < 1e-4
        assert np.abs(rotations[:, foot.slot] - path.turned.as_matrix()).max() < 1e-3
    assert np.abs(np.diff(bent, axis=0)).max() < 0.15  # no leg flips over
    others = [0, 1, *range(3, 7)]
    np.testing.assert_array_equal(bent[:, others], qpos[:, others])
    arms = [7 + k for k, name in enumerate(g1.joint_names) if "shoulder" in name or "waist" in name]
    np.testing.assert_array_equal(bent[:, arms], qpos[:, arms])


def test_a_base_that_is_too_high_for_the_legs_comes_down(g1):
    feet = feet_at(g1, g1.nominal, EVERYTHING)
    stands = standing_feet(feet, g1, np.array(g1.nominal))
    paths = tuple(foot_path(f, s, np.array([-0.02, 0.0]), None, None) for f, s in zip(feet, stands, strict=True))
    qpos = np.tile(g1.nominal, (2, 1))
    qpos[:, 2] += 0.3
    bent = bend_legs(g1, qpos, feet, paths)
    positions, rotations = placements(g1, bent)
    at = positions[:, feet[0].slot] + rotations[:, feet[0].slot] @ feet[0].pivot
    assert np.abs(at - paths[0].at).max() < 2e-3
    assert (bent[:, 2] < g1.nominal[2] + 0.1).all()
    assert (bent[:, 7:] >= g1.position_lower).all() and (bent[:, 7:] <= g1.position_upper).all()


def test_a_base_beyond_what_the_ankles_can_do_neither_rises_nor_bends_a_knee_backwards(g1):
    feet = feet_at(g1, g1.nominal, EVERYTHING)
    stands = standing_feet(feet, g1, np.array(g1.nominal))
    times = np.arange(-30, 1) / FPS
    paths = tuple(foot_path(f, s, times, None, None) for f, s in zip(feet, stands, strict=True))
    qpos = np.tile(g1.nominal, (len(times), 1))
    qpos[:, 1] += np.linspace(0.0, 0.25, len(times))  # an ankle rolls by 0.26 rad at most
    bent = bend_legs(g1, qpos, feet, paths)
    assert (bent[:, 2] <= qpos[:, 2]).all()
    knees = [7 + k for k, name in enumerate(g1.joint_names) if "knee" in name]
    assert bent[:, knees].min() > 0.0
    assert np.abs(np.diff(bent, axis=0)).max() < 0.15  # no leg flips over


def test_recorded_clips_that_begin_with_tilted_feet_can_be_led_into(data_dir, g1):
    bvh = data_dir / "cmu_bvh" / "131_02.bvh"
    if not bvh.is_file():
        pytest.skip(f"{bvh} does not exist")
    human = read_human(bvh)
    found = retarget(human, g1, load_map(default_map_name(human.rig, g1.name), g1))
    motion = found.motion.with_qpos(found.motion.qpos[:120])
    extended = extend(motion, g1, detect(motion, g1), Leads(1.5, None))
    lead = slice(0, extended.before.frames + 1)
    fastest = np.abs(np.diff(extended.motion.qpos[lead, 7:], axis=0)).max() * motion.fps
    assert fastest < 8.0, "the knees do not snap"
