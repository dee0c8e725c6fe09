"""The process of one clip and who watches it: it ends when it should, whatever it does."""

import json
import os
import shutil
import signal
import threading
from dataclasses import replace
from pathlib import Path

import pytest
from batch_setup import LIMITS, Toy, begun, gone

from gmr_traj.batch import confined
from gmr_traj.batch.fingerprint import sha256, versions
from gmr_traj.batch.settings import Limits
from gmr_traj.batch.task import carry_out
from gmr_traj.batch.work import Order


@pytest.fixture
def path(tmp_path):
    file = tmp_path / "begun"
    file.touch()
    return file


@pytest.fixture
def folder(tmp_path):
    made = tmp_path / "folder"
    made.mkdir()
    return made


def limits(seconds: float = 30.0, memory: float = 2e9, retries: int = 1) -> Limits:
    return Limits(seconds, int(memory), retries)


def result(folder: Path) -> dict:
    return json.loads((folder / "result.json").read_text())


def server_process() -> int:
    return confined._own.server.process.pid


def test_what_is_done_is_there_with_its_hashes(path, folder):
    watched = confined.run_confined(Toy(path, "write", versions()), folder, LIMITS)
    assert watched.how == "finished" and 0 < watched.seconds < 10 and watched.peak > 10**7
    found = result(folder)
    assert found["failed"] == "" and found["content"] == {"value": 1.5}
    assert found["outputs"]["clip"] == {"file": "clip.npz", "sha256": sha256(folder / "clip.npz"), "bytes": 4}
    assert found["sha256"] is not None


def test_a_clip_computes_with_as_many_threads_as_it_may(path, folder):
    for count in (1, 3):
        confined.run_confined(Toy(path, "count_threads"), folder, replace(LIMITS, threads=count))
        assert result(folder)["content"] == {"threads": count}


def test_an_error_is_a_line_and_a_fault_has_its_traceback(path, folder):
    confined.run_confined(Toy(path, "fail"), folder, LIMITS)
    assert result(folder)["failed"] == "the clip is not one" and result(folder)["content"] == {}
    confined.run_confined(Toy(path, "break_"), folder, LIMITS)
    assert result(folder)["failed"] == "internal error: ZeroDivisionError: a fault"
    assert any("in break_" in line for line in result(folder)["content"]["traceback"])


def test_a_missing_input_is_a_line(path, folder):
    confined.run_confined(Toy(path.with_name("absent"), "write"), folder, LIMITS)
    assert result(folder)["failed"] == f"{path.with_name('absent')}: No such file or directory"


def test_other_versions_are_refused(path, folder):
    confined.run_confined(Toy(path, "write", {**versions(), "casadi": "1.0"}), folder, LIMITS)
    assert "casadi" in result(folder)["failed"] and "1.0" in result(folder)["failed"]
    assert not (folder / "clip.npz").exists()


@pytest.mark.parametrize("what", ["sleep", "solve", "spawn"])
def test_what_hangs_is_killed_with_all_it_started(path, folder, what):
    # A second for the import of what the work needs is not part of it, so this is short.
    watched = confined.run_confined(Toy(path, what), folder, limits(seconds=1.0))
    assert (watched.how, watched.seconds < 5.0) == ("killed", True)
    assert watched.why == "it was not done after --time-limit, 1 s"
    assert all(gone(process) for process in begun(path))
    assert not (folder / "result.json").exists()


@pytest.mark.parametrize("what", ["grow", "grab"])
def test_who_takes_too_much_memory_is_killed(path, folder, what):
    watched = confined.run_confined(Toy(path, what), folder, limits(memory=4e8))
    assert watched.how == "killed" and "--memory-limit is 0.4 GB" in watched.why
    assert 4e8 < watched.peak < 12e8


def test_memory_that_is_not_touched_does_not_count(path, folder):
    assert confined.run_confined(Toy(path, "reserve"), folder, limits(memory=4e8)).how == "finished"


def test_the_server_outlives_a_crash_and_a_kill(path, folder):
    assert confined.run_confined(Toy(path, "crash"), folder, LIMITS).why == "its process was killed by SIGSEGV"
    server = server_process()
    confined.run_confined(Toy(path, "sleep"), folder, limits(seconds=0.2))
    assert confined.run_confined(Toy(path, "write"), folder, LIMITS).how == "finished"
    assert server_process() == server


def test_a_server_that_is_killed_takes_its_clip_along_and_is_replaced(path, folder):
    confined.run_confined(Toy(path, "write"), folder, LIMITS)
    path.write_text("")
    server = server_process()
    killer = threading.Thread(target=lambda: (begun(path), os.kill(server, signal.SIGKILL)))
    killer.start()
    watched = confined.run_confined(Toy(path, "sleep"), folder, LIMITS)
    killer.join()
    assert watched.how == "crashed" and "-9" in watched.why
    assert gone(begun(path)[0])
    assert confined.run_confined(Toy(path, "write"), folder, LIMITS).how == "finished"
    assert server_process() != server


def test_a_worker_that_dies_takes_server_and_clip_along(path, folder):
    child = os.fork()
    if child == 0:
        confined._own.__dict__.clear()
        confined.run_confined(Toy(path, "sleep"), folder, LIMITS)
        os._exit(1)
    (clip,) = begun(path)
    server = int(Path(f"/proc/{clip}/stat").read_text().rsplit(")", 1)[1].split()[1])
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    assert gone(server) and gone(clip)


def test_a_run_that_is_given_up_ends_its_clips(path, tmp_path):
    run = tmp_path / "run"
    run.mkdir()
    giving_up = threading.Thread(target=lambda: (begun(path), shutil.rmtree(run)))
    giving_up.start()
    ended = carry_out(Order("clip", 0, Toy(path, "sleep"), run, LIMITS))
    giving_up.join()
    assert ended.void and gone(begun(path)[0]) and not run.exists()
    assert carry_out(Order("clip", 0, Toy(path, "write"), run, LIMITS)).void


def test_a_crash_is_tried_again(path, tmp_path):
    ended = carry_out(Order("clip", 0, Toy(path, "crash_once"), tmp_path, LIMITS))
    assert (ended.failed, ended.attempts) == ("", 2)
    assert result(ended.folder)["content"] == {"begun": 1}


def test_what_crashes_again_and_again_fails_with_its_reason(path, tmp_path):
    ended = carry_out(Order("clip", 3, Toy(path, "crash"), tmp_path, limits(retries=2)))
    assert ended.failed == "given up after 3 attempts: its process was killed by SIGSEGV"
    assert len(begun(path, 3)) == 3


def test_attempts_whose_worker_died_count(path, tmp_path):
    for attempt in range(3):
        (tmp_path / f"0.{attempt}.dead").mkdir()
    ended = carry_out(Order("clip", 0, Toy(path, "write"), tmp_path, limits(retries=2)))
    assert ended.failed == "given up after 3 attempts: each time its worker died with it"
    assert path.read_text() == ""


def test_what_takes_too_long_is_not_tried_again(path, tmp_path):
    ended = carry_out(Order("clip", 0, Toy(path, "sleep"), tmp_path, limits(seconds=0.3)))
    assert ended.attempts == 1 and "--time-limit" in ended.failed
    assert len(begun(path)) == 1
