"""`gmr-traj view`, `render`, `report` and `refine --rerun`, from file to file."""

from __future__ import annotations

import os
import stat
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawing import need_mujoco_drawing, pixels
from rerun.chunk import RrdReader

from gmr_traj.cli import report as cli_report
from gmr_traj.cli import view as cli_view
from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.cli.main import main
from gmr_traj.cli.tracks import load_tracks
from gmr_traj.cli.view_arguments import View
from gmr_traj.exceptions import DrawingError
from gmr_traj.formats import read_clip, write_clip
from gmr_traj.formats.human import write_human_npz
from gmr_traj.human_motion import HumanMotion
from gmr_traj.motion import RobotMotion
from gmr_traj.robot_loading import reduce_robot
from gmr_traj.viewer import window

EXAMPLE = Path(__file__).resolve().parent.parent / "examples" / "punch.npz"


@pytest.fixture
def folder(tmp_path, monkeypatch, g1) -> Path:
    """The example and relatives of it in the working folder, on a machine without a screen."""
    monkeypatch.chdir(tmp_path)
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    (tmp_path / "punch.npz").write_bytes(EXAMPLE.read_bytes())
    clip = read_clip(EXAMPLE, g1)
    motion = clip.motion
    write_clip(clip.with_motion(motion.with_qpos(motion.qpos[:40])), "short.npz", robot=g1)
    write_clip(clip.with_motion(motion.with_qpos(motion.qpos[::-1])), "back.npz", robot=g1)
    twice = RobotMotion(np.repeat(motion.qpos, 2, axis=0), 60.0, motion.joint_names, motion.robot)
    write_clip(_fresh(clip, twice), "double.npz", robot=g1)
    few = [name for name in g1.joint_names if "wrist" not in name]
    columns = [7 + g1.joint_names.index(name) for name in few]
    legs = RobotMotion(np.hstack([motion.qpos[:, :7], motion.qpos[:, columns]]), 30.0, few, motion.robot)
    write_clip(_fresh(clip, legs), "few.npz", robot=reduce_robot(g1, few))
    return tmp_path


def _fresh(clip, motion):
    """The clip of another rate or other joints, with nothing left of the file's own fields."""
    return replace(clip.with_motion(motion), extras={"fps": None, "others": {}})


def error_of(capsys: pytest.CaptureFixture[str]) -> str:
    text = capsys.readouterr().err
    assert text.startswith("gmr-traj: error: ") and text.count("\n") == 1
    return text


def entities(path: Path) -> set[str]:
    return {str(chunk.entity_path) for chunk in RrdReader(path).stream()}


def test_view_writes_a_recording_of_any_clips(folder, capsys):
    assert main(["view", "punch.npz", "few.npz", "double.npz", "-o", "three.rrd", "--no-meshes"]) == ExitCode.OK
    assert "written: three.rrd" in capsys.readouterr().out
    found = entities(folder / "three.rrd")
    for name in ("punch", "few", "double"):
        assert {f"/tf/{name}/pelvis", f"/signals/joint_speed/{name}", f"/world/{name}/shapes/pelvis"} <= found


def test_two_clips_of_a_kind_get_a_certificate(folder, capsys):
    assert main(["view", "punch.npz", "back.npz", "-o", "two.rrd", "--no-meshes"]) == ExitCode.OK
    assert "no certificate" not in capsys.readouterr().out
    assert "/text/certificate" in entities(folder / "two.rrd")
    assert main(["view", "punch.npz", "double.npz", "-o", "apart.rrd", "--no-meshes"]) == ExitCode.OK
    assert "no certificate: punch.npz has 30 frames per second, double.npz 60" in capsys.readouterr().out
    assert "/text/certificate" not in entities(folder / "apart.rrd")


def test_clips_are_stood_on_the_floor_unless_as_is(folder, g1):
    arguments = View(clips=(), robot="unitree_g1")
    paths = [Path("punch.npz"), Path("back.npz")]
    shown = load_tracks(paths, arguments)
    assert shown.tracks[0].raised == pytest.approx(0.0189, abs=1e-3)
    assert [t.raised for t in load_tracks(paths, arguments, level=False).tracks] == [0.0, 0.0]
    # Both over the same stances, so that they can be compared.
    assert shown.tracks[0].schedule.stances == shown.tracks[1].schedule.stances
    assert shown.certificate.change.position > 0.0 and shown.apart == ""


def test_refine_leaves_a_recording_of_before_and_after_and_shows_it(folder, monkeypatch, capsys):
    monkeypatch.setenv("DISPLAY", ":1")
    shown = []
    monkeypatch.setattr(window, "show", shown.append)
    assert main(["refine", "punch.npz", "--rerun", "out.rrd", "--view", "--quiet"]) == ExitCode.OK
    assert capsys.readouterr() == ("", "")
    assert shown == [Path("out.rrd")]
    found = entities(folder / "out.rrd")
    assert {"/tf/raw/pelvis", "/tf/refined/pelvis", "/text/certificate", "/solver/inf_pr"} <= found
    assert "trace" not in (folder / "punch_refined.npz.report.json").read_text()


def test_render_writes_stills_and_strips(folder, capsys):
    need_mujoco_drawing()
    small = ["--size", "64", "72", "--shapes"]
    assert main(["render", "punch.npz", "double.npz", "-o", "still.png", *small]) == ExitCode.OK
    assert "from 0.80 s" in capsys.readouterr().out  # the worst artefact
    still = pixels((folder / "still.png").read_bytes())
    args = [
        "render",
        "punch.npz",
        "-o",
        "strip.png",
        "--time",
        "0",
        "--to",
        "2.13",
        "--columns",
        "4",
        *small,
        "--quiet",
    ]
    assert main(args) == ExitCode.OK
    assert capsys.readouterr().out == ""
    strip = pixels((folder / "strip.png").read_bytes())
    assert still.shape[1] >= 2 * 64 and strip.shape[1] >= 4 * 64
    # Clips of two rates are drawn at the same times: these two are the same motion.
    left, right = still[:60, :64].astype(int), still[:60, -64:].astype(int)
    assert np.abs(left[:40] - right[:40]).mean() < 3.0


def test_a_report_without_a_driver_says_so_and_has_the_rest(folder, monkeypatch, capsys):
    def broken(*args):
        raise DrawingError("no driver here")

    monkeypatch.setattr(cli_report, "still", broken)
    assert main(["report", "punch.npz", "back.npz"]) == ExitCode.OK
    assert "No stills: no driver here" in capsys.readouterr().out
    text = (folder / "back.report.html").read_text()
    assert "No stills: no driver here" in text and "<svg" in text and "data:image" not in text


@pytest.mark.parametrize(
    ("argv", "text"),
    [
        (["view"], "at least one clip"),
        (["view", "punch.npz"], "there is no screen"),
        (["view", "three.rrd"], "three.rrd: no such file"),
        (["view", "old.rrd"], "there is no screen"),
        (["view", "old.rrd", "punch.npz"], "a recording is shown alone"),
        (["view", "absent.npz", "-o", "new.rrd"], "absent.npz"),
        (["view", "punch.npz", "-o", "new.png"], "a recording ends in .rrd"),
        (["view", "punch.npz", "-o", "old.rrd"], "old.rrd: this file exists"),
        (["view", "punch.npz", "-o", "absent/new.rrd"], "there is no folder"),
        (["view", "punch.npz", "./punch.npz", "-o", "new.rrd"], "named twice"),
        (["view", "punch.npz", "--time", "9", "-o", "new.rrd"], "--time 9: the clips last 2.13 s"),
        (["view", "punch.npz", "--source", "absent.bvh", "-o", "new.rrd"], "absent.bvh: cannot read: No such file"),
        (["view", "punch.npz", "talos.npz", "-o", "new.rrd"], "talos"),
        (["refine", "punch.npz", "--view"], "there is no screen"),
        (["refine", "punch.npz", "--rerun", "old.rrd"], "old.rrd: this file exists"),
        (["refine", "punch.npz", "--rerun", "new.npz"], "a recording ends in .rrd"),
        (["render", "-o", "new.png"], "at least one clip"),
        (["render", "punch.npz", "-o", "new.gif"], "pictures end in .png"),
        (["render", "punch.npz", "-o", "new.png", "--time", "5"], "--time 5: punch lasts 2.13 s"),
        (["render", "punch.npz", "short.npz", "-o", "new.png", "--time", "2"], "--time 2: short lasts 1.33 s"),
        (["render", "punch.npz", "-o", "new.png", "--time", "1", "--to", "0.5"], "the range begins at 1 s"),
        (["render", "punch.npz", "-o", "new.png", "--size", "4", "4"], "4 pixels in width"),
        (["render", "punch.npz", "-o", "new.mp4", "--speed", "0"], "--speed 0"),
        (["render", "punch.npz", "-o", "new.png", "--columns", "0"], "--columns 0"),
        (["render", "punch.npz", "-o", "punch.npz"], "pictures end in"),
        (["report", "punch.npz", "double.npz"], "punch.npz has 30 frames per second, double.npz 60"),
        (["report", "punch.npz", "short.npz"], "punch.npz has 64 frames, short.npz 40"),
        (["report", "punch.npz", "few.npz"], "punch.npz moves 29 joints, few.npz 23"),
        (["report", "punch.npz", "-o", "punch.npz", "--force"], "never overwritten"),
        (["report", "punch.npz", "--stills", "-1"], "--stills -1"),
    ],
)
def test_bad_arguments_are_one_line_and_leave_nothing(folder, capsys, argv, text, g1):
    (folder / "old.rrd").write_bytes(b"old")
    content = dict(np.load(folder / "punch.npz"))
    np.savez(folder / "talos.npz", **(content | {"robot": np.array("talos"), "joint_names": np.array(["arm"] * 29)}))
    before = sorted(os.listdir())
    assert main(argv) == ExitCode.BAD_INPUT
    assert text in error_of(capsys)
    assert sorted(os.listdir()) == before


def test_the_viewer_opens_where_there_is_a_screen(folder, monkeypatch, capsys):
    monkeypatch.setenv("DISPLAY", ":1")
    shown = []
    monkeypatch.setattr(cli_view, "show", shown.append)
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    assert main(["view", "punch.npz", "--no-meshes"]) == ExitCode.OK
    assert main(["view", str(shown[0])]) == ExitCode.OK
    assert [path.parent for path in shown] == [folder] * 2 and all(entities(path) for path in shown)


def test_a_viewer_that_ends_at_once_says_why(folder, monkeypatch, capsys):
    program = folder / "viewer"
    program.write_text("#!/bin/sh\necho 'first'; echo 'no graphics adapter' >&2; exit 3\n")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("DISPLAY", ":1")
    monkeypatch.setattr(window, "command", lambda recording: [str(program)])
    (folder / "a.rrd").write_bytes(b"x")
    assert main(["view", "a.rrd"]) == ExitCode.BAD_INPUT
    assert "the rerun viewer ended at once: no graphics adapter" in error_of(capsys)


def test_the_source_is_shown_beside_the_robot(folder, capsys):
    still = np.tile([1.0, 0.0, 0.0, 0.0], (9, 2, 1))
    places = np.tile([[0.0, 0.0, 0.9], [0.0, 0.0, 1.6]], (9, 1, 1))
    person = HumanMotion("toy", ("hips", "head"), (-1, 0), places, still, 30.0, 1.8)
    write_human_npz(person, folder / "person.npz")
    arguments = ["view", "punch.npz", "--source", "person.npz", "-o", "new.rrd", "--no-meshes"]
    assert main(arguments) == ExitCode.OK
    assert {"/world/human/bones", "/tf/human"} <= entities(folder / "new.rrd")
