"""The tool that rolls out whole clips, stretch by stretch, raw and refined."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from verify_setup import squatting, with_fault

from gmr_traj.formats import Clip, write_clip

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tools"))
import segment_results
import segments_table
from segment_work import SHORTEST, segments


@given(
    frames=st.integers(1, 5000), fps=st.sampled_from([25.0, 30.0, 59.94, 120.0]), seconds=st.floats(4.0, 20.0),
    begin=st.sampled_from([0.0, 0.2]),
)  # fmt: skip
def test_segments_are_the_whole_clip_once(frames, fps, seconds, begin):
    found = segments(frames, fps, seconds, begin)
    first = round(begin * fps)
    covered = [frame for start, stop in found for frame in range(start, stop)]
    assert covered == list(range(first, frames))
    if len(found) > 1:
        assert all(stop - start >= SHORTEST * fps for start, stop in found)
        assert {stop - start for start, stop in found[:-1]} == {round(seconds * fps)}


def line(success, error, alive=10.0):
    return {"success": success, "g_mpbpe": error, "alive": alive, "length": 10.0}


def test_the_table_counts_pairs():
    audits = [{"infeasible_share": s, "joint_torque_share": 0.0, "residual_force_mean": s} for s in (0.5, 0.1)]
    kept = tuple(audit | {"frames": 300} for audit in audits)
    better = segment_results.Row(
        "walk",
        kept,
        (
            (line(True, 40.0), line(True, 20.0)),
            (line(True, 60.0), line(True, 30.0)),
            (line(False, 90.0, 5.0), line(True, 25.0)),
        ),
        4,
    )
    worse = segment_results.Row(
        "jump", tuple(a | {"frames": 100} for a in audits[::-1]), ((line(True, 9.0), line(False, 99.0, 2.0)),), 1
    )
    rows = segment_results.markdown(("raw", "refined"), (better, worse)).splitlines()
    cells = [[cell.strip() for cell in row.strip("|").split("|")] for row in rows[2:]]
    assert cells[0] == [
        "walk", "3 of 4", "50.0 / 10.0", "0.0 / 0.0", "0.500 / 0.100", "2 / 3", "83 / 100", "1 of 1", "0 of 2",
        "50.0 → 25.0 (2)",
    ]  # fmt: skip
    assert cells[1][5:] == ["1 / 0", "100 / 20", "0 of 0", "1 of 1", "none"]
    assert cells[2] == [
        "all", "4 of 5", "40.0 / 20.0", "0.0 / 0.0", "0.400 / 0.200", "3 / 3", "88 / 80", "1 of 1", "1 of 3",
        "50.0 → 25.0 (2)",
    ]  # fmt: skip


def run(monkeypatch, *arguments):
    """Exit code of the tool."""
    monkeypatch.setattr(sys, "argv", ["segments_table.py", *map(str, arguments)])
    with pytest.raises(SystemExit) as end:
        segments_table.main()
    return end.value.code


@pytest.fixture
def pair(tmp_path, g1):
    """A clip that hovers, and what refining would make of it."""
    squat = squatting(g1, seconds=0.4)
    hovering = with_fault(squat, "float")
    hovering = hovering.with_qpos(hovering.qpos + 0.1 * np.eye(36)[0])  # and is elsewhere: no two are the same
    for folder, motion in (("raw", hovering), ("refined", squat)):
        (tmp_path / folder).mkdir()
        write_clip(Clip(motion, "gmr-traj"), tmp_path / folder / "squat.npz", robot=g1)
    return tmp_path / "raw", tmp_path / "refined", tmp_path / "results.jsonl"


def test_a_second_run_does_what_is_missing(pair, monkeypatch, capsys):
    raw, refined, results = pair
    arguments = (raw, "--variant", f"refined={refined}", "--results", results)
    assert run(monkeypatch, *arguments, "--workers", "1") == 0
    out = capsys.readouterr().out
    assert "to do: 2 audits, 2 rollouts" in out and "Raw clips are raised" in out
    # The raw clip hovers, and nothing else: raised to the floor it is the refined one.
    assert "| raw/squat | 1 | 0.0 / 0.0 | 0.0 / 0.0 |" in out and "| 1 / 1 | 100 / 100 |" in out
    whole = results.read_bytes()
    results.write_bytes(whole[:-9])  # killed while it wrote
    assert run(monkeypatch, *arguments, "--workers", "1") == 0
    assert "to do: 0 audits, 1 rollouts" in capsys.readouterr().out
    first, second = ([json.loads(text) for text in content.splitlines()] for content in (whole, results.read_bytes()))
    for found in (first, second):
        [each.pop("cpu", None) for each in found]
    assert first == second
    assert run(monkeypatch, *arguments) == 0
    assert "to do: 0 audits, 0 rollouts" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--variant", "refined"], "expected NAME=FOLDER"),
        (["--variant", "raw={refined}"], "not called raw"),
        (["--variant", "k={refined}", "{refined}/squat.npz"], "no refined clip of it"),
        (["{raw}/squat.npz"], "clips that are called the same: ['raw/squat']"),
        (["{raw}/none.npz"], "no such file or folder"),
        (["--conditions", "storm"], "storm: no such file"),
    ],
)
def test_mistakes(pair, monkeypatch, arguments, message):
    raw, refined, results = pair
    given = [argument.format(raw=raw, refined=refined) for argument in arguments]
    code = run(monkeypatch, raw, *given, "--results", results)
    assert message in code
    assert not results.exists()


def test_refined_clips_that_do_not_fit(pair, monkeypatch, g1):
    raw, refined, results = pair
    arguments = (raw, "--variant", f"k={refined}", "--results", results)
    write_clip(Clip(squatting(g1, seconds=0.8), "gmr-traj"), refined / "squat.npz", robot=g1)
    assert "has 41 frames and 29 joints; expected 21 frames" in run(monkeypatch, *arguments)
    write_clip(Clip(squatting(g1), "gmr-traj"), refined / "squat_refined.npz", robot=g1)
    assert "more than one refined clip of it" in run(monkeypatch, *arguments)
    results.write_text("{}\n")
    (refined / "squat_refined.npz").unlink()
    write_clip(Clip(squatting(g1, seconds=0.4), "gmr-traj"), refined / "squat.npz", robot=g1)
    assert "line 1: this is no result of segments_table" in run(monkeypatch, *arguments)
