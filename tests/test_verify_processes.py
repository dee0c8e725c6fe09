"""Rollouts in processes of their own: killed, interrupted, given up."""

from __future__ import annotations

import multiprocessing
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from batch_setup import gone
from process_work import reciprocal
from verify_setup import squatting

from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.exceptions import RolloutError
from gmr_traj.verify.processes import in_processes


def test_a_process_that_is_killed_is_an_error_and_not_a_hang():
    with pytest.raises(RolloutError, match=r"was killed.*--workers 1"):
        list(in_processes(reciprocal, [0.01, -1.0, 0.01], 2))


def test_results_and_errors_come_with_their_index():
    found = dict(in_processes(reciprocal, [0.5, 0.0, 0.25], 2))
    assert found[0].result() == 2.0 and found[2].result() == 4.0
    assert isinstance(found[1].exception(), ZeroDivisionError)


def test_who_stops_early_leaves_no_process():
    before = set(multiprocessing.active_children())
    begun = time.monotonic()
    for _ in in_processes(reciprocal, [0.01, 60.0, 60.0], 2):
        break
    assert time.monotonic() - begun < 30.0 and set(multiprocessing.active_children()) == before


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_the_command_leaves_no_process_either(tmp_path, g1, how):
    clip = tmp_path / "squat.npz"
    motion = squatting(g1, seconds=20.0)
    np.savez(clip, qpos=motion.qpos, fps=motion.fps, joint_names=motion.joint_names, robot=motion.robot)
    command = [sys.executable, "-m", "gmr_traj", "verify", str(clip), "--start-frame", "0,1", "--workers", "2"]
    # Where the tests run in the background of a script, SIGINT is ignored, and a child would inherit that.
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    try:
        children = _children(process.pid, 2)
        process.send_signal(how)
        out, err = process.communicate(timeout=30.0)
    finally:
        process.kill()
    assert process.returncode == (ExitCode.INTERRUPTED if how == signal.SIGINT else -signal.SIGKILL)
    assert not out and "Traceback" not in err
    assert how == signal.SIGKILL or err == "gmr-traj: interrupted; nothing was written\n"
    assert all(gone(child) for child in children)


def _children(parent: int, count: int, patience: float = 30.0) -> list[int]:
    """The processes that a process has started for its rollouts, when there are as many as expected."""
    deadline = time.monotonic() + patience
    while time.monotonic() < deadline:
        listed = subprocess.run(
            ["ps", "-ww", "-o", "pid=,args=", "--ppid", str(parent)], capture_output=True, text=True
        )
        found = [int(line.split()[0]) for line in listed.stdout.splitlines() if "multiprocessing-fork" in line]
        if len(found) == count:
            time.sleep(1.5)  # into their imports or beyond
            return found
        time.sleep(0.1)
    raise AssertionError(f"{count} processes have not begun within {patience} s")
