"""Proposed starts and ends."""

from __future__ import annotations

import json

import numpy as np
import pytest
from verify_setup import standing

from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.cli.main import main
from gmr_traj.formats import read_clip
from gmr_traj.verify.audit import audit
from gmr_traj.verify.stable import StableSpan, stable_span


def jumpy(g1):
    """Stands; but its first three frames are elsewhere, and it takes off at last."""
    qpos = standing(g1, 60).qpos.copy()
    qpos[:3, 0] += 2.0
    qpos[50:, 2] += 0.3
    return standing(g1).with_qpos(qpos)


def test_a_jump_at_the_start_and_a_take_off_are_left_out(g1):
    # A frame is judged with its neighbours, so those of the jumps are out as well.
    assert stable_span(audit(jumpy(g1), g1)) == StableSpan(4, 49)
    assert stable_span(audit(standing(g1, 30), g1)) == StableSpan(0, 30)
    assert stable_span(audit(standing(g1, 30).shifted(1.0), g1)) is None


def test_the_command_begins_and_ends_where_it_proposes(g1, tmp_path, capsys):
    path = tmp_path / "jumpy.npz"
    motion = jumpy(g1)
    np.savez(path, qpos=motion.qpos, fps=motion.fps, joint_names=motion.joint_names, robot=motion.robot)
    command = ["verify", str(path), "--find-start", "--controller", "pd", "--workers", "1"]
    assert main([*command, "--json"]) == ExitCode.NOT_FOLLOWED, "the audit is of the whole clip"
    report = json.loads(capsys.readouterr().out)["clips"][0]
    assert report["stable"] == {"start": 4, "stop": 49}
    (rollout,) = report["rollouts"]
    assert (rollout["start_frame"], rollout["stop_frame"]) == (4, 49) and rollout["success"] == 1.0
    assert rollout["trials"][0]["length"] == pytest.approx(44 / 50)
    assert main(command) == ExitCode.NOT_FOLLOWED
    out = capsys.readouterr().out
    assert "jumpy: stable from frame 4 to 48" in out and " 4-48 " in out
    assert main([*command, "--start-frame", "3"]) == ExitCode.BAD_INPUT
    assert "give one of them" in capsys.readouterr().err
    np.savez(path, qpos=standing(g1).shifted(1.0).qpos, fps=50.0, joint_names=motion.joint_names, robot=motion.robot)
    assert main([*command, "--rerun", str(tmp_path / "out.rrd")]) == ExitCode.NOT_FOLLOWED
    captured = capsys.readouterr()
    assert "jumpy: nowhere to begin: no stretch of it is stable" in captured.out and not captured.err
    assert main([*command, "--json"]) == ExitCode.NOT_FOLLOWED
    report = json.loads(capsys.readouterr().out)["clips"][0]
    assert report["stable"] is None and report["rollouts"] == [] and not report["passed"]


def test_walks_whose_first_frames_jump(data_dir, g1):
    walk = data_dir / "gmr_pkl" / "0807_yanjie_walk_004.pkl"
    if not walk.is_file():
        pytest.skip(f"{walk} does not exist")
    found = stable_span(audit(read_clip(walk, g1).motion, g1))
    assert found is not None and 2 <= found.start <= 30
