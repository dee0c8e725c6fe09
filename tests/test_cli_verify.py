"""The command `gmr-traj verify` on good, bad and broken clips."""

from __future__ import annotations

import json

import numpy as np
import pytest
from verify_setup import squatting, standing, with_fault

from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.cli.main import main
from gmr_traj.formats import read_clip
from gmr_traj.robot_loading import load_robot

AUDIT = ("--controller", "none")


def save(path, motion):
    np.savez(path, qpos=motion.qpos, fps=motion.fps, joint_names=motion.joint_names, robot=motion.robot)
    return path


@pytest.fixture
def clips(tmp_path, g1):
    squat = squatting(g1)
    return save(tmp_path / "squat.npz", squat), save(tmp_path / "float.npz", with_fault(squat, "float"))


def test_a_clip_that_passes_and_one_that_fails(clips, capsys):
    squat, hovering = map(str, clips)
    assert main(["verify", squat, *AUDIT]) == ExitCode.OK
    assert "passes" in capsys.readouterr().out
    assert main(["verify", squat, hovering, *AUDIT]) == ExitCode.NOT_FOLLOWED
    out = capsys.readouterr().out
    assert "FAILS" in out and "float: 100 % of the frames are infeasible" in out and "residual force" in out


def test_json(clips, tmp_path, capsys):
    assert main(["verify", str(tmp_path), "--json", *AUDIT]) == ExitCode.NOT_FOLLOWED
    report = json.loads(capsys.readouterr().out)
    assert [clip["passed"] for clip in report["clips"]] == [False, True]
    summary = report["clips"][0]["audit"]["summary"]
    assert summary["residual_force_mean"] == pytest.approx(1.0, abs=0.1)
    assert summary["com_cop_mean"] is None, "nothing presses"
    assert "frames" not in report["clips"][0]["audit"]
    assert main(["verify", str(clips[0]), "--json", "--frames", "--seconds", "0.5", "1.0", *AUDIT]) == ExitCode.OK
    frames = json.loads(capsys.readouterr().out)["clips"][0]["audit"]["frames"]
    assert {len(values) for values in frames.values()} == {25}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--seconds", "9", "10"], "has no frames from 9 s to 10 s; it lasts 2.02 s"),
        (["--seconds", "1", "0.5"], "has no frames from 1 s to 0.5 s"),
        (["--top", "-1"], "--top is -1; it must be at least 0"),
        (["--frames"], "--frames adds figures to --json"),
        (["--trials", "0"], "--trials is 0; it must be at least 1"),
        (["--workers", "0"], "--workers is 0"),
        (["--start-frame", "0,x"], "expected frames such as 0,7,49"),
        (["--start-frame", "500"], "has 101 frames; a rollout cannot begin at frame 500"),
        (["--conditions"], "--conditions needs at least one name or file"),
        (["--conditions", "storm"], "storm: no such file, and no config of that name"),
        (["--conditions", "sim", "sim"], "--conditions: two are called 'sim'"),
        (["--save", ".", "--controller", "none"], "--controller none makes none"),
        (["--save", "no/such/folder"], "there is no such folder"),
        (["--rerun", "out.rrd", "--controller", "none"], "--rerun shows one clip and its rollouts"),
        (["--rerun", "out.mp4"], "out.mp4: a recording ends in .rrd"),
        (["--robot", "none"], "none: no such file, and no model of that name"),
    ],
)
def test_mistakes_are_one_line(clips, capsys, arguments, message):
    assert main(["verify", str(clips[0]), *arguments]) == ExitCode.BAD_INPUT
    captured = capsys.readouterr()
    assert message in captured.err and captured.err.count("\n") == 1


def test_broken_files_are_a_line_each(clips, tmp_path, capsys):
    (tmp_path / "cut.npz").write_bytes(clips[0].read_bytes()[:300])
    (tmp_path / "words.csv").write_text("these, are, words\n")
    assert main(["verify", str(tmp_path), *AUDIT]) == ExitCode.BAD_INPUT
    captured = capsys.readouterr()
    assert "squat" in captured.out and captured.err.count("gmr-traj: error: ") == 2
    assert main(["verify", str(tmp_path / "none")]) == ExitCode.BAD_INPUT
    assert "no such file or folder" in capsys.readouterr().err
    assert main(["verify"]) == ExitCode.BAD_INPUT
    assert "at least one clip" in capsys.readouterr().err


def test_a_clip_with_fewer_joints(tmp_path, g1, capsys):
    motion = standing(g1)
    keep = [k for k, name in enumerate(g1.joint_names) if "wrist" not in name]
    np.savez(
        tmp_path / "arms.npz",
        qpos=motion.qpos[:, [*range(7), *(7 + k for k in keep)]],
        fps=motion.fps,
        joint_names=[g1.joint_names[k] for k in keep],
        robot=g1.name,
    )
    assert main(["verify", str(tmp_path / "arms.npz"), *AUDIT]) == ExitCode.OK


def test_rollouts_in_table_and_json(clips, tmp_path, capsys):
    squat = str(clips[0])
    command = ["verify", squat, "--seconds", "0", "0.4", "--workers", "1"]
    assert main([*command, "--preset", "A", "--save", str(tmp_path)]) == ExitCode.OK
    out = capsys.readouterr().out
    assert "mpc A" in out and "1/1" in out and "0.4/0.4" in out
    assert read_clip(tmp_path / "squat_sim_frame0_trial0.npz", load_robot("unitree_g1")).motion.frames == 20
    assert main([*command, "--controller", "pd", "--save", str(tmp_path)]) == ExitCode.BAD_INPUT
    assert "overwrite it with --force" in capsys.readouterr().err
    starts = ["--start-frame", "0,3", "--start", "default", "--conditions", "sim", "sim-dr", "--trials", "2"]
    assert main([*command, "--controller", "pd", *starts, "--json"]) == ExitCode.OK
    rollouts = json.loads(capsys.readouterr().out)["clips"][0]["rollouts"]
    # Nothing is random in `sim`, so it is run once.
    assert [(r["conditions"], r["start_frame"], len(r["trials"])) for r in rollouts] == [
        ("sim", 0, 1), ("sim", 3, 1), ("sim-dr", 0, 2), ("sim-dr", 3, 2),
    ]  # fmt: skip
    assert all(r["success"] == 1.0 and r["g_mpbpe"] > 0.0 for r in rollouts)


def test_clips_of_one_name_are_told_apart_and_one_given_twice_is_one(tmp_path, g1, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for folder in ("a", "b", "out"):
        (tmp_path / folder).mkdir()
    save(tmp_path / "a" / "still.npz", standing(g1))
    save(tmp_path / "b" / "still.npz", standing(g1))
    command = ["verify", "a", "b", "a/still.npz", "--controller", "pd", "--seconds", "0", "0.1", "--workers", "1"]
    assert main([*command, "--save", "out", "--start-frame", "0,0"]) == ExitCode.OK
    names = [f"{folder}_still_npz_sim_frame0_trial0.npz" for folder in "ab"]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == names
    assert "a/still.npz" in capsys.readouterr().out
    # Said before the rollouts, which may take minutes.
    monkeypatch.setattr("gmr_traj.cli.verify.run_jobs", lambda *_: pytest.fail("rolled out"))
    assert main([*command, "--save", "out"]) == ExitCode.BAD_INPUT
    assert capsys.readouterr().err.count("this file exists; overwrite it with --force") == 2


def test_json_says_what_the_rollouts_depend_on(clips, capsys):
    command = ["verify", str(clips[0]), "--controller", "pd", "--seconds", "0", "0.2", "--workers", "1", "--seed", "4"]
    assert main([*command, "--json"]) == ExitCode.OK
    report = json.loads(capsys.readouterr().out)
    assert (report["controller"], report["preset"], report["policy"], report["seed"]) == ("pd", None, None, 4)
    assert report["gmr_traj"] and report["mujoco"]


@pytest.mark.parametrize("conditions", ["sim", "sim-dr"])
def test_one_worker_and_two_print_the_same(clips, capsys, conditions):
    """Two workers: two threads of one rollout where there is one, two processes where there are two."""
    command = ["verify", str(clips[0]), "--preset", "A", "--seconds", "0", "0.3", "--conditions", conditions]
    printed = []
    for workers in ("1", "2"):
        assert main([*command, "--trials", "2", "--json", "--workers", workers]) == ExitCode.OK
        printed.append(capsys.readouterr().out)
    assert printed[0] == printed[1]


def test_a_recording_of_the_rollouts(clips, tmp_path, capsys, monkeypatch):
    from gmr_traj import viewer

    monkeypatch.chdir(tmp_path)
    shown, save_recording = [], viewer.save
    monkeypatch.setattr(viewer, "save", lambda scene, path: (shown.append(scene), save_recording(scene, path)))
    command = ["verify", str(clips[0]), "--seconds", "0", "0.4", "--workers", "1", "--controller", "pd"]
    assert main([*command, "--start-frame", "3", "--rerun", "out.rrd"]) == ExitCode.OK
    assert (tmp_path / "out.rrd").stat().st_size > 10_000
    clip, rollout = shown[0].tracks
    assert (clip.name, rollout.name) == ("clip", "rollout sim")
    assert clip.forces is None and rollout.forces.forces.shape == (rollout.motion.frames, 30, 3)
    weight = 9.81 * load_robot("unitree_g1").model.body_mass.sum()
    assert rollout.forces.forces[5:, :, 2].sum(axis=1).mean() == pytest.approx(weight, rel=0.3)
    assert main([*command, "--rerun", "out.rrd"]) == ExitCode.BAD_INPUT
    assert "this file exists" in capsys.readouterr().err


def test_a_clip_that_leaps_across_the_world_is_a_fall_and_not_a_hang(tmp_path, g1, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    qpos = squatting(g1).qpos.copy()
    rng = np.random.default_rng(1)
    qpos[5:, 7:] = rng.uniform(g1.position_lower, g1.position_upper, size=(len(qpos) - 5, g1.dof))
    qpos[5:, :3] += rng.uniform(-1e4, 1e4, size=(len(qpos) - 5, 3))
    path = tmp_path / "wild.npz"
    np.savez(path, qpos=qpos, fps=50.0, joint_names=g1.joint_names, robot=g1.name)
    assert main(["verify", str(path), "--json", "--workers", "1"]) == ExitCode.NOT_FOLLOWED
    rollout = json.loads(capsys.readouterr().out)["clips"][0]["rollouts"][0]
    assert rollout["success"] == 0.0 and rollout["trials"][0]["reason"]
    assert [p.name for p in tmp_path.iterdir()] == ["wild.npz"], "MuJoCo's log of warnings is not left behind"
