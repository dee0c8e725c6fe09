"""`gmr-traj refine` from file to file; the solve itself is replaced where only what becomes of its outcome matters."""

import json
import os
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from gmr_traj.cli import refine as cli_refine
from gmr_traj.cli import refine_otherwise
from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.cli.main import main
from gmr_traj.contacts import schedule_json
from gmr_traj.contacts.detect import detect
from gmr_traj.formats import read_clip
from gmr_traj.references import BodyTargets

EXAMPLE = Path(__file__).resolve().parent.parent / "examples" / "punch.npz"


@pytest.fixture
def clip(tmp_path, monkeypatch):
    """The example clip in an empty folder, which is the working folder."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "punch.npz").write_bytes(EXAMPLE.read_bytes())
    return tmp_path / "punch.npz"


@pytest.fixture
def outcome(monkeypatch):
    """Stands in for the solve: hands the clip back standing on the floor, with the status and the fault wanted."""
    wanted = SimpleNamespace(status="converged", fault=0.0, held=None, calls=[])

    def refine(motion, robot, problem, *, schedule, references, source_stances, held, window, overlap, **_):
        given = {"schedule": schedule, "references": references, "source_stances": source_stances, "held": held}
        wanted.calls.append(SimpleNamespace(window=window, overlap=overlap, motion=motion, **given))
        schedule = schedule or detect(motion, robot, source=source_stances)
        levelled = motion.shifted(schedule.height)
        report = SimpleNamespace(
            status=wanted.status,
            solver_status="Solve_Succeeded",
            iterations=7,
            repairs=0,
            seconds=0.5,
            message="",
            to_json=lambda: {"status": wanted.status, "iterations": 7},
        )
        return SimpleNamespace(motion=levelled, levelled=levelled, schedule=schedule, report=report, seen=None)

    certify = cli_refine.certify

    def judge(*args, **kwargs):
        certificate = certify(*args, **kwargs)
        if wanted.held is None:
            return certificate
        return replace(certificate, promises=tuple(replace(p, held=wanted.held) for p in certificate.promises))

    monkeypatch.setattr(cli_refine, "refine", refine)
    monkeypatch.setattr(cli_refine, "certify", judge)
    monkeypatch.setattr(refine_otherwise, "certify", judge)
    return wanted


def written(folder: Path) -> set[str]:
    return set(os.listdir(folder)) - {"punch.npz"}


def test_every_promise_held_is_code_0(clip, outcome, capsys):
    outcome.held = True
    assert main(["refine", "punch.npz"]) == ExitCode.OK
    assert written(clip.parent) == {"punch_refined.npz", "punch_refined.npz.report.json"}
    captured = capsys.readouterr()
    assert "held" in captured.out and "written: punch_refined.npz" in captured.out
    assert captured.err == ""


def test_a_broken_promise_is_code_3_and_marked(clip, outcome, capsys):
    assert main(["refine", "punch.npz"]) == ExitCode.BROKEN_PROMISE  # the raw clip, only raised
    report = json.loads((clip.parent / "punch_refined.npz.report.json").read_text())
    assert report["exit_code"] == 3 and report["certificate"]["held"] is False
    assert "BROKEN" in capsys.readouterr().out


def test_an_unconverged_clip_never_bears_the_outputs_name(clip, outcome, capsys):
    outcome.status, outcome.held = "not converged", True
    assert main(["refine", "punch.npz", "--output", "good.npz"]) == ExitCode.NOT_CONVERGED
    assert written(clip.parent) == {"good.unconverged.npz", "good.unconverged.npz.report.json"}
    assert json.loads((clip.parent / "good.unconverged.npz.report.json").read_text())["exit_code"] == 4


def test_the_certificate_is_of_the_written_file(clip, outcome, g1):
    main(["refine", "punch.npz", "--format", "gmr", "--quiet"])
    report = json.loads((clip.parent / "punch_refined.pkl.report.json").read_text())
    back = read_clip(clip.parent / "punch_refined.pkl", g1)
    assert back.format == report["format"] == "gmr"
    raw = read_clip(clip, g1).motion
    height = report["contacts"]["height"]
    assert report["certificate"]["levelling_mm"] == pytest.approx(1e3 * height)
    np.testing.assert_allclose(back.motion.qpos, raw.shifted(height).qpos, atol=1e-6)


def test_physics_before_and_after_are_in_the_report_and_printed(clip, outcome, capsys):
    main(["refine", "punch.npz"])
    physics = json.loads((clip.parent / "punch_refined.npz.report.json").read_text())["physics"]
    # The clip is only raised, which is how the input is audited too.
    assert physics["before"]["infeasible_share"] == pytest.approx(physics["after"]["infeasible_share"], abs=0.02)
    assert physics["warnings"] == []
    shown = capsys.readouterr().out
    assert "frames over a joint's effort limit" in shown and "warning" not in shown


def test_a_worse_audit_is_a_warning(clip, outcome, capsys, monkeypatch):
    real = cli_refine.physics_change
    monkeypatch.setattr(
        cli_refine,
        "physics_change",
        lambda raw, refined, robot, levelling: real(raw, refined.shifted(0.2), robot, levelling),
    )
    main(["refine", "punch.npz"])
    assert "warning: " in capsys.readouterr().out


def test_a_clip_that_holds_its_name_is_the_same_each_time(clip, outcome):
    main(["refine", "punch.npz", "--format", "phc", "--quiet"])
    first = (clip.parent / "punch_refined.pkl").read_bytes()
    assert b"punch_refined" in first
    main(["refine", "punch.npz", "--format", "phc", "--quiet", "--force"])
    assert (clip.parent / "punch_refined.pkl").read_bytes() == first


def test_json_goes_to_stdout_and_is_the_report(clip, outcome, capsys):
    main(["refine", "punch.npz", "--json"])
    assert capsys.readouterr().out == (clip.parent / "punch_refined.npz.report.json").read_text()


def test_quiet_is_silent(clip, outcome, capsys):
    main(["refine", "punch.npz", "--quiet"])
    assert capsys.readouterr() == ("", "")


def test_contacts_are_saved_edited_and_used(clip, outcome, g1):
    main(["refine", "punch.npz", "--save-contacts", "contacts.json", "--quiet"])
    text = (clip.parent / "contacts.json").read_text()
    detected = detect(read_clip(clip, g1).motion, g1)
    assert schedule_json.from_json(text, g1, frames=detected.frames, fps=detected.fps) == detected
    edited = {"frames": detected.frames, "height": 0.01, "stances": [{"sole": "left", "start": 3, "stop": 9}]}
    (clip.parent / "edited.json").write_text(json.dumps(edited))
    main(["refine", "punch.npz", "--contacts", "edited.json", "--output", "b.npz", "--quiet"])
    used = outcome.calls[-1].schedule
    assert used.height == 0.01 and {(s.sole, s.start, s.stop) for s in used.stances} == {("left", 3, 9)}


def test_a_refined_clip_brings_its_schedule_along_with_nothing_left_to_raise(clip, outcome, g1):
    main(["refine", "punch.npz", "--quiet"])
    brought = read_clip(clip.parent / "punch_refined.npz", g1).schedule
    assert brought is not None and brought.height == 0.0 and brought.stances
    main(["refine", "punch_refined.npz", "--quiet"])
    assert outcome.calls[-1].schedule == brought


def test_references_are_raised_with_the_clip(clip, outcome, g1):
    original = read_clip(clip, g1)
    targets = BodyTargets(
        ("pelvis",), original.motion.qpos[:, None, :3], original.motion.qpos[:, None, 3:7], np.ones(1), np.ones(1)
    )
    cli_refine.write_clip(replace(original, references=targets), clip)
    main(["refine", "punch.npz", "--quiet"])
    refined = read_clip(clip.parent / "punch_refined.npz", g1)
    np.testing.assert_allclose(refined.references.positions[:, 0], refined.motion.qpos[:, :3], atol=1e-12)


def test_window_and_overlap_reach_the_solver(clip, outcome):
    main(["refine", "punch.npz", "--window", "1.5", "--overlap", "0.5", "--quiet"])
    assert (outcome.calls[-1].window, outcome.calls[-1].overlap) == (1.5, 0.5)


@pytest.mark.parametrize(
    ("argv", "text"),
    [
        (["absent.npz"], "absent.npz"),
        (["punch.npz", "--robot", "r2d2"], "r2d2: no such file"),
        (["punch.npz", "--problem", "peace"], "peace: no such file"),
        (["punch.npz", "--contacts", "absent.json"], "absent.json: No such file"),
        (["punch.npz", "--contacts", "punch.npz"], "punch.npz: this is not text"),
        (["punch.npz", "--contacts", "bad.json"], "bad.json: line 1"),
        (["punch.npz", "--output", "punch.npz"], "never overwritten"),
        (["punch.npz", "--output", "there.npz"], "there.npz: this file exists"),
        (["punch.npz", "--output", "absent/there.npz"], "there is no folder"),
        (["there.npz"], "there.npz"),
    ],
)
def test_bad_input_is_one_line_code_2_and_writes_nothing(clip, outcome, capsys, argv, text):
    (clip.parent / "there.npz").write_text("something else")
    (clip.parent / "bad.json").write_text('{"frames": 64, "stances": [{"sole": "third", "start": 0, "stop": 1}]}')
    before = sorted(os.listdir())
    assert main(["refine", *argv]) == ExitCode.BAD_INPUT
    error = capsys.readouterr().err
    assert error.startswith("gmr-traj: error: ") and error.count("\n") == 1 and text in error
    assert sorted(os.listdir()) == before


@pytest.mark.parametrize("error", [KeyboardInterrupt(), RuntimeError("a fault")])
def test_whatever_stops_the_solve_leaves_nothing_behind(clip, outcome, monkeypatch, error):
    def stop(*args, **kwargs):
        raise error

    monkeypatch.setattr(cli_refine, "physics_change", stop)
    assert main(["refine", "punch.npz"]) in (ExitCode.INTERRUPTED, ExitCode.INTERNAL_ERROR)
    assert written(clip.parent) == set()


def test_the_example_refines_for_real_and_twice_the_same(clip, capsys):
    assert main(["refine", "punch.npz", "--output", "a.npz"]) == ExitCode.OK, capsys.readouterr().out
    assert main(["refine", "punch.npz", "--output", "b.npz"]) == ExitCode.OK
    assert (clip.parent / "a.npz").read_bytes() == (clip.parent / "b.npz").read_bytes()
    reports = [(clip.parent / f"{name}.npz.report.json").read_text() for name in "ab"]
    assert reports[0] == reports[1].replace('"b.npz"', '"a.npz"')
