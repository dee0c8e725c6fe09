from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from metrics_toy import FPS, both_feet, clip, standing, toy
from scipy.spatial.transform import Rotation

from gmr_traj.contacts.schedule import ContactSchedule, Stance
from gmr_traj.exceptions import ClipError, ScheduleError
from gmr_traj.metrics import Certificate, certify
from gmr_traj.metrics.change import rotation_angle
from gmr_traj.metrics.observation import observe
from gmr_traj.references import BodyTargets

ROBOT = toy()
FRAMES = 200
LEFT, RIGHT, SHOULDER = 7, 8, 9


def swinging() -> np.ndarray:
    """Standing, with an arm that swings: a clip without a fault."""
    qpos = standing(FRAMES)
    qpos[:, SHOULDER] = 0.5 + 0.4 * np.sin(4.0 * np.arange(FRAMES) / FPS)
    return qpos


def certificate(raw: np.ndarray, refined: np.ndarray, levelling: float = 0.0) -> Certificate:
    return certify(clip(raw), clip(refined), ROBOT, both_feet(len(raw)), levelling=levelling)


def test_a_clean_clip_passes_untouched():
    found = certificate(swinging(), swinging())
    assert found.held and found.broken == ()
    assert len(found.promises) == len({p.name for p in found.promises}) == 20
    assert (found.change.position, found.change.orientation, found.change.joint_rms) == (0.0, 0.0, 0.0)
    assert found.figures_before == found.figures_after


def _spike(qpos: np.ndarray) -> None:
    qpos[100:, SHOULDER] += 0.45


def _beyond(qpos: np.ndarray) -> None:
    qpos[:, SHOULDER] = np.linspace(1.0, 1.51, FRAMES)


def _tremble(qpos: np.ndarray) -> None:
    qpos[1::2, SHOULDER] += 0.02


def _hurry(qpos: np.ndarray) -> None:
    qpos[100, RIGHT] += 0.11


def _start(qpos: np.ndarray) -> None:
    qpos[0, SHOULDER] += 0.14


def _creep(qpos: np.ndarray) -> None:
    qpos[:, 0] += 0.03 * np.arange(FRAMES) / FPS


def _hover(qpos: np.ndarray) -> None:
    qpos[:, 2] += 0.009


def _sink(qpos: np.ndarray) -> None:
    qpos[50:60, 2] -= 0.0045


def _fold(qpos: np.ndarray) -> None:
    qpos[:, SHOULDER] = -0.59


def _away(qpos: np.ndarray) -> None:
    qpos[:, 1] += 0.051


def _turned(qpos: np.ndarray) -> None:
    qpos[:, 3:7] = Rotation.from_euler("z", 8.1, degrees=True).as_quat(scalar_first=True)


@pytest.mark.parametrize(
    ("spoil", "broken"),
    [
        (_spike, {"over_frames", "acceleration_ratio", "jumps"}),
        (_beyond, {"limit_frames"}),
        (_tremble, {"jerk_rms"}),
        (_hurry, {"acceleration_ratio", "jerk_rms"}),
        (_start, {"transient"}),
        (_creep, {"drift_p95", "drift_max", "slide_mean", "change_position"}),
        (_hover, {"float_p95"}),
        (_sink, {"sole_depth", "floor_depth"}),
        (_fold, {"self_depth", "self_share"}),
        (_away, {"change_position"}),
        (_turned, {"change_orientation"}),
    ],
)
def test_every_promise_can_be_broken(spoil: Callable[[np.ndarray], None], broken: set[str]):
    refined = swinging()
    spoil(refined)
    found = certificate(swinging(), refined)
    assert not found.held
    assert {p.name for p in found.broken} >= broken
    for promise in found.promises:
        assert promise.held == (promise.value <= promise.bar)


def test_an_arm_that_was_fine_must_not_be_moved():
    refined = swinging()
    refined[:, SHOULDER] += 0.3  # the hand is 0.3 m from the shoulder
    found = {p.name: p for p in certificate(swinging(), refined).promises}
    moved = 2.0 * 300.0 * np.sin(0.15)  # a chord
    assert found["untouched_mean"].value == pytest.approx(moved / 2)  # arm and hand; the arm's origin stays
    assert found["untouched_p95"].value == pytest.approx(moved)
    assert found["untouched_mean"].where == f"hand, over {FRAMES} frames"
    assert {p.name for p in certificate(swinging(), refined).broken} == {"untouched_mean", "untouched_p95"}


def test_moving_the_base_and_the_legs_does_not_count_against_the_upper_body():
    refined = swinging()
    refined[:, 0] += 0.04
    refined[:, LEFT] = 0.3
    refined[:, 3:7] = Rotation.from_euler("z", 6.0, degrees=True).as_quat(scalar_first=True)
    found = {p.name: p for p in certificate(swinging(), refined).promises}
    assert found["untouched_p95"].value == pytest.approx(0.0, abs=1e-9)
    assert found["change_position"].value > 20.0


def test_longer_and_faster_clips_are_measured_and_break_a_promise():
    longer = certificate(swinging(), np.vstack([swinging(), swinging()[-2:-9:-1]]))
    assert [(p.name, p.value) for p in longer.broken] == [("frames", 7.0)]
    shorter = certificate(swinging(), swinging()[:150])
    assert [(p.name, p.value) for p in shorter.broken] == [("frames", 50.0)]
    assert shorter.figures_after.stances == 8
    faster = certify(clip(swinging()), clip(swinging(), 50.5), ROBOT, both_feet(FRAMES), levelling=0.0)
    assert "rate" in {p.name for p in faster.broken}


def test_bars_follow_the_input_where_it_was_bad():
    raw = swinging()
    raw[:, 0] = 0.5 * np.arange(FRAMES) / FPS  # drifts 2 m, slides 500 mm/s
    found = {p.name: p for p in certificate(raw, swinging()).promises}
    assert found["drift_p95"].bar == pytest.approx(0.25 * found["drift_p95"].before)
    assert found["drift_max"].bar == pytest.approx(0.40 * 1e3 * 0.5 * (FRAMES - 1) / FPS)
    assert found["slide_mean"].bar == pytest.approx(125.0)
    assert found["slide_mean"].held
    assert certificate(raw, raw).broken


def test_jumps_of_the_input_must_go():
    raw = swinging()
    raw[60:, RIGHT] -= 0.25
    raw[130:, RIGHT] += 0.25
    found = {p.name: p for p in certificate(raw, swinging()).promises}["jumps"]
    assert (found.before, found.value, found.bar, found.held) == (2, 0, 0, True)
    left = {p.name: p for p in certificate(raw, raw).promises}["jumps"]
    assert (left.held, left.where) == (False, "right_hip")


def test_change_is_measured_from_the_levelled_input():
    refined = swinging()
    refined[:, 2] += 0.04
    found = certificate(refined, swinging(), levelling=-0.04)
    assert found.held
    assert found.change.position == pytest.approx(0.0, abs=1e-9)
    assert found.figures_before.float_p95 == pytest.approx(40.0)  # the input's figures are of the file as it was
    assert [a.kind for a in found.artefacts_before] == ["height"]
    not_raised = certificate(swinging(), refined)
    assert not_raised.change.position == pytest.approx(40.0)


def test_change_body_by_body():
    refined = swinging()
    refined[:, 0] += 0.03
    refined[:100, SHOULDER] += np.radians(10.0)
    found = {body.body: body for body in certificate(swinging(), refined).change.bodies}
    assert found["torso"].position_mean == pytest.approx(30.0)
    assert found["torso"].orientation_max == pytest.approx(0.0, abs=1e-9)
    assert found["arm"].orientation_mean == pytest.approx(5.0)
    assert found["arm"].orientation_max == pytest.approx(10.0)


@given(st.floats(0.0, 3.1), st.integers(0, 1000))
def test_rotation_angle(angle, seed):
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    start = Rotation.random(rng=rng)
    end = start * Rotation.from_rotvec(angle * axis / np.linalg.norm(axis))
    assert rotation_angle(start.as_matrix(), end.as_matrix()) == pytest.approx(angle, abs=1e-7)


def test_frames_near_an_artefact_excuse_a_change_and_others_do_not():
    raw = swinging()
    raw[100, SHOULDER] += 0.4  # the fault
    near, far = swinging(), swinging()
    near[84:117, SHOULDER] += 0.2  # the step out of frame 99 to the one into 101, and 0.3 s on either side
    far[83, SHOULDER] += 0.2
    kept = {p.name: p for p in certificate(raw, near).promises}["untouched_mean"]
    assert kept.value == pytest.approx(0.0, abs=1e-9)
    assert kept.where.endswith(f"over {FRAMES - (102 - 99 + 2 * 15)} frames")
    assert {p.name: p for p in certificate(raw, far).promises}["untouched_mean"].value > 0.0


def test_no_frame_away_from_artefacts_is_said():
    raw = swinging()
    raw[:, SHOULDER] = -1.2  # in the torso throughout
    report = {p.name: p for p in certificate(raw, swinging()).promises}["untouched_p95"]
    assert (report.value, report.held) == (0.0, True)
    assert report.where == "no frame is 0.3 s from any artefact"


@settings(max_examples=10)
@given(st.floats(-np.pi, np.pi), st.floats(-20.0, 20.0))
def test_where_the_pair_of_clips_stands_does_not_matter(yaw, x):
    raw, refined = swinging(), swinging()
    raw[100:, RIGHT] -= 0.2
    refined[:, 0] += 0.004 * np.sin(np.arange(FRAMES) / 7.0)
    turn = Rotation.from_euler("z", yaw)

    def move(qpos):
        moved = qpos.copy()
        moved[:, :3] = turn.apply(qpos[:, :3]) + [x, 0.0, 0.0]
        moved[:, 3:7] = (turn * Rotation.from_quat(qpos[:, 3:7], scalar_first=True)).as_quat(scalar_first=True)
        return moved

    here, there = certificate(raw, refined), certificate(move(raw), move(refined))
    for a, b in zip(here.promises, there.promises, strict=True):
        assert (a.name, a.held) == (b.name, b.held)
        assert a.value == pytest.approx(b.value, abs=1e-6)


def test_the_certificate_is_json():
    content = json.loads(json.dumps(certificate(swinging(), swinging()).to_json(), allow_nan=False))
    assert content["held"] is True
    assert content["before"]["frames"] == FRAMES
    assert {"name", "sentence", "held", "value", "bar", "unit", "where", "before"} == set(content["promises"][0])


def test_errors_are_those_of_the_clip_and_the_schedule():
    with pytest.raises(ScheduleError, match="199 frames, the clip has 200"):
        certify(clip(swinging()), clip(swinging()), ROBOT, both_feet(199), levelling=0.0)
    with pytest.raises(ScheduleError, match="sole 'tail'"):
        schedule = ContactSchedule(FRAMES, FPS, (Stance("tail", 0, "toe", 0, 9),))
        certify(clip(swinging()), clip(swinging()), ROBOT, schedule, levelling=0.0)
    with pytest.raises(ClipError, match="2 joints"):
        other = type(clip(swinging()))(swinging()[:, :9], FPS, ("left_hip", "right_hip"), "toy")
        certify(clip(swinging()), other, ROBOT, both_feet(FRAMES), levelling=0.0)


def test_a_robot_without_an_upper_body():
    legs = replace(ROBOT, key_bodies=ROBOT.key_bodies[:3])
    found = {
        p.name: p for p in certify(clip(swinging()), clip(swinging()), legs, both_feet(FRAMES), levelling=0.0).promises
    }
    assert found["untouched_mean"].where == "every key body carries a foot"


def human_of(qpos: np.ndarray, hover: float = 0.0) -> BodyTargets:
    """Targets that are where a clip has torso, legs and arm, all of them higher by ``hover``."""
    seen = observe(clip(qpos), ROBOT)
    names = ("torso", "left_leg", "right_leg", "arm")
    slots = [ROBOT.body_names.index(name) for name in names]
    quaternions = [Rotation.from_matrix(seen.rotations[:, s]).as_quat(scalar_first=True) for s in slots]
    positions = seen.positions[:, slots] + [0.0, 0.0, hover]
    return BodyTargets(names, positions, np.stack(quaternions, axis=1), np.ones(4), np.ones(4))


def source_promises(raw: np.ndarray, refined: np.ndarray, human: BodyTargets, levelling: float = 0.0):
    found = certify(
        clip(raw), clip(refined), ROBOT, both_feet(len(raw)), levelling=levelling, references=human
    ).promises
    return {p.name: p for p in found if p.name.startswith("source_")}


def test_the_distance_to_the_human_is_promised_where_the_human_is_known():
    assert not any(p.name.startswith("source_") for p in certificate(swinging(), swinging()).promises)
    found = source_promises(swinging(), swinging(), human_of(swinging()))
    assert set(found) == {"source_position", "source_orientation"} and all(p.held for p in found.values())
    assert found["source_position"].before == found["source_position"].value == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("lean", "held"), [(0.005, True), (0.1, False)])
def test_a_clip_that_leaves_its_human_breaks_the_promise(lean: float, held: bool):
    """The torso leans, and with it everything; the turn that best brings the two together adds a little to that."""
    leaning = swinging()
    leaning[:, 3:7] = Rotation.from_rotvec([0.0, lean, 0.0]).as_quat(scalar_first=True)
    found = source_promises(swinging(), leaning, human_of(swinging()))
    assert np.degrees(lean) < found["source_orientation"].value < 2 * np.degrees(lean)
    assert found["source_orientation"].held == held


def test_the_human_stands_on_the_floor_where_the_refined_clip_does():
    """Retargeted 3 cm over the floor, as its human is, and refined onto it: not a millimetre farther away."""
    raised = swinging()
    raised[:, 2] += 0.03
    found = source_promises(raised, swinging(), human_of(swinging(), hover=0.03), levelling=-0.03)
    assert found["source_position"].value == pytest.approx(0.0, abs=1e-6)
    assert found["source_position"].before == pytest.approx(0.0, abs=1e-6)
