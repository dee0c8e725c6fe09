from __future__ import annotations

import json
from dataclasses import replace

import clip_files
import metrics_toy as toys
import numpy as np
import pytest
from conftest import CHECKOUT
from people import walker
from scipy.spatial.transform import Rotation

from gmr_traj.comparison import Comparison, Entrant, Measure, Metric, as_source, compare
from gmr_traj.comparison.compare import Row
from gmr_traj.comparison.entrant import align
from gmr_traj.comparison.stances import by_vote, from_targets
from gmr_traj.contacts.detect import detect
from gmr_traj.exceptions import ClipError, ScheduleError
from gmr_traj.human_motion import HumanMotion
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.motion import RobotMotion
from gmr_traj.references import BodyTargets
from gmr_traj.resampling import resample
from gmr_traj.retarget.body_map import load_map
from gmr_traj.retarget.source import foot_joints, person_schedule
from gmr_traj.robot import Robot


def squatting(robot: Robot, frames: int = 60, fps: float = 30.0) -> RobotMotion:
    return RobotMotion(clip_files.squats(robot, frames), fps, robot.joint_names, robot.name)


def lifted(motion: RobotMotion, height: float) -> RobotMotion:
    return motion.shifted(height)


def value(compared: Comparison, key: str, name: str) -> float | None:
    row = next(row for row in compared.rows if row.metric.key == key)
    return row.measures[compared.names.index(name)].value


def targets_of(motion: RobotMotion, robot: Robot, bodies: tuple[str, ...]) -> BodyTargets:
    positions, rotations = placements(robot, motion.qpos)
    slots = [robot.body_names.index(body) for body in bodies]
    turns = Rotation.from_matrix(rotations[:, slots].reshape(-1, 3, 3)).as_quat(scalar_first=True)
    ones = np.ones(len(bodies))
    return BodyTargets(bodies, positions[:, slots], turns.reshape(motion.frames, -1, 4), ones, ones)


def test_no_clip_gets_better_by_being_airborne():
    """Two clips that stand and one that slides with its feet just above what counts as a stance."""
    robot, frames = toys.toy(), 50
    still = toys.clip(toys.standing(frames))
    qpos = toys.standing(frames)
    qpos[:, 0] = 0.4 * np.arange(frames) / toys.FPS
    qpos[:, 2] += 0.05 * (np.arange(frames) % 10 > 0)  # down every tenth frame, so that its floor is the same
    cheat = toys.clip(qpos)
    assert not detect(cheat, robot).stances
    compared = compare([Entrant("a", still), Entrant("b", still), Entrant("cheat", cheat)], robot)
    assert value(compared, "slide_mean", "a") == pytest.approx(0.0)
    assert value(compared, "slide_mean", "cheat") == pytest.approx(400.0)
    assert value(compared, "hover_share", "cheat") == pytest.approx(90.0)
    assert "at least half of the 3 clips" in compared.stance_rule


def test_a_vote_needs_half_of_the_clips():
    robot, frames = toys.toy(), 50
    still, up = toys.clip(toys.standing(frames)), toys.standing(frames)
    up[25:, 2] += 0.2
    one, half = by_vote([still, toys.clip(up), toys.clip(up)], robot), by_vote([still, toys.clip(up)], robot)
    assert {(s.start, s.stop) for s in half.stances} == {(0, frames)}
    assert max(s.stop for s in one.stances) <= 26 and len(one.stances) == 8


def test_stances_of_targets_are_those_of_the_robot_that_meets_them(g1):
    motion = squatting(g1)
    feet = tuple(sole.body for sole in g1.soles)
    found = from_targets(targets_of(motion, g1, feet), g1, motion.fps)
    assert found is not None
    assert found.stances == detect(motion, g1).stances
    assert from_targets(targets_of(motion, g1, feet[:1]), g1, motion.fps) is None
    free = replace(targets_of(motion, g1, feet), orientation_weights=np.zeros(2))
    assert from_targets(free, g1, motion.fps) is None


def test_a_clip_that_meets_its_targets_is_faithful_and_another_is_measured_against_the_same(g1):
    motion = squatting(g1)
    targets = targets_of(motion, g1, ("pelvis", "left_ankle_roll_link", "right_ankle_roll_link", "torso_link"))
    other = motion.with_qpos(np.hstack([motion.qpos[:, :3] + [3.0, 1.0, 0.02], motion.qpos[:, 3:]]))
    compared = compare([Entrant("exact", motion, targets), Entrant("raised", other)], g1)
    assert value(compared, "position_max", "exact") == pytest.approx(0.0, abs=1e-6)
    assert value(compared, "position_mean", "raised") == pytest.approx(20.0)
    assert value(compared, "relative_mean", "raised") == pytest.approx(0.0, abs=1e-6)
    assert value(compared, "orientation_max", "raised") == pytest.approx(0.0, abs=1e-5)
    assert "stances of the targets of exact" in compared.stance_rule
    assert any("scaled person is that of exact" in note for note in compared.notes)


def test_without_targets_nothing_is_said_of_faithfulness(g1):
    compared = compare([Entrant("a", squatting(g1))], g1)
    assert value(compared, "position_mean", "a") is None and value(compared, "contact_kept", "a") is None
    assert "on the clip itself" in compared.stance_rule
    assert any("--source" in note for note in compared.notes)


def test_different_frame_rates_and_lengths(g1):
    slow = squatting(g1, 60, 30.0)
    fast = resample(slow, 50.0)
    short = slow.with_qpos(slow.qpos[:40])
    field = align([Entrant("slow", slow), Entrant("fast", fast), Entrant("short", short)], g1)
    assert field.fps == 30.0 and field.frames == 40
    shared = [clip.shared.motion for clip in field.clips]
    assert {motion.frames for motion in shared} == {40}
    np.testing.assert_allclose(shared[1].qpos, shared[0].qpos, atol=5e-3)
    np.testing.assert_array_equal(shared[2].qpos, short.qpos)
    assert field.clips[1].own.motion.fps == 50.0
    assert any("differ in length" in note for note in field.notes)
    assert any("frame rates differ (slow 30 Hz, fast 50 Hz" in note for note in field.notes)
    compared = compare([Entrant("slow", slow), Entrant("fast", fast)], g1)
    jerk = [value(compared, "jerk_rms", name) for name in compared.names]
    assert jerk[0] == pytest.approx(jerk[1], rel=0.3)


def test_clips_with_and_without_wrists(g1):
    full = squatting(g1)
    arms = [k for k, name in enumerate(g1.joint_names) if "wrist" not in name]
    columns = [*range(7), *(7 + k for k in arms)]
    names = tuple(g1.joint_names[k] for k in arms)
    less = RobotMotion(full.qpos[:, columns], full.fps, names, g1.name)
    field = align([Entrant("29", full), Entrant("23", less)], g1)
    assert field.robot.dof == 29 and field.clips[0].joints.robot.dof == 23
    assert "left_wrist_yaw_link" not in field.bodies and "left_elbow_link" in field.bodies
    np.testing.assert_array_equal(field.clips[0].joints.motion.qpos, field.clips[1].joints.motion.qpos)
    assert any("joints are compared on the 23" in note for note in field.notes)
    alone = align([Entrant("a", less), Entrant("b", less)], g1)
    assert alone.robot.dof == 23 and not alone.notes


def test_a_stretch_of_the_clips(g1):
    motion = squatting(g1)
    feet = tuple(sole.body for sole in g1.soles)
    entrant = Entrant("a", motion, targets_of(motion, g1, ("pelvis", *feet)))
    compared = compare([entrant], g1, seconds=(0.5, 1.5))
    assert compared.seconds == pytest.approx(1.0)
    assert value(compared, "position_max", "a") == pytest.approx(0.0, abs=1e-6)
    with pytest.raises(ClipError, match=r"a: has no frames from 3 s to 4 s; it lasts 2\.00 s"):
        compare([entrant], g1, seconds=(3.0, 4.0))


def test_what_cannot_be_compared(g1):
    motion = squatting(g1)
    with pytest.raises(ClipError, match="no clips"):
        compare([], g1)
    with pytest.raises(ClipError, match="two clips are called 'a'"):
        compare([Entrant("a", motion), Entrant("a", motion)], g1)
    stranger = RobotMotion(motion.qpos, motion.fps, motion.joint_names, "talos")
    with pytest.raises(ClipError, match="b is a motion of talos, not of unitree_g1"):
        compare([Entrant("a", motion), Entrant("b", stranger)], g1)


def test_the_person_gives_contacts_and_targets(g1):
    human, body_map = walker(60), load_map("lafan1_to_unitree_g1", g1)
    schedule = person_schedule(human, g1, body_map)
    for sole, prefix in (("left", "Left"), ("right", "Right")):
        for part, joint in (("heel", "Foot"), ("toe", "Toe")):
            touching = human.contacts[prefix + joint]
            for k in {s.point for s in schedule.stances if (s.sole, s.part) == (sole, part)}:
                own = np.zeros(60, dtype=bool)
                for s in schedule.stances:
                    if (s.sole, s.point) == (sole, k):
                        own[s.start : s.stop] = True
                np.testing.assert_array_equal(own, touching)
    assert len({(s.sole, s.point) for s in schedule.stances}) == 8
    source = as_source("walk", human, g1, body_map)
    compared = compare([Entrant("a", squatting(g1))], g1, source=source)
    assert compared.stance_rule.startswith("stances of walk")
    assert value(compared, "contact_kept", "a") == pytest.approx(100.0)


@pytest.mark.parametrize("fps", [30.0, 50.0])
def test_a_person_who_stops_before_the_clips(g1, fps):
    """And whose frame rate may be another: what both have is compared, from where both begin."""
    source = as_source("walk", walker(round(2 * fps), fps=fps), g1, load_map("lafan1_to_unitree_g1", g1))
    compared = compare([Entrant("a", squatting(g1, 80))], g1, source=source)
    assert compared.seconds == pytest.approx(2.0, abs=1 / 30)
    assert any("ends before the clips" in note for note in compared.notes)
    later = compare([Entrant("a", squatting(g1, 80))], g1, source=source, seconds=(1.0, 3.0))
    assert later.seconds == pytest.approx(1.0, abs=1 / 30)
    with pytest.raises(ClipError, match=r"walk: has no frames from 2\.2 s to 3 s"):
        compare([Entrant("a", squatting(g1, 80))], g1, source=source, seconds=(2.2, 3.0))


def test_heel_and_toe_of_a_person():
    human = walker(5)
    assert foot_joints(human, "LeftFoot") == ("LeftFoot", "LeftToe")
    assert foot_joints(human, "LeftToe") == ("LeftFoot", "LeftToe")
    bare = replace(human, contacts={"LeftFoot": human.contacts["LeftFoot"]})
    assert foot_joints(bare, "LeftFoot") == ("LeftFoot", "LeftFoot")
    with pytest.raises(ScheduleError, match="contacts of joint 'RightFoot' are not known; known are those of LeftFoot"):
        foot_joints(bare, "RightFoot")


def test_a_sole_that_the_map_knows_nothing_of(g1):
    body_map = load_map("lafan1_to_unitree_g1", g1)
    less = replace(body_map, targets=tuple(t for t in body_map.targets if "right_ankle" not in t.body))
    human: HumanMotion = walker(5)
    with pytest.raises(ScheduleError, match="gives body 'right_ankle_roll_link', which has a sole, no joint"):
        person_schedule(human, g1, less)


@pytest.mark.parametrize(
    ("values", "better", "best"),
    [
        ((3.0, 1.0, 2.0), "less", (False, True, False)),
        ((3.0, 1.0, 2.0), "more", (True, False, False)),
        ((1.0, 1.0, 2.0), "less", (True, True, False)),
        ((0.0, 0.0, 0.0), "less", (False, False, False)),
        ((None, 1.0, 2.0), "less", (False, True, False)),
        ((None, 1.0, None), "less", (False, False, False)),
    ],
)
def test_the_best_of_a_row(values, better, best):
    row = Row("group", Metric("key", "title", "mm", better), tuple(Measure(v) for v in values))
    assert row.best == best


def test_json_is_plain(g1):
    compared = compare([Entrant("a", squatting(g1)), Entrant("b", lifted(squatting(g1), -0.03))], g1)
    report = json.loads(json.dumps(compared.to_json(), allow_nan=False))
    floor = next(m for m in report["metrics"] if m["key"] == "penetration_max")
    assert floor["values"]["b"] == pytest.approx(30.0, abs=1.0) and floor["best"] == ["a"]
    assert floor["where"]["b"].endswith("ankle_roll_link") and floor["unit"] == "mm"
    assert len({m["key"] for m in report["metrics"]}) == len(report["metrics"])


def test_every_number_of_the_settings_is_used():
    used = "".join(path.read_text() for path in (CHECKOUT / "gmr_traj" / "comparison").glob("*.py"))
    for line in (CHECKOUT / "configs" / "compare.toml").read_text().splitlines():
        if line and line[0].isalpha():
            assert f'"{line.split()[0]}"' in used, line
