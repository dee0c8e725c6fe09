"""`gmr-traj bench`: lengths are cut without jumps, and every figure is there."""

import json
from pathlib import Path

import numpy as np
import pytest

from gmr_traj.cli.bench import cut
from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.cli.main import main
from gmr_traj.motion import RobotMotion

EXAMPLE = Path(__file__).resolve().parent.parent / "examples" / "punch.npz"


def ramp(frames: int) -> RobotMotion:
    qpos = np.zeros((frames, 8))
    qpos[:, 3] = 1.0
    qpos[:, 7] = np.arange(frames)
    return RobotMotion(qpos, 10.0, ("joint",))


def test_a_longer_clip_goes_forth_and_back():
    np.testing.assert_array_equal(cut(ramp(4), 1.0).qpos[:, 7], [0, 1, 2, 3, 2, 1, 0, 1, 2, 3])
    np.testing.assert_array_equal(cut(ramp(40), 0.5).qpos[:, 7], np.arange(5))


def test_measures_each_length(capsys):
    assert main(["bench", str(EXAMPLE), "--seconds", "1.0", "0.5", "--json"]) == ExitCode.OK
    short, long = json.loads(capsys.readouterr().out)
    assert (short["frames"], long["frames"]) == (15, 30)
    for figures in (short, long):
        assert figures["status"] in ("converged", "acceptable") and figures["iterations"] > 0
        assert figures["frames_per_second"] == pytest.approx(figures["frames"] / figures["seconds"])
        assert figures["milliseconds_per_frame"] * figures["frames_per_second"] == pytest.approx(1000.0)
        assert 50.0 < figures["peak_megabytes"] < 4000.0


def test_the_table_has_a_line_a_length(capsys):
    assert main(["bench", str(EXAMPLE), "--seconds", "0.5"]) == ExitCode.OK
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "refine punch.npz" and lines[1].split()[:2] == ["frames", "iterations"]
    assert lines[2].split()[0] == "15" and lines[2].split()[-1] == "converged"


@pytest.mark.parametrize(
    ("argv", "text"),
    [(["absent.npz"], "absent.npz"), ([str(EXAMPLE), "--seconds", "-1"], "must be positive")],
)
def test_bad_input_is_one_line(capsys, argv, text):
    assert main(["bench", *argv]) == ExitCode.BAD_INPUT
    error = capsys.readouterr().err
    assert error.startswith("gmr-traj: error: ") and text in error and error.count("\n") == 1
