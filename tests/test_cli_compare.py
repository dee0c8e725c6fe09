from __future__ import annotations

import json
from pathlib import Path
from typing import get_args

import clip_files
import numpy as np
import pytest

from gmr_traj.cli.compare import short_names
from gmr_traj.cli.main import main
from gmr_traj.cli.retarget_arguments import Method
from gmr_traj.exceptions import ClipError
from gmr_traj.retarget.methods import METHODS
from gmr_traj.robot import Robot


@pytest.fixture
def clips(tmp_path: Path, g1: Robot) -> tuple[Path, Path]:
    """A clip as csv, just above the floor, and, sunk by 3 cm, as npz."""
    qpos = clip_files.squats(g1, 60) + np.eye(36)[2] * 1e-3
    good, sunk = tmp_path / "good.csv", tmp_path / "sunk|.npz"
    clip_files.unitree_csv(g1, qpos, good)
    np.savez(sunk, qpos=qpos - np.eye(36)[2] * 0.031, fps=30.0, joint_names=g1.joint_names, robot=g1.name)
    return good, sunk


def test_a_table(clips, capsys):
    assert main(["compare", *map(str, clips), "--names", "Unitree", "mine"]) == 0
    out = capsys.readouterr().out
    deepest = next(line for line in out.splitlines() if "deepest point" in line)
    assert "Unitree" in out and "0*" in deepest and "30" in deepest
    assert "stances found on at least half of the 2 clips" in out
    assert "distance to the scaled person" not in out, "a group nothing is known of is left out"


def test_json_and_markdown(clips, tmp_path, capsys):
    table = tmp_path / "table.md"
    assert main(["compare", *map(str, clips), "--json", "--markdown", str(table)]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["clips"] == ["good", "sunk|"]
    text = table.read_text(encoding="utf-8")
    assert text.startswith("|  | unit | good | sunk\\| |\n|---|---|---:|---:|\n")
    assert "| deepest point | mm | **0** | 30" in text
    rows = [line for line in text.splitlines() if line.startswith("|")]
    assert len({line.replace("\\|", "").count("|") for line in rows[: rows.index("| worst | good | sunk\\| |")]}) == 1
    assert main(["compare", *map(str, clips), "--markdown", "-"]) == 0
    assert capsys.readouterr().out == text


def test_verification_adds_an_audit_and_rollouts(clips, capsys):
    command = ["compare", *map(str, clips), "--seconds", "0", "0.3", "--verify"]
    assert main([*command, "--json"]) == 0
    metrics = json.loads(capsys.readouterr().out)["metrics"]
    values = {metric["key"]: metric["values"] for metric in metrics}
    success = next(metric for metric in metrics if metric["key"] == "rollout_success")
    assert success["where"]["good"] == "mpc A", "which preset it was"
    assert values["infeasible_share"]["good"] == 0.0 and values["infeasible_share"]["sunk|"] == 100.0
    assert values["rollout_success"]["good"] == 100.0 and values["g_mpbpe"]["good"] < 30.0
    assert values["tracked_source"]["good"] is None, "without a person"
    assert main(["compare", *map(str, clips), "--seconds", "0", "0.03", "--verify"]) == 2
    assert "shorter than one control tick" in capsys.readouterr().err
    assert main([*command[:-1], "--policy", "net.onnx"]) == 2
    assert "--policy follows the clips of --verify" in capsys.readouterr().err
    assert main([*command, "--conditions", "storm"]) == 2
    assert "no config of that name" in capsys.readouterr().err


def test_files_are_not_overwritten_unasked(clips, tmp_path, capsys):
    table = tmp_path / "table.md"
    table.write_text("mine")
    assert main(["compare", *map(str, clips), "--markdown", str(table)]) == 2
    assert "--force overwrites it" in capsys.readouterr().err
    assert table.read_text() == "mine"
    assert main(["compare", *map(str, clips), "--markdown", str(table), "--force"]) == 0
    assert table.read_text() != "mine"
    # A clip is never overwritten, whatever is asked for.
    before = clips[0].read_bytes()
    assert main(["compare", *map(str, clips), "--markdown", str(clips[0]), "--force"]) == 2
    assert "is one of the clips" in capsys.readouterr().err and clips[0].read_bytes() == before


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--names", "one"], "--names has 1 names for 2 clips"),
        (["--names", "one", "one"], "two clips are called 'one'"),
        (["--map", "lafan1_to_unitree_g1"], "give that as well"),
        (["--json", "--markdown", "-"], "both print on standard output"),
        (["--source", "none.bvh"], "none.bvh"),
        (["--seconds", "9", "10"], "has no frames from 9 s to 10 s"),
        (["--markdown", "no/such/folder.md"], "name a file in an existing folder"),
    ],
)
def test_mistakes_are_one_line(clips, capsys, arguments, message):
    assert main(["compare", *map(str, clips), *arguments]) == 2
    captured = capsys.readouterr()
    assert message in captured.err and captured.err.count("\n") == 1 and not captured.out.startswith("{")


def test_broken_and_foreign_files(clips, tmp_path, g1, capsys):
    good, sunk = clips
    (tmp_path / "cut.npz").write_bytes(sunk.read_bytes()[:300])
    with np.load(sunk) as content:
        np.savez(tmp_path / "other.npz", **{**content, "robot": "talos"})
    for name, message in (("cut.npz", "cut.npz: "), ("other.npz", "of robot 'talos', not 'unitree_g1'")):
        assert main(["compare", str(good), str(tmp_path / name)]) == 2
        assert message in capsys.readouterr().err
    assert main(["compare"]) == 2
    assert "at least one clip" in capsys.readouterr().err
    assert main(["compare", str(good), str(good)]) == 2
    assert "is given twice" in capsys.readouterr().err


def test_names_tell_the_files_apart():
    assert short_names((Path("a/x.npz"), Path("a/y.csv"))) == ("x", "y")
    assert short_names((Path("a/x.npz"), Path("a/x.csv"))) == ("x.npz", "x.csv")
    assert short_names((Path("a/x.npz"), Path("b/x.npz"))) == (str(Path("a/x.npz")), str(Path("b/x.npz")))
    with pytest.raises(ClipError, match="given twice"):
        short_names((Path("a/x.npz"), Path("a/x.npz")))


def test_the_retarget_command_offers_every_method():
    assert get_args(Method) == tuple(METHODS)


def test_retargets_of_one_walk(data_dir, tmp_path, capsys):
    """The way a user goes: retarget by two methods, compare with what GMR's code made of it."""
    name = "walk1_subject1_walk2"
    bvh, reference = data_dir / "lafan1_bvh" / f"{name}.bvh", data_dir / "gmr_reference" / f"{name}.npz"
    if not (bvh.is_file() and reference.is_file()):
        pytest.skip(f"no {name} in {data_dir}")
    protomotions = tmp_path / "pm.npz"
    command = ["retarget", str(bvh), "--method", "protomotions", "--output", str(protomotions), "--quiet"]
    assert main(command) == 0
    capsys.readouterr()
    clips = [str(reference), str(protomotions)]
    assert main(["compare", *clips, "--names", "GMR", "PM", "--source", str(bvh), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    values = {metric["key"]: metric["values"] for metric in report["metrics"]}
    # ProtoMotions scales x and y differently and leaves the feet's orientation free: they slide and dig in.
    assert values["slide_mean"]["PM"] > 3 * values["slide_mean"]["GMR"]
    assert values["penetration_max"]["PM"] > 50.0 > values["penetration_max"]["GMR"]
    assert values["orientation_mean"]["GMR"] < 8.0 < values["orientation_mean"]["PM"]
    assert all(value is not None for metric in values.values() for value in metric.values())


@pytest.mark.slow
def test_phc_sinks_into_the_floor_on_a_long_dance(data_dir, g1, capsys):
    """What the GMR paper reports of it: penetration of up to 60 cm in Dance 1."""
    from gmr_traj.comparison import Entrant, compare
    from gmr_traj.formats.human import read_human
    from gmr_traj.retarget.body_map import load_map
    from gmr_traj.retarget.retarget import retarget

    bvh = data_dir / "lafan1_bvh" / "dance1_subject1.bvh"
    if not bvh.is_file():
        pytest.skip(f"{bvh} does not exist")
    clip = retarget(read_human(bvh), g1, load_map("lafan1_to_unitree_g1", g1), method="phc")
    compared = compare([Entrant("PHC", clip.motion)], g1, seconds=(0.0, 118.0))
    depth = next(row for row in compared.rows if row.metric.key == "penetration_max").measures[0]
    assert depth.value is not None and depth.value > 300.0 and "ankle" in depth.where


@pytest.mark.slow
def test_trackers_are_held_against_the_person_too(data_dir, capsys):
    """GMR's and Unitree's retarget of the same seconds: what follows each, against each and against the person."""
    name = "dance1_subject1"
    files = [data_dir / "gmr_reference" / f"{name}.npz", data_dir / "lafan1_unitree_csv" / f"{name}.csv"]
    bvh = data_dir / "lafan1_bvh" / f"{name}.bvh"
    if not all(path.is_file() for path in (*files, bvh)):
        pytest.skip(f"no {name} in {data_dir}")
    command = ["compare", *map(str, files), "--source", str(bvh), "--seconds", "0", "3", "--verify", "--json"]
    assert main([*command, "--names", "GMR", "Unitree"]) == 0
    values = {metric["key"]: metric["values"] for metric in json.loads(capsys.readouterr().out)["metrics"]}
    assert set(values["rollout_success"].values()) == {100.0}
    for clip in ("GMR", "Unitree"):
        # Centimetres from the clip it follows, decimetres from a person of other proportions, as the clip itself.
        assert values["g_mpbpe"][clip] < 50.0 < values["tracked_source"][clip] < 200.0
        assert values["tracked_source"][clip] == pytest.approx(values["position_mean"][clip], abs=40.0)
