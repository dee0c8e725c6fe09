"""`gmr-traj refine` from a human motion, and from a clip with its human source."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.cli.main import main
from gmr_traj.formats import read_clip
from gmr_traj.robot import Robot

KICK = Path(__file__).resolve().parent.parent / "examples" / "kick.txt"


@pytest.fixture
def kick(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The human example in an empty folder, which is the working folder."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "kick.txt").write_bytes(KICK.read_bytes())
    return tmp_path


def refused(folder: Path, capsys: pytest.CaptureFixture[str], *argv: str) -> str:
    """The one line of an error, which left nothing behind."""
    before = sorted(folder.iterdir())
    assert main(["refine", *argv]) == ExitCode.BAD_INPUT
    captured = capsys.readouterr()
    assert captured.out == "" and sorted(folder.iterdir()) == before
    (line,) = captured.err.splitlines()
    return line


def test_a_human_motion_is_retargeted_and_refined_in_one_go(
    kick: Path, g1: Robot, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["refine", "kick.txt"]) == ExitCode.OK
    assert {p.name for p in kick.iterdir()} == {"kick.txt", "kick_refined.npz", "kick_refined.npz.report.json"}
    captured = capsys.readouterr()
    assert "note: kick.txt was retargeted to unitree_g1 with deepmimic_to_unitree_g1" in captured.out
    assert "bodies are where the human has them (mean)" in captured.out
    report = json.loads((kick / "kick_refined.npz.report.json").read_text())
    promises = {p["name"]: p for p in report["certificate"]["promises"]}
    for name, unit in (("source_position", "mm"), ("source_orientation", "deg")):
        assert promises[name]["unit"] == unit and 0 < promises[name]["value"] <= promises[name]["bar"]
    refined = read_clip("kick_refined.npz", g1)
    assert refined.references is not None and refined.schedule is not None and refined.schedule.height == 0.0

    # In two steps, the same clip: what travels with the retargeted one is all that refine needs.
    assert main(["retarget", "kick.txt", "--quiet"]) == ExitCode.OK
    assert main(["refine", "kick_retargeted.npz", "--output", "two.npz", "--quiet"]) == ExitCode.OK
    np.testing.assert_allclose(read_clip("two.npz", g1).motion.qpos, refined.motion.qpos, atol=1e-9)


def test_a_clip_is_joined_with_its_source(kick: Path, g1: Robot, capsys: pytest.CaptureFixture[str]) -> None:
    """A csv holds nothing but the motion, here turned by a right angle; the human is found beside it all the same."""
    main(["retarget", "kick.txt", "--format", "unitree-csv", "--output", "kick.csv", "--quiet"])
    table = np.loadtxt("kick.csv", delimiter=",")
    table[:, [0, 1]] = table[:, [1, 0]] * [-1, 1]
    x, y, z, w = table[:, 3:7].T.copy()
    s = np.sqrt(0.5)
    table[:, 3:7] = np.stack([s * x - s * y, s * y + s * x, s * z + s * w, s * w - s * z], axis=1)
    np.savetxt("kick.csv", table, delimiter=",")
    capsys.readouterr()
    options = ["--fps", "30", "--input-format", "unitree-csv"]
    assert main(["refine", "kick.csv", "--source", "kick.txt", *options]) == ExitCode.OK
    captured = capsys.readouterr()
    assert "kick.txt is turned by 90 degrees" in captured.out and "where the human has them" in captured.out
    assert main(["refine", "kick.csv", *options, "--output", "alone.csv"]) == ExitCode.OK
    assert "human" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("argv", "text"),
    [
        (["kick.txt", "--source", "kick.txt"], "--source is about a robot's clip, and kick.txt is a human motion"),
        (["kick.txt", "--quaternion", "xyzw"], "--quaternion is about a robot's clip"),
        (["kick.txt", "--input-format", "gmr"], "--input-format is about a robot's clip"),
        (["kick.txt", "--map", "absent"], "absent: no such file"),
        (["kick.txt", "--rig", "lafan1"], "kick.txt: "),
        (["kick.txt", "--height", "-1"], "kick.txt: a height of -1 m"),
        (["punch.npz", "--height", "1.7"], "--height is about a human motion, and punch.npz is a robot's clip"),
        (["punch.npz", "--source", "absent.bvh"], "absent.bvh: cannot read"),
        (["punch.npz", "--source", "punch.npz"], "punch.npz: no human motion"),
        (["punch.npz", "--source", "kick.txt"], "kick.txt lasts 1.53 s, the clip 2.13 s"),
    ],
)
def test_what_does_not_fit_is_said_in_one_line(
    kick: Path, capsys: pytest.CaptureFixture[str], argv: list[str], text: str
) -> None:
    (kick / "punch.npz").write_bytes((KICK.parent / "punch.npz").read_bytes())
    assert text in refused(kick, capsys, *argv)
