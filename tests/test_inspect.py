from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from gmr_traj import contacts
from gmr_traj.cli import tables
from gmr_traj.cli.inspect import inspect
from gmr_traj.cli.main import main
from gmr_traj.contacts.schedule import ContactSchedule, Stance
from gmr_traj.contacts.schedule_json import to_json
from gmr_traj.exceptions import ClipError, GmrTrajError
from gmr_traj.metrics import certify
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot
from gmr_traj.text import number

FRAMES, FPS = 90, 30.0


@pytest.fixture
def robot(g1: Robot) -> Robot:
    return g1


def standing(robot: Robot, jump: float = 0.0) -> RobotMotion:
    """The nominal configuration for three seconds, where asked with an elbow that jumps halfway [rad]."""
    qpos = np.tile(robot.nominal, (FRAMES, 1))
    qpos[45:, 7 + robot.joint_names.index("left_elbow_joint")] += jump
    return RobotMotion(qpos, FPS, robot.joint_names, robot.name)


def both_feet(robot: Robot, height: float = 0.0) -> ContactSchedule:
    stances = (Stance(s.name, k, part, 0, FRAMES) for s in robot.soles for k, part in enumerate(s.parts))
    return ContactSchedule(FRAMES, FPS, tuple(sorted(stances)), height)


def write(path: Path, robot: Robot, jump: float = 0.0, *, schedule: bool = True) -> Path:
    path.parent.mkdir(exist_ok=True)
    motion = standing(robot, jump)
    content = {"qpos": motion.qpos, "fps": FPS, "joint_names": robot.joint_names, "robot": robot.name}
    np.savez(path, **content, **({"contacts": to_json(both_feet(robot))} if schedule else {}))
    return path


def run(*paths: Path, as_json: bool = False, top: int = 10) -> int:
    return inspect(list(paths), "unitree_g1", as_json, top, None, None, None)


def test_a_clip_in_full(tmp_path, robot, capsys):
    path = write(tmp_path / "jump.npz", robot, 0.4)
    assert run(path) == 0
    out = capsys.readouterr().out
    assert f"{path}  gmr-traj, 90 frames at 30 Hz (3.0 s)" in out
    assert "left_elbow_joint" in out and "1.47-1.53" in out and "44-45" in out
    assert "the worst 1 of 1" in out


def test_a_clip_without_artefacts(tmp_path, robot, capsys):
    assert run(write(tmp_path / "still.npz", robot)) == 0
    assert "no artefacts" in capsys.readouterr().out


def test_json_holds_every_artefact(tmp_path, robot, capsys):
    assert run(write(tmp_path / "jump.npz", robot, 0.4), as_json=True, top=1) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["unreadable"] == []
    clip = report["clips"][0]
    assert [(a["kind"], a["where"], a["start"]) for a in clip["artefacts"]] == [("jump", "left_elbow_joint", 44)]
    assert clip["figures"]["speed_max"] == pytest.approx(12.0)
    assert clip["score"] > 0.0


def test_a_folder_is_ranked_the_worst_first(tmp_path, robot, capsys):
    folder = tmp_path / "clips"
    for name, jump in (("a_still", 0.0), ("b_little", 0.3), ("c_much", 0.6)):
        write(folder / f"{name}.npz", robot, jump)
    (folder / "notes.txt").write_text("not a clip")
    assert run(folder) == 0
    lines = capsys.readouterr().out.splitlines()
    order = [next(i for i, line in enumerate(lines) if name in line) for name in ("c_much", "b_little", "a_still")]
    assert order == [2, 3, 4]
    assert run(folder, top=1) == 0
    out = capsys.readouterr().out
    assert "c_much" in out and "a_still" not in out and "and 2 better ones (--top 3 lists all)" in out


def test_unreadable_files_are_a_line_each_and_the_rest_is_inspected(tmp_path, robot, capsys):
    write(tmp_path / "good.npz", robot, 0.3)
    (tmp_path / "cut.npz").write_bytes((tmp_path / "good.npz").read_bytes()[:200])
    (tmp_path / "words.csv").write_text("these, are, words\n")
    assert run(tmp_path) == 2
    captured = capsys.readouterr()
    assert "good.npz" in captured.out
    errors = captured.err.splitlines()
    assert len(errors) == 2
    assert all(line.startswith("gmr-traj: error: ") for line in errors)
    assert "cut.npz" in errors[0] and "words.csv" in errors[1]
    assert run(tmp_path, as_json=True) == 2
    assert len(json.loads(capsys.readouterr().out)["unreadable"]) == 2


def test_paths_that_are_not_there(tmp_path):
    with pytest.raises(ClipError, match="no such file or folder"):
        run(tmp_path / "missing.npz")
    with pytest.raises(ClipError, match="no clips in this folder"):
        run(tmp_path)
    with pytest.raises(GmrTrajError, match="at least 1"):
        run(tmp_path, top=0)


def test_without_a_schedule_in_the_file_contacts_are_detected(tmp_path, robot, capsys, monkeypatch):
    def hovering(motion: RobotMotion, found: Robot) -> ContactSchedule:
        assert found.name == robot.name
        return both_feet(found, height=-0.03)

    monkeypatch.setattr(contacts, "detect", hovering, raising=False)
    assert run(write(tmp_path / "bare.npz", robot, schedule=False)) == 0
    assert "above the floor" in capsys.readouterr().out


def test_the_command(tmp_path, robot, capsys):
    path = write(tmp_path / "jump.npz", robot, 0.4)
    assert main(["inspect", str(path), "--top", "3"]) == 0
    assert "left_elbow_joint" in capsys.readouterr().out
    assert main(["inspect", str(tmp_path / "none")]) == 2
    assert capsys.readouterr().err == f"gmr-traj: error: {tmp_path / 'none'}: no such file or folder\n"


def test_the_certificate_as_a_table(robot, capsys):
    from rich.console import Console

    raw, refined = standing(robot, 0.4), standing(robot, 1.0)
    measured = certify(raw, refined, robot, both_feet(robot), levelling=0.0)
    console = Console(width=160, highlight=False)
    console.print(tables.certificate(measured))
    console.print(tables.change(measured.change))
    out = capsys.readouterr().out
    for promise in measured.promises:
        line = next(line for line in out.splitlines() if line.startswith(promise.sentence))
        assert ("BROKEN" in line) == (not promise.held)
        assert number(promise.value) in line
    assert "BROKEN" in out
    for key in robot.key_bodies:
        assert key.body in out
    assert "mean [mm]" in out


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0, "0"),
        (3.0, "3"),
        (0.01234, "0.0123"),
        (4.5678, "4.57"),
        (78.96, "79.0"),
        (1234.5, "1234"),
        (1e-6, "1e-06"),
        (-3e-14, "0"),
    ],
)
def test_numbers(value, text):
    assert number(value) == text
