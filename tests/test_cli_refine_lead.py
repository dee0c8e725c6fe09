"""`gmr-traj refine --lead-in --lead-out`, from file to file."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from gmr_traj.cli import refine as cli_refine
from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.cli.main import main
from gmr_traj.cli.refine_otherwise import Settled
from gmr_traj.formats import read_clip
from gmr_traj.robot_loading import reduce_robot
from gmr_traj.verify.audit import audit

EXAMPLE = Path(__file__).resolve().parent.parent / "examples" / "punch.npz"
WALK = "0807_yanjie_walk_002.pkl"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder, which is the working folder, with the example clip in it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "punch.npz").write_bytes(EXAMPLE.read_bytes())
    return tmp_path


@pytest.fixture
def asked(monkeypatch):
    """What the solver is asked for; it hands the clip back standing on the floor."""
    calls = []

    def refine(motion, robot, problem, *, schedule, **rest):
        calls.append(SimpleNamespace(motion=motion, robot=robot, schedule=schedule, **rest))
        content = {"status": "converged", "solver_status": "Solve_Succeeded", "iterations": 1, "seconds": 0.1}
        report = SimpleNamespace(**content, message="", to_json=lambda: content)
        levelled = motion.shifted(schedule.height)
        return SimpleNamespace(motion=levelled, levelled=levelled, schedule=schedule, report=report, seen=None)

    def settle(clip, robot, problem, solved):  # a clip that was not refined would be solved a second time
        return Settled(solved(problem), problem.name)

    monkeypatch.setattr(cli_refine, "refine", refine)
    monkeypatch.setattr(cli_refine, "settle", settle)
    return calls


def test_the_example_with_leads_keeps_every_promise(folder, capsys, g1):
    raw = read_clip("punch.npz", g1).motion
    argv = ["refine", "punch.npz", "--lead-in", "0.8", "--lead-out", "1.5", "--output", "out.npz"]
    code, printed = main(argv), capsys.readouterr()
    assert code == ExitCode.OK, printed
    before, after = round(0.8 * raw.fps), round(1.5 * raw.fps)
    assert f"{before} frames (0.80 s) were put before the clip" in printed.out
    report = json.loads((folder / "out.npz.report.json").read_text())
    assert report["lead"] == {
        "in": {"frames": before, "replaced": report["lead"]["in"]["replaced"]},
        "out": {"frames": after, "replaced": report["lead"]["out"]["replaced"]},
    }
    with np.load(folder / "out.npz") as content:
        assert (int(content["lead_in_frames"]), int(content["lead_out_frames"])) == (before, after)
    motion = read_clip("out.npz", g1).motion
    assert motion.frames == raw.frames + before + after
    for end in (motion.qpos[:3], motion.qpos[-3:]):
        np.testing.assert_allclose(end[:, 7:], np.tile(g1.nominal[7:], (3, 1)), atol=1e-9)
        np.testing.assert_allclose(end[:, 2], g1.nominal[2], atol=1e-6)
    found = audit(motion, g1)
    assert found.infeasible[:before].mean() < 0.1  # (it ends in a step too quick to be led out of as well)


def test_a_schedule_is_of_the_clip_and_moves_with_it(folder, asked):
    stances = [{"sole": "left", "start": 3, "stop": 9}, {"sole": "right", "start": 0, "stop": 14}]
    (folder / "contacts.json").write_text(json.dumps({"frames": 64, "height": 0.01, "stances": stances}))
    main(["refine", "punch.npz", "--contacts", "contacts.json", "--lead-in", "1", "--window", "1.5", "--quiet"])
    (call,) = asked
    added = call.motion.frames - 64
    assert call.schedule.frames == call.motion.frames and call.schedule.height == 0.01
    assert {(s.start, s.stop) for s in call.schedule.stances if s.sole == "left" and s.start > added} == {
        (added + 3, added + 9)
    }
    assert any(s.sole == "right" and s.stop == added + 14 and s.start < added for s in call.schedule.stances)
    assert call.window == 1.5 and call.source_stances is None
    np.testing.assert_array_equal(call.held, [0, 1, 2])


def test_without_leads_nothing_is_held(folder, asked):
    main(["refine", "punch.npz", "--contacts", "c.json", "--quiet"])
    assert not asked  # the file is not there
    main(["refine", "punch.npz", "--save-contacts", "c.json", "--quiet", "--lead-out", "1.5"])
    main(["refine", "punch.npz", "--contacts", "c.json", "--quiet", "--output", "b.npz"])
    assert len(asked) == 1  # the schedule is of the clip with its lead
    assert json.loads((folder / "punch_refined.npz.report.json").read_text())["lead"]["in"] is None


@pytest.mark.parametrize("name", ["unitree-csv", "phc"])
def test_formats_that_hold_no_word_of_leads_hold_the_frames(folder, asked, g1, name):
    main(["refine", "punch.npz", "--lead-in", "0.8", "--lead-out", "1.5", "--format", name, "--quiet", "--output", "x"])
    (call,) = asked
    back = read_clip(folder / "x", g1, format=name, fps=call.motion.fps)
    assert back.motion.frames == call.motion.frames
    assert json.loads((folder / "x.report.json").read_text())["lead"]["in"]["frames"] == round(0.8 * call.motion.fps)


def test_a_clip_of_23_joints_is_led_into_with_its_23(folder, asked, g1):
    motion = read_clip("punch.npz", g1).motion
    kept = tuple(name for name in motion.joint_names if "wrist" not in name)
    columns = [motion.joint_names.index(name) for name in kept]
    with np.load("punch.npz") as content:
        fps = content["fps"]
    qpos = np.hstack([motion.qpos[:, :7], motion.qpos[:, 7:][:, columns]])
    np.savez("few.npz", qpos=qpos, fps=fps, joint_names=np.array(kept), robot="unitree_g1")
    main(["refine", "few.npz", "--lead-in", "0.8", "--quiet"])
    (call,) = asked
    robot = reduce_robot(g1, kept)
    assert call.robot.joint_names == kept
    np.testing.assert_allclose(call.motion.qpos[0, 7:], robot.nominal[7:], atol=1e-12)


@pytest.mark.parametrize(
    ("argv", "text"),
    [
        (["--lead-in", "0"], "--lead-in is 0; expected seconds, more than 0 and at most 60"),
        (["--lead-out", "-1"], "--lead-out is -1; expected seconds"),
        (["--lead-in", "nan"], "--lead-in is nan; expected seconds"),
        (["--lead-out", "300"], "--lead-out is 300; expected seconds, more than 0 and at most 60"),
        (["--lead-in", "0.05"], "--lead-in 0.05 s is too short"),
        (["--lead-out", "0.05"], "--lead-out 0.05 s is too short"),
    ],
)
def test_lengths_that_cannot_be_are_one_line_and_nothing_is_written(folder, capsys, argv, text):
    assert main(["refine", "punch.npz", *argv]) == ExitCode.BAD_INPUT
    error = capsys.readouterr().err
    assert text in error and error.count("\n") == 1
    assert [path.name for path in folder.iterdir()] == ["punch.npz"]


@pytest.mark.slow
def test_a_recorded_walk_with_leads_keeps_every_promise_and_can_be_stood(folder, data_dir, g1, capsys):
    walk = data_dir / "gmr_pkl" / WALK
    if not walk.exists():
        pytest.skip(f"no {walk}")
    assert main(["refine", str(walk), "--lead-in", "1.5", "--lead-out", "1.5", "--output", "w.pkl"]) == ExitCode.OK
    raw, motion = read_clip(walk, g1).motion, read_clip("w.pkl", g1).motion
    added = round(1.5 * raw.fps)
    assert motion.frames == raw.frames + 2 * added
    assert "its first 2, a transient, are part of the blend" in capsys.readouterr().out
    found = audit(motion, g1)
    assert found.infeasible[:added].mean() < 0.05 and found.infeasible[-added:].mean() < 0.05
