"""Clips with leads: what they begin and end with, and that clip and lead meet without a seam."""

from dataclasses import replace
from itertools import pairwise

import clip_files
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gmr_traj.contacts.detect import detect, sole_points
from gmr_traj.contacts.mask import owners
from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.exceptions import ClipError
from gmr_traj.formats import Clip, read_clip, write_clip
from gmr_traj.formats.longer import longer
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.lead import Added, Leads, extend
from gmr_traj.lead.lead_in import lead_in
from gmr_traj.motion import RobotMotion
from gmr_traj.references import BodyTargets
from gmr_traj.verify.audit import audit

FPS = 100.0


@pytest.fixture(scope="module")
def swaying(g1):
    """A robot that squats over flat soles and moves its arms, at speed in its first and last frames."""
    frames, t = 60, np.arange(60) / FPS
    qpos = np.tile(g1.nominal, (frames, 1))
    for side in ("left", "right"):
        for joint, share in (("hip_pitch", -1.0), ("knee", 2.0), ("ankle_pitch", -1.0)):
            qpos[:, 7 + g1.joint_names.index(f"{side}_{joint}_joint")] += share * 0.15 * np.sin(3.0 * t)
        qpos[:, 7 + g1.joint_names.index(f"{side}_shoulder_pitch_joint")] += 0.5 + 0.3 * np.sin(4.0 * t)
    foot = g1.body_names.index(g1.soles[0].body)
    planted = placements(g1, qpos)[0][:, foot]
    qpos[:, :3] -= planted - planted[0]
    turn = Rotation.from_euler("z", 0.7)
    qpos[:, :3] = turn.apply(qpos[:, :3]) + [1.0, -2.0, 0.0]
    qpos[:, 3:7] = (turn * Rotation.from_quat(qpos[:, 3:7], scalar_first=True)).as_quat(scalar_first=True)
    return RobotMotion(qpos, FPS, g1.joint_names, g1.name)


@pytest.fixture(scope="module")
def extended(swaying, g1):
    """The same with leads."""
    return extend(swaying, g1, detect(swaying, g1), Leads(1.0, 1.2))


def test_the_clip_is_between_its_leads(swaying, extended):
    assert (extended.before, extended.after) == (Added(100, 0), Added(120, 0))
    assert extended.motion.frames == extended.schedule.frames == 100 + 60 + 120
    np.testing.assert_allclose(extended.motion.qpos[100:160], swaying.qpos, atol=1e-12)


def test_it_begins_and_ends_in_the_default_posture_at_rest(extended, g1):
    np.testing.assert_array_equal(extended.held, [0, 1, 2, 277, 278, 279])
    held = extended.motion.qpos[extended.held]
    np.testing.assert_allclose(held[:, 7:], np.tile(g1.nominal[7:], (6, 1)), atol=1e-12)
    np.testing.assert_allclose(held[:, 2] + extended.schedule.height, g1.nominal[2], atol=1e-12)
    upright = Rotation.from_quat(held[:, 3:7], scalar_first=True).as_matrix()[:, 2, 2]
    np.testing.assert_allclose(upright, 1.0, atol=1e-12)
    for three in (held[:3], held[3:]):
        np.testing.assert_array_equal(three, np.tile(three[0], (3, 1)))


def test_clip_and_lead_meet_without_a_seam(swaying, extended):
    """Velocities and accelerations across a seam are those of the clip, to what they change in a frame."""
    qpos = np.delete(extended.motion.qpos, np.s_[3:7], axis=1)
    own = np.delete(swaying.qpos, np.s_[3:7], axis=1)
    first, second = np.diff(qpos, axis=0) * FPS, np.diff(qpos, 2, axis=0) * FPS**2
    assert np.abs(first[99] - (own[1] - own[0]) * FPS).max() < 0.08
    assert np.abs(first[159] - (own[-1] - own[-2]) * FPS).max() < 0.08
    # Joints take their velocity v up within 0.4 s, which needs a jerk of 36 v / 0.4^2; and the acceleration that they
    # arrive with is that of the clip's first 0.2 s.
    jerk = 36.0 * 1.3 / 0.4**2
    for seam in (98, 99, 158, 159):
        assert np.abs(second[seam] - second[seam - 1]).max() < 2.5 * jerk / FPS
    base = Rotation.from_quat(extended.motion.qpos[:, 3:7], scalar_first=True)
    turns = (base[1:] * base[:-1].inv()).as_rotvec() * FPS
    assert np.abs(np.diff(turns, axis=0)).max() * FPS < 1.0


def test_feet_stay_where_the_stances_of_a_lead_have_them(extended, g1):
    points = sole_points(extended.motion.shifted(extended.schedule.height), g1)
    columns = {(sole, point): k for k, (sole, point, _) in enumerate(owners(g1))}
    assert points[..., 2].min() > -2e-3
    seen = 0
    for stance in extended.schedule.stances:
        for part in (slice(stance.start, min(stance.stop, 100)), slice(max(stance.start, 160), stance.stop)):
            path = points[part, columns[stance.sole, stance.point]]
            if len(path):
                seen += 1
                assert np.linalg.norm(path[:, :2] - path[0, :2], axis=1).max() < 5e-3
                assert np.abs(path[:, 2]).max() < 5e-3
    assert seen >= 16


def test_stances_that_go_on_into_the_clip_are_one(swaying, extended, g1):
    own = detect(swaying, g1)
    assert all((s.start, s.stop) == (0, 60) for s in own.stances) and len(own.stances) == 8
    assert sum(s.start <= 100 and s.stop >= 160 for s in extended.schedule.stances) == 8
    spans = sorted((s.sole, s.point, s.start, s.stop) for s in extended.schedule.stances)
    for a, b in pairwise(spans):
        assert a[:2] != b[:2] or a[3] <= b[2]


def test_the_floor_can_give_what_a_lead_needs(extended, g1):
    found = audit(extended.motion.shifted(extended.schedule.height), g1)
    assert found.infeasible[:100].mean() <= 0.04 and found.infeasible[160:].mean() <= 0.04
    assert found.joint_torque.max() < 1.0


def test_leading_out_is_leading_in_backwards(swaying, g1):
    schedule = detect(swaying, g1)
    back = swaying.with_qpos(swaying.qpos[::-1])
    turned = tuple(replace(s, start=60 - s.stop, stop=60 - s.start) for s in schedule.stances)
    out = extend(swaying, g1, schedule, Leads(after=1.0))
    into = extend(back, g1, replace(schedule, stances=tuple(sorted(turned))), Leads(before=1.0))
    np.testing.assert_allclose(out.motion.qpos, into.motion.qpos[::-1], atol=1e-9)
    assert (out.before, out.after) == (None, into.before)
    assert list(out.held) == [out.motion.frames - k for k in (3, 2, 1)]


def test_a_clip_that_floats_is_led_into_where_its_schedule_puts_the_floor(swaying, g1):
    high = swaying.shifted(0.07)
    found = extend(high, g1, detect(high, g1), Leads(1.0))
    assert found.motion.qpos[0, 2] == pytest.approx(g1.nominal[2] + 0.07, abs=1e-3)


def test_a_transient_becomes_part_of_the_lead(swaying, g1):
    qpos = np.array(swaying.qpos)
    qpos[:2, 7:] += 0.4
    found = extend(swaying.with_qpos(qpos), g1, detect(swaying, g1), Leads(1.0))
    assert found.before.frames == 100 and found.before.replaced >= 2
    first = 100 + found.before.replaced
    np.testing.assert_allclose(found.motion.qpos[first:], qpos[found.before.replaced :], atol=1e-12)
    assert np.abs(np.diff(found.motion.qpos[:, 7:], axis=0)).max() * FPS < 8.0
    assert found.motion.frames == 100 + swaying.frames


def test_references_go_over_to_where_the_lead_has_the_bodies(swaying, g1):
    positions, _ = placements(g1, swaying.qpos)
    names = ("pelvis", "left_wrist_yaw_link")
    slots = [g1.body_names.index(name) for name in names]
    still = np.tile(Rotation.from_euler("z", 0.9).as_quat(scalar_first=True), (60, 2, 1))
    shifted = positions[:, slots] + [0.0, 0.03, 0.02]
    targets = BodyTargets(
        (*names, "tail"), np.zeros((60, 3, 3)), np.tile([1.0, 0, 0, 0], (60, 3, 1)), *[np.ones(3)] * 2
    )
    targets = replace(
        targets,
        positions=np.concatenate([shifted, np.zeros((60, 1, 3))], axis=1),
        quaternions=np.concatenate([still, np.tile([1.0, 0, 0, 0], (60, 1, 1))], axis=1),
    )
    found = extend(swaying, g1, detect(swaying, g1), Leads(1.0, 1.0), targets)
    assert found.references.names == names  # what the robot has not is of no use
    np.testing.assert_allclose(found.references.positions[100:160], shifted, atol=1e-12)
    reached, turned = placements(g1, found.motion.qpos)
    for end in (0, -1):
        np.testing.assert_allclose(found.references.positions[end], reached[end, slots], atol=1e-4)
        at = Rotation.from_quat(found.references.quaternions[end], scalar_first=True).as_matrix()
        np.testing.assert_allclose(at, turned[end, slots], atol=1e-4)
    steps = np.linalg.norm(np.diff(found.references.positions, axis=0), axis=2)
    assert steps[95:105].max() < 0.06 and np.abs(np.diff(steps, axis=0)).max() < 0.02


def test_too_little_time_is_refused_with_how_much_is_enough(swaying, g1):
    schedule = detect(swaying, g1)
    with pytest.raises(ClipError, match=r"^--lead-in 0.1 s is too short: .*; give it (\d\.\d) s$") as caught:
        lead_in(swaying, g1, schedule, 0.1, "--lead-in")
    enough = float(str(caught.value).split()[-2])
    lead_in(swaying, g1, schedule, enough, "--lead-in")


def test_a_joint_that_would_be_too_fast_is_named(swaying, g1):
    slow = replace(g1, velocity_limit=np.full(g1.dof, 0.5))
    with pytest.raises(ClipError, match=r"_joint would need a speed of .* its limit is 0.5"):
        lead_in(swaying, slow, detect(swaying, g1), 0.8, "--lead-out")


def test_one_frame_is_enough_to_lead_into(g1):
    motion = RobotMotion(g1.nominal[None], FPS, g1.joint_names, g1.name)
    found = extend(motion, g1, ContactSchedule(1, FPS, ()), Leads(0.5, 0.5))
    np.testing.assert_allclose(found.motion.qpos, np.tile(g1.nominal, (101, 1)), atol=1e-3)


@pytest.mark.parametrize("name", sorted(clip_files.FILES))
def test_what_a_file_holds_beside_its_motion_lasts_as_long_as_the_clip(g1, tmp_path, name):
    make, suffix, accuracy = clip_files.FILES[name]
    qpos = clip_files.squats(g1)
    path = tmp_path / f"clip{suffix}"
    make(g1, qpos, path)
    clip = read_clip(path, g1)
    more = np.concatenate([np.tile(qpos[:1], (5, 1)), qpos, np.tile(qpos[-1:], (3, 1))])
    long = Clip(clip.motion.with_qpos(more), clip.format, extras=longer(clip.extras, len(qpos), 5, 3), notes=clip.notes)
    write_clip(long, tmp_path / f"long{suffix}", robot=g1)
    back = read_clip(tmp_path / f"long{suffix}", g1, format=name)
    assert back.motion.frames == len(qpos) + 8
    np.testing.assert_allclose(back.motion.qpos, more, atol=max(accuracy, 1e-6))
    if name == "bones-csv":
        np.testing.assert_array_equal(back.extras["rows"][:, 0], np.arange(len(more)))
    if name == "phc":
        assert back.extras["content"]["smpl_joints"].shape == (len(more), 24, 3)
    if name == "holosoma":
        assert back.extras["content"]["object_pos_w"].shape[0] == len(more)


def test_another_robot_is_led_into_as_well(talos):
    """Talos: a step aside and a turn, and arms that are elsewhere."""
    qpos = np.tile(talos.nominal, (30, 1))
    qpos[:, :2] += [0.3, 0.2]
    arms = [7 + k for k, name in enumerate(talos.joint_names) if name.startswith("arm")]
    assert arms
    middle = 0.5 * (talos.position_lower + talos.position_upper)[np.array(arms) - 7]
    qpos[:, arms] += 0.5 * (middle - qpos[:, arms])
    left = [7 + k for k, name in enumerate(talos.joint_names) if name == "leg_left_1_joint"]
    qpos[:, left] += 0.3  # the left foot is turned out
    motion = RobotMotion(qpos, FPS, talos.joint_names, talos.name)
    schedule = detect(motion, talos)
    found = extend(motion, talos, schedule, Leads(1.5))
    np.testing.assert_allclose(found.motion.qpos[0, 7:], talos.nominal[7:], atol=1e-12)
    points = sole_points(found.motion, talos)
    assert points[..., 2].min() > -3e-3
    assert audit(found.motion, talos).infeasible[:150].mean() < 0.1
