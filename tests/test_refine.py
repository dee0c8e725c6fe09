"""Refining whole clips of three robots: converged, within the limits, planted; and what cannot be refined."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from metrics_toy import clip, standing
from optimiser_setup import EXAMPLE, kinematics_of, toy

from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.cli.main import main
from gmr_traj.contacts.detect import detect, sole_points
from gmr_traj.contacts.mask import owners
from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.exceptions import ClipError, RobotError, ScheduleError
from gmr_traj.formats import read_clip
from gmr_traj.metrics import certify
from gmr_traj.motion import RobotMotion
from gmr_traj.problem import load_problem
from gmr_traj.refine import Refinement, refine
from gmr_traj.robot import Robot
from gmr_traj.robot_loading import reduce_robot

# The joints that the 23-joint G1 does not have.
MISSING = ("wrist_pitch", "wrist_yaw", "waist_roll", "waist_pitch")

# The certificate's promises about joint limits.
LIMITS = ("limit_frames", "over_frames", "acceleration_ratio")


def refined(motion: RobotMotion, robot: Robot, schedule: ContactSchedule | None = None) -> Refinement:
    return refine(motion, robot, load_problem(), schedule=schedule, kinematics=kinematics_of(robot))


def punch(robot: Robot, frames: int = 48) -> RobotMotion:
    """The start of the example, with the joints that the robot has."""
    recorded = np.load(EXAMPLE)
    names = [str(name) for name in recorded["joint_names"]]
    columns = [*range(7), *[7 + names.index(name) for name in robot.joint_names]]
    return RobotMotion(recorded["qpos"][:frames, columns], float(recorded["fps"]), robot.joint_names, robot.name)


def made_up(robot: Robot, frames: int = 45) -> RobotMotion:
    """A sway about the nominal posture with noise, a jump of one arm, and feet that slide forward."""
    t, rng = np.arange(frames) / 30.0, np.random.default_rng(8)
    qpos = np.tile(robot.nominal, (frames, 1))
    qpos[:, 7:] += np.outer(np.sin(4 * t), rng.uniform(-0.15, 0.15, robot.dof)) + rng.normal(
        0, 0.01, (frames, robot.dof)
    )
    qpos[:, 0] += 0.1 * t
    arm = next(k for k, name in enumerate(robot.joint_names) if "arm" in name or "elbow" in name)
    qpos[frames // 2 :, 7 + arm] += 0.6
    qpos[:, 7:] = np.clip(qpos[:, 7:], robot.position_lower, robot.position_upper)
    return RobotMotion(qpos, 30.0, robot.joint_names, robot.name)


@pytest.fixture(scope="module", params=["g1", "g1 with 23 joints", "talos"])
def case(request: pytest.FixtureRequest) -> tuple[Robot, Refinement, RobotMotion]:
    if request.param == "talos":
        robot: Robot = request.getfixturevalue("talos")
        motion = made_up(robot)
    else:
        robot = request.getfixturevalue("g1")
        if request.param == "g1 with 23 joints":
            robot = reduce_robot(robot, [n for n in robot.joint_names if not any(part in n for part in MISSING)])
            assert robot.dof == 23
        motion = punch(robot)
    return robot, refined(motion, robot), motion


def test_it_converges_and_keeps_the_clips_form(case: tuple[Robot, Refinement, RobotMotion]) -> None:
    _, result, motion = case
    assert result.report.status in ("converged", "acceptable") and result.report.message == ""
    out = result.motion
    assert (out.frames, out.fps, out.joint_names) == (motion.frames, motion.fps, motion.joint_names)
    np.testing.assert_array_equal(result.levelled.qpos, motion.shifted(result.schedule.height).qpos)


def test_the_certificates_limits_are_held(case: tuple[Robot, Refinement, RobotMotion]) -> None:
    """By metrics that share nothing with the terms, and by the plain formulas."""
    robot, result, motion = case
    certificate = certify(motion, result.motion, robot, result.schedule, levelling=result.schedule.height)
    promised = {promise.name: promise for promise in certificate.promises}
    for name in (*LIMITS, "jerk_rms", "sole_depth", "floor_depth"):
        assert promised[name].held, promised[name]
    joints, fps = result.motion.qpos[:, 7:], motion.fps
    assert (joints >= robot.position_lower).all() and (joints <= robot.position_upper).all()
    assert (np.abs(np.diff(joints, axis=0)) * fps <= robot.velocity_limit).all()
    assert (np.abs(np.diff(joints, 2, axis=0)) * fps**2 <= robot.acceleration_limit).all()


def test_stances_are_planted_and_jumps_are_gone(case: tuple[Robot, Refinement, RobotMotion]) -> None:
    robot, result, motion = case
    points = sole_points(result.motion, robot)
    raw = sole_points(result.levelled, robot)
    assert result.schedule.stances
    drift, before = [], []
    for stance in result.schedule.stances:
        column = owners(robot).index((stance.sole, stance.point, stance.part))
        for p, out in ((points, drift), (raw, before)):
            during = p[stance.start : stance.stop, column, :2]
            out.append(np.linalg.norm(during - during.mean(axis=0), axis=1).max())
    assert max(drift) < 0.006 and max(drift) < 0.5 * max(before)
    # Jerk of what was believed falls to a fraction.
    jerk = [np.sqrt((np.diff(m.qpos[:, 7:], 3, axis=0) ** 2).mean()) for m in (result.motion, motion)]
    assert jerk[0] < 0.5 * jerk[1]


def test_same_input_same_bytes_also_with_kinematics_of_its_own(g1: Robot) -> None:
    motion = punch(g1, 12)
    once, again = refined(motion, g1), refine(motion, g1, load_problem())
    assert once.motion.qpos.tobytes() == again.motion.qpos.tobytes()
    assert once.report.to_json() == again.report.to_json()


def test_four_frames_are_enough() -> None:
    robot = toy()
    motion = clip(standing(4) + 0.01 * np.eye(10)[2])
    result = refined(motion, robot)
    assert result.report.status in ("converged", "acceptable") and result.motion.frames == 4


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_fewer_are_not(frames: int) -> None:
    with pytest.raises(ClipError, match=f"the clip has {frames} frames; at least 4 are needed"):
        refined(clip(standing(frames)), toy())


def test_a_given_schedule_is_used_as_it_is() -> None:
    """Nothing is detected or corrected: the height is the schedule's, and without stances no foot is held."""
    motion = clip(standing(20) + 0.005 * np.eye(10)[2])
    schedule = ContactSchedule(20, motion.fps, (), height=0.02)
    result = refined(motion, toy(), schedule)
    assert result.schedule is schedule
    np.testing.assert_allclose(result.motion.qpos[:, 2], 1.025, atol=1e-3)
    assert not any(term.name.startswith("stance") for term in result.report.terms)
    assert detect(motion, toy()).stances


def test_what_does_not_fit_is_refused(g1: Robot) -> None:
    motion = clip(standing(20))
    with pytest.raises(ClipError, match="the clip moves 3 joints, the robot unitree_g1 has 29"):
        refine(motion, g1, load_problem())
    with pytest.raises(ScheduleError, match="the contact schedule has 19 frames, the clip 20"):
        refined(motion, toy(), ContactSchedule(19, motion.fps, ()))
    with pytest.raises(RobotError, match="the kinematics are of unitree_g1, not of this toy"):
        refine(motion, toy(), load_problem(), kinematics=kinematics_of(g1))


def test_a_faultless_clip_hardly_changes() -> None:
    """Standing still on the floor is kept to a fraction of a millimetre and of a degree."""
    motion = clip(standing(40))
    result = refined(motion, toy())
    assert result.report.status in ("converged", "acceptable")
    np.testing.assert_allclose(result.motion.qpos, motion.qpos, atol=1e-3)


def test_recorded_clips_converge(data_dir, g1: Robot) -> None:  # type: ignore[no-untyped-def]
    """Four seconds of a recorded walk with feet that skate."""
    path = sorted((data_dir / "gmr_pkl").glob("*.pkl"))[0]
    motion = read_clip(path, g1).motion
    motion = motion.with_qpos(motion.qpos[:120])
    result = refined(motion, g1)
    assert result.report.status in ("converged", "acceptable") and result.report.message == ""
    certificate = certify(motion, result.motion, g1, result.schedule, levelling=result.schedule.height)
    held = {promise.name: promise.held for promise in certificate.promises}
    assert all(held[name] for name in LIMITS)


def write(path: Path, frames: int) -> Path:
    """The example's first frames as a file."""
    recorded = dict(np.load(EXAMPLE))
    np.savez(path, **{**recorded, "qpos": recorded["qpos"][:frames]})
    return path


@pytest.mark.parametrize("arguments", [[], ["--window", "0.4", "--overlap", "0.1"]])
def test_the_users_path(tmp_path: Path, arguments: list[str]) -> None:
    """From file to file, whole and in windows: limits hold on what was written, whatever else is promised."""
    clip_file = write(tmp_path / "short.npz", 20)
    code = main(["refine", str(clip_file), "--quiet", *arguments])
    assert code in (ExitCode.OK, ExitCode.BROKEN_PROMISE)
    report = json.loads((tmp_path / "short_refined.npz.report.json").read_text())
    assert report["solver"]["status"] in ("converged", "acceptable")
    held = {promise["name"]: promise["held"] for promise in report["certificate"]["promises"]}
    assert all(held[name] for name in LIMITS)


def test_four_frames_from_file_to_file(tmp_path: Path) -> None:
    clip_file = write(tmp_path / "short.npz", 4)
    assert main(["refine", str(clip_file), "--quiet"]) in (ExitCode.OK, ExitCode.BROKEN_PROMISE)
    assert np.load(tmp_path / "short_refined.npz")["qpos"].shape == (4, 36)


@pytest.mark.parametrize(
    ("frames", "arguments", "message"),
    [
        (1, [], "the clip has 1 frames; at least 4 are needed"),
        (3, [], "the clip has 3 frames; at least 4 are needed"),
        (20, ["--window", "0.1"], "a window of 0.1 s with an overlap of 0.0333333 s keeps 2 frames at 30 fps"),
        (20, ["--window", "nan"], "the window is nan s; expected a positive number of seconds"),
        (20, ["--overlap", "0.2"], "an overlap of 0.2 s is of windows, and there are none"),
        (20, ["--contacts", "other.json"], "other.json: the schedule is for 7 frames but the clip has 20"),
    ],
)
def test_what_cannot_be_refined_is_one_line_and_no_file(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    frames: int,
    arguments: list[str],
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "short.npz", frames)
    (tmp_path / "other.json").write_text('{"frames": 7, "stances": []}')
    assert main(["refine", "short.npz", "--quiet", *arguments]) == ExitCode.BAD_INPUT
    error = capsys.readouterr().err
    assert error.startswith("gmr-traj: error: ") and error.count("\n") == 1 and message in error
    assert sorted(path.name for path in tmp_path.iterdir()) == ["other.json", "short.npz"]
