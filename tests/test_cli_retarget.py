"""`gmr-traj retarget` and `gmr-traj make-map`: what a user sees, on sound and on broken files."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from human_files import bvh_file, deepmimic_file, smpl_file
from retarget_setup import dance, human_of
from scipy.spatial.transform import Rotation

from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.cli.main import main
from gmr_traj.formats import read_clip
from gmr_traj.formats.clip import SUFFIXES
from gmr_traj.formats.human import write_human_npz
from gmr_traj.formats.human.rigs import rigs
from gmr_traj.metrics.observation import observe
from gmr_traj.resources import find
from gmr_traj.retarget.body_map import load_map
from gmr_traj.robot import Robot


@pytest.fixture
def walk(tmp_path: Path) -> Path:
    """A person of Xsens's rig who walks along the file's z."""
    bvh_file(tmp_path / "walk.bvh")
    return tmp_path / "walk.bvh"


@pytest.fixture
def dancer(tmp_path: Path, g1: Robot) -> Path:
    """A person of LAFAN1's rig who does what the robot can do."""
    human = human_of(g1, load_map("lafan1_to_unitree_g1", g1), dance(g1, frames=8), height=1.75)
    # The rig's other joints, which the map does not look at, go along with the chest.
    names = (*human.names, *(name for name in rigs()["lafan1"].joints if name not in human.names))
    copies = [human.index("Spine2")] * (len(names) - len(human.names))
    order = [*range(len(human.names)), *copies]
    whole = replace(
        human,
        names=names,
        parents=(-1, *[0] * (len(names) - 1)),
        positions=human.positions[:, order],
        quaternions=human.quaternions[:, order],
    )
    write_human_npz(whole, tmp_path / "dancer.npz")
    return tmp_path / "dancer.npz"


def refused(capsys: pytest.CaptureFixture[str], *argv: str | Path) -> str:
    """The one line of an error, which left nothing behind."""
    folder = Path(str(argv[1])).parent
    before = sorted(folder.iterdir()) if folder.is_dir() else []
    assert main([str(word) for word in argv]) == ExitCode.BAD_INPUT
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("gmr-traj: error: ")
    assert captured.err.count("\n") == 1
    assert (sorted(folder.iterdir()) if folder.is_dir() else []) == before
    return captured.err


def test_a_walk_becomes_the_robots_walk(walk: Path, g1: Robot, capsys):
    assert main(["retarget", str(walk)]) == ExitCode.OK
    shown = capsys.readouterr().out
    assert "note: rig xsens" in shown
    assert "xsens to unitree_g1 (xsens_to_unitree_g1, gmr): 40 frames at 30 Hz" in shown
    assert "walk_retargeted.npz" in re.sub(r"\s", "", shown)
    clip = read_clip(walk.with_name("walk_retargeted.npz"), g1)
    assert clip.format == "gmr-traj"
    assert clip.references is not None
    assert (clip.motion.frames, clip.motion.fps, clip.references.frames) == (40, 30.0, 40)
    seen = observe(clip.motion, g1)
    where = {name: seen.positions[:, g1.body_names.index(name)] for name in g1.body_names}
    # Upright, arms hanging, left on the left; forwards is the file's z, which is -y after the turn to Z up.
    assert np.median(where["torso_link"][:, 2] - where["left_ankle_roll_link"][:, 2]) > 0.6
    for wrist in ("left", "right"):
        drop = where[f"{wrist}_shoulder_yaw_link"][:, 2] - where[f"{wrist}_wrist_yaw_link"][:, 2]
        assert drop.min() > 0.15
    assert (where["left_wrist_yaw_link"][:, 0] - where["right_wrist_yaw_link"][:, 0]).min() > 0.3
    forwards = Rotation.from_quat(np.array(clip.motion.qpos[:, 3:7]), scalar_first=True).apply([1, 0, 0])
    assert forwards[:, 1].max() < -0.9
    assert where["pelvis"][-1, 1] < where["pelvis"][0, 1] - 0.1
    lowest = min(points[..., 2].min() for points in (*seen.soles, *seen.outlines))
    assert -1e-9 <= lowest < 0.05


@pytest.mark.parametrize("make", [smpl_file, deepmimic_file])
def test_other_rigs_find_their_maps(tmp_path: Path, g1: Robot, capsys, make):
    source = tmp_path / ("motion.npz" if make is smpl_file else "motion.txt")
    make(source)
    assert main(["retarget", str(source), "--json", "--output", str(tmp_path / "out.npz")]) == ExitCode.OK
    report = json.loads(capsys.readouterr().out)
    assert report["map"] in ("smplx_to_unitree_g1", "deepmimic_to_unitree_g1")
    assert report["frames"] == read_clip(tmp_path / "out.npz", g1).motion.frames
    assert report["steps"] > report["frames"]


@pytest.mark.parametrize("format", sorted(SUFFIXES))
def test_every_format_can_be_written(dancer: Path, g1: Robot, capsys, format: str):
    assert main(["retarget", str(dancer), "--format", format]) == ExitCode.OK
    written = dancer.with_name(f"dancer_retargeted{SUFFIXES[format]}")
    assert ("does not hold the reference placements" in capsys.readouterr().out) == (format != "gmr-traj")
    clip = read_clip(written, g1, format=format, fps=30.0)
    assert (clip.references is not None) == (format == "gmr-traj")
    found = clip.motion.qpos[:, 7:]
    np.testing.assert_allclose(found, dance(g1, frames=8)[:, 7:], atol=3e-3)


def test_options_reach_the_method(dancer: Path, g1: Robot, capsys):
    reports = {}
    for name, options in {
        "plain": [],
        "slow": ["--velocity-limit", "0.01"],
        "small": ["--height", "1.5"],
        "code": ["--method", "gmr-code"],
    }.items():
        argv = ["retarget", str(dancer), "--output", str(dancer.with_name(f"{name}.npz")), "--json", *options]
        assert main(argv) == ExitCode.OK
        reports[name] = json.loads(capsys.readouterr().out)
    clips = {name: read_clip(dancer.with_name(f"{name}.npz"), g1).motion.qpos for name in reports}
    speed = np.abs(np.diff(clips["slow"][:, 7:], axis=0)) * 30 / g1.velocity_limit
    assert speed.max() <= 0.01 + 1e-9
    assert clips["small"][:, 2].mean() < clips["plain"][:, 2].mean() - 0.05
    assert reports["code"]["raised"] == 0.0
    assert reports["small"]["human_height"] == 1.5


def test_quiet_prints_nothing(dancer: Path, capsys):
    assert main(["retarget", str(dancer), "--quiet"]) == ExitCode.OK
    captured = capsys.readouterr()
    assert captured.out + captured.err == ""


def test_what_is_wrong_is_said_in_one_line(walk: Path, dancer: Path, tmp_path: Path, capsys):
    assert "cannot read: No such file" in refused(capsys, "retarget", tmp_path / "none.bvh")
    (tmp_path / "noise.bvh").write_bytes(b"\x00\x01garbage")
    assert "no human motion that is known" in refused(capsys, "retarget", tmp_path / "noise.bvh")
    text = walk.read_text()
    (tmp_path / "cut.bvh").write_text(text[: len(text) - 500])
    assert "the file is cut" in refused(capsys, "retarget", tmp_path / "cut.bvh")
    (tmp_path / "other.bvh").write_text(text.replace("LeftKnee", "Knie"))
    unknown = refused(capsys, "retarget", tmp_path / "other.bvh")
    assert (
        "other.bvh: no map leads from a human skeleton that is not known to robot unitree_g1; there are: cmu" in unknown
    )
    missing = refused(capsys, "retarget", tmp_path / "other.bvh", "--map", "xsens_to_unitree_g1")
    assert "other.bvh: map xsens_to_unitree_g1: the motion has no joint 'LeftKnee'; it has" in missing
    assert "made for lafan1, and the motion is of the rig xsens" in refused(
        capsys, "retarget", walk, "--map", "lafan1_to_unitree_g1"
    )
    assert "no map of that name; there are: cmu" in refused(capsys, "retarget", walk, "--map", "nowhere")
    assert "expected a positive factor" in refused(capsys, "retarget", walk, "--velocity-limit", "0")
    assert "there is no folder" in refused(capsys, "retarget", walk, "--output", tmp_path / "no" / "out.npz")
    assert "this is the input" in refused(capsys, "retarget", dancer, "--output", dancer, "--force")
    assert "--height" in refused(capsys, "retarget", walk, "--height", "-1")
    (tmp_path / "walk_retargeted.npz").write_bytes(b"mine")
    assert "this file exists" in refused(capsys, "retarget", walk)
    assert main(["retarget", str(walk), "--force", "--quiet"]) == ExitCode.OK


def test_a_map_for_a_rig_of_ones_own(walk: Path, tmp_path: Path, g1: Robot, capsys):
    """The Xsens map without its offsets, made again from the skeleton in the file."""
    shipped = find("configs", "xsens_to_unitree_g1").read_text()
    draft = tmp_path / "draft.toml"
    draft.write_text(re.sub(r"rotation_offset.*\n", "", shipped))
    argv = ["make-map", str(draft), str(walk), "--up", "y", "--output", str(tmp_path / "own.toml")]
    assert main(argv) == ExitCode.OK
    assert "faces -90.0 degrees from x" in capsys.readouterr().out
    made, expected = load_map(tmp_path / "own.toml", g1), load_map("xsens_to_unitree_g1", g1)
    assert made.joint_ranges == expected.joint_ranges
    for a, b in zip(made.targets, expected.targets, strict=True):
        np.testing.assert_allclose(np.abs(a.rotation_offset @ b.rotation_offset), 1.0, atol=1e-6)
        assert replace(a, rotation_offset=b.rotation_offset).body == b.body
    assert main(["retarget", str(walk), "--map", str(tmp_path / "own.toml"), "--quiet"]) == ExitCode.OK
    assert "this file exists" in refused(capsys, *argv)


def test_a_map_that_cannot_be_made(walk: Path, tmp_path: Path, capsys):
    shipped = find("configs", "xsens_to_unitree_g1").read_text()
    draft = tmp_path / "draft.toml"
    draft.write_text(shipped)
    assert "--up y or --up z" in refused(capsys, "make-map", draft, walk)
    assert "no frame 40; it has frames 0 to 39" in refused(capsys, "make-map", draft, walk, "--frame", "40")
    assert "cannot read" in refused(capsys, "make-map", draft, tmp_path / "none.bvh", "--up", "y")
    assert "no such file, and no map" in refused(capsys, "make-map", tmp_path / "none.toml", walk, "--up", "y")
    draft.write_text(shipped.replace('"*_elbow_joint"', '"tail"'))
    assert "no joint 'tail'" in refused(capsys, "make-map", draft, walk, "--up", "y")
    draft.write_text(shipped.replace('joint = "LeftKnee"', 'joint = "Tail"'))
    assert "the motion has no joint 'Tail'" in refused(capsys, "make-map", draft, walk, "--up", "y")


def test_postures_that_differ_are_noted(walk: Path, tmp_path: Path, capsys):
    draft = tmp_path / "draft.toml"
    text = find("configs", "xsens_to_unitree_g1").read_text()
    draft.write_text(re.sub(r'"(left|right)_shoulder_roll_joint".*\n', "", text))
    assert main(["make-map", str(draft), str(walk), "--up", "y", "--facing", "-90"]) == ExitCode.OK
    assert "far from the same posture" in capsys.readouterr().out
    assert (tmp_path / "draft_map.toml").is_file()
