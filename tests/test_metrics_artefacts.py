from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from metrics_toy import FPS, both_feet, clip, standing, toy

from gmr_traj.contacts.schedule import ContactSchedule, Stance
from gmr_traj.exceptions import ResourceError
from gmr_traj.metrics import Artefact, artefacts, clip_score
from gmr_traj.metrics.intervals import intervals, near
from gmr_traj.metrics.settings import Settings, shipped

ROBOT = toy()
FRAMES = 200
LEFT, RIGHT, SHOULDER = 7, 8, 9


def swinging(frames: int = FRAMES) -> np.ndarray:
    """Standing, with an arm that swings at up to 1.6 rad/s: a clip without a fault."""
    qpos = standing(frames)
    qpos[:, SHOULDER] = 0.5 + 0.4 * np.sin(4.0 * np.arange(frames) / FPS)
    return qpos


def report(qpos: np.ndarray, schedule: ContactSchedule | None = None) -> tuple[Artefact, ...]:
    return artefacts(clip(qpos), ROBOT, schedule or both_feet(len(qpos)))


def only(found: tuple[Artefact, ...]) -> Artefact:
    assert len(found) == 1, [(a.kind, a.where, a.start, a.stop) for a in found]
    return found[0]


def test_a_clean_clip_has_none():
    assert report(swinging()) == ()
    assert clip_score((), clip(swinging())) == 0.0


def test_a_jump_is_found_where_it_is():
    qpos = swinging()
    qpos[100:, SHOULDER] -= 0.25  # 12.5 rad/s in the step 99 -> 100, beyond the joint's limit as well
    found = only(report(qpos))
    assert (found.kind, found.where, found.start, found.stop) == ("jump", "shoulder", 99, 101)
    assert (found.begin, found.end, found.unit) == (99 / FPS, 101 / FPS, "rad/s")
    assert found.value == pytest.approx(12.5, abs=1.7)
    assert found.score == pytest.approx(found.value / 15.0)


def test_a_fast_but_smooth_kick_is_no_jump():
    t = np.arange(FRAMES) / FPS
    qpos = swinging()
    qpos[:, LEFT] = 1.5 / (1.0 + np.exp(-(t - 2.0) / 0.035))  # 10.7 rad/s at its fastest
    assert np.abs(np.diff(qpos[:, LEFT])).max() * FPS > 10.0
    kinds = {a.kind for a in report(qpos, ContactSchedule(FRAMES, FPS, ()))}
    assert not kinds & {"jump", "velocity", "acceleration_spike"}


def test_a_joint_over_its_limit_for_a_while_is_over_its_limit():
    qpos = swinging()
    ramp = np.clip(np.arange(FRAMES) - 80, 0, 12) * 0.22  # 11 rad/s for 12 steps; the limit is 10
    qpos[:, SHOULDER] = ramp - 1.3
    found = [a for a in report(qpos) if a.kind == "velocity"]
    assert [(a.where, a.start, a.stop) for a in found] == [("shoulder", 80, 93)]
    assert found[0].value == pytest.approx(1.1)


def test_a_base_that_teleports():
    qpos = swinging()
    qpos[120:, :2] += [0.3, 0.4]  # 25 m/s
    none = ContactSchedule(FRAMES, FPS, ())
    found = only(report(qpos, none))
    assert (found.kind, found.where, found.start, found.stop, found.unit) == ("jump", "base position", 119, 121, "m/s")
    assert found.value == pytest.approx(25.0)
    turned = swinging()
    turned[120:, 3:7] = [np.cos(0.1), 0.0, 0.0, np.sin(0.1)]  # 0.2 rad, 10 rad/s
    found = only(report(turned, none))
    assert (found.where, found.unit) == ("base orientation", "rad/s")
    assert found.value == pytest.approx(10.0)


def test_a_quaternion_that_changes_sign_has_not_moved():
    qpos = swinging()
    qpos[100:, 3:7] *= -1.0
    assert report(qpos) == ()


def test_a_transient_is_reported_once_and_not_as_a_jump():
    qpos = swinging()
    qpos[:2, SHOULDER] += [0.4, 0.15]
    qpos[0, 0] = -0.5
    found = only(report(qpos, ContactSchedule(FRAMES, FPS, ())))
    assert (found.kind, found.where, found.start, found.stop) == ("transient", "base position", 0, 3)
    assert found.value == pytest.approx(25.0)


def test_a_clip_that_begins_in_full_run_has_no_transient():
    qpos = standing(FRAMES)
    qpos[:, 0] = 6.0 * np.arange(FRAMES) / FPS
    assert report(qpos, ContactSchedule(FRAMES, FPS, ())) == ()


def test_an_acceleration_spike_below_a_jump():
    qpos = swinging()
    qpos[:, 2] += 0.5
    qpos[100, RIGHT] = 0.12  # out and back: 6 rad/s, 600 rad/s^2
    found = only(report(qpos, ContactSchedule(FRAMES, FPS, ())))
    assert (found.kind, found.where, found.start, found.stop) == ("acceleration_spike", "right_hip", 99, 102)
    assert found.value == pytest.approx(600.0)


def test_a_joint_beyond_its_range():
    qpos = swinging()
    qpos[:, SHOULDER] = np.linspace(1.0, 1.55, FRAMES)
    found = only(report(qpos))
    assert (found.kind, found.where, found.stop, found.peak) == ("joint_limit", "shoulder", FRAMES, FRAMES - 1)
    assert found.value == pytest.approx(0.05)


def test_a_stance_that_creeps_is_a_slide_over_its_whole_length():
    qpos = swinging()
    qpos[60:160, 0] = 0.04 * np.arange(100) / FPS  # 40 mm/s
    qpos[160:, 0] = qpos[159, 0]
    found = only(report(qpos, ContactSchedule(FRAMES, FPS, (Stance("right", 1, "toe", 50, 150),))))
    assert (found.kind, found.where, found.start, found.stop, found.peak) == ("slide", "right", 50, 150, 149)
    assert found.value == pytest.approx(1e3 * 0.04 * 89 / FPS)
    assert found.unit == "mm"


def test_floating_and_sunken_feet():
    qpos = swinging()
    qpos[40:60, 2] += 0.02
    qpos[100:110, 2] -= 0.03
    found = report(qpos)
    assert [(a.kind, a.where, a.start, a.stop) for a in found] == [
        ("sole_penetration", "left", 100, 110),
        ("sole_penetration", "right", 100, 110),
        ("float", "left", 40, 60),
        ("float", "right", 40, 60),
    ]
    assert [round(a.value, 6) for a in found] == [30.0, 30.0, 20.0, 20.0]


def test_a_body_in_the_floor_that_is_no_foot():
    qpos = swinging()
    qpos[50:70, 2] = 0.29  # the torso's lowest point is 0.3 m below its origin
    found = [a for a in report(qpos, ContactSchedule(FRAMES, FPS, ())) if a.kind == "floor_penetration"]
    assert ("torso", 50, 70) in [(a.where, a.start, a.stop) for a in found]
    assert {a.where for a in found} <= {"torso", "arm"}
    assert next(a for a in found if a.where == "torso").value == pytest.approx(10.0)


def test_an_arm_in_the_body():
    qpos = standing(FRAMES)
    qpos[:, SHOULDER] = -1.2 * np.exp(-(((np.arange(FRAMES) - 100) / 30.0) ** 2))
    found = only(report(qpos))
    assert (found.kind, found.where, found.peak) == ("self_collision", "torso - arm", 100)
    assert found.value == pytest.approx(1e3 * (0.14 - 0.3 + 0.3 * np.sin(1.2)), abs=0.01)


def test_a_clip_that_hovers_as_a_whole_has_one_fault():
    qpos = swinging()
    qpos[:, 2] += 0.05
    found = only(report(qpos, both_feet(FRAMES, height=-0.05)))
    assert (found.kind, found.where, found.start, found.stop) == ("height", "above the floor", 0, FRAMES)
    assert (found.value, found.score) == (pytest.approx(50.0), pytest.approx(1.0))
    qpos[:, 2] -= 0.1
    assert only(report(qpos, both_feet(FRAMES, height=0.05))).where == "below the floor"


def test_the_worst_comes_first_and_everything_is_json():
    qpos = swinging()
    qpos[30:40, 2] -= 0.06
    qpos[100:, RIGHT] += 0.16
    found = report(qpos)
    assert [a.score for a in found] == sorted((a.score for a in found), reverse=True)
    assert {a.kind for a in found} >= {"jump", "sole_penetration"}
    json.dumps([a.to_json() for a in found], allow_nan=False)


@pytest.mark.parametrize("frames", [1, 2, 3, 5, 11])
def test_the_shortest_clips(frames):
    assert report(swinging(frames)) == ()


def test_the_clip_score_is_one_for_one_severe_fault_throughout():
    motion = clip(standing(FRAMES))
    fault = Artefact("float", "left", 0, FRAMES, 0.0, 4.0, 0, 40.0, "mm", 1.0)
    assert clip_score([fault], motion) == pytest.approx(1.0)
    assert clip_score([fault, replace(fault, where="right")], motion) == pytest.approx(1.0)
    assert clip_score([fault, replace(fault, kind="slide")], motion) == pytest.approx(2.0)
    moment = replace(fault, start=100, stop=102, score=2.0)  # counts for half a second of four
    assert clip_score([moment], motion) == pytest.approx(2.0 * 0.5 / 4.0, rel=0.1)


@given(st.lists(st.booleans(), min_size=1, max_size=60), st.integers(1, 8))
def test_intervals_cover_the_mask_and_join_only_short_gaps(values, gap):
    mask = np.array(values)
    found = intervals(mask, gap)
    covered = near(found, len(mask), 0)
    assert (covered | ~mask).all()
    for start, stop in found:
        assert mask[start] and mask[stop - 1]
    for (_, stop), (start, _) in pairwise(found):
        assert start - stop >= gap
    runs = intervals(mask & covered, 1)
    holes = [b - a for (_, a), (b, _) in pairwise(runs) if covered[a:b].all()]
    assert all(hole < gap for hole in holes)


def test_near_reaches_as_far_as_its_margin():
    np.testing.assert_array_equal(np.flatnonzero(near([(4, 6)], 12, 2)), np.arange(2, 8))
    np.testing.assert_array_equal(np.flatnonzero(near([(0, 1), (11, 12)], 12, 3)), [0, 1, 2, 3, 8, 9, 10, 11])


def test_thresholds_are_the_users_where_given(tmp_path):
    shipped_text = shipped("inspect").path.read_text()
    own = tmp_path / "strict.toml"
    own.write_text(shipped_text.replace("report = 0.01\nsevere = 0.04", "report = 0.001\nsevere = 0.004"))
    qpos = swinging()
    qpos[40:60, 2] += 0.003
    assert report(qpos) == ()
    found = artefacts(clip(qpos), ROBOT, both_feet(FRAMES), Settings(own))
    assert [a.kind for a in found] == ["float", "float"]
    assert found[0].score == pytest.approx(0.75)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[jump\n", "cannot be read as TOML"),
        ("jump = 3\n", "jump stands outside any table"),
        ("[jump]\nreport = 'high'\n", r"\[jump\] report is 'high'; it must be a number above 0"),
        ("[jump]\nreport = -1\n", "must be a number above 0"),
        ("[jump]\nreport = nan\n", "must be a number above 0"),
        ("[jump]\nreport = true\n", "must be a number above 0"),
    ],
)
def test_bad_settings_are_named(tmp_path, text, words):
    path = tmp_path / "own.toml"
    path.write_text(text)
    with pytest.raises(ResourceError, match=words):
        Settings(path)


def test_missing_settings_are_named(tmp_path):
    with pytest.raises(ResourceError, match="cannot be read"):
        Settings(tmp_path / "none.toml")
    path = tmp_path / "own.toml"
    path.write_text("[height]\nreport = 1.0\nsevere = 2.0\n")
    with pytest.raises(ResourceError, match=r"\[joint_limit\] report is missing"):
        artefacts(clip(swinging()), ROBOT, both_feet(FRAMES), Settings(path))
