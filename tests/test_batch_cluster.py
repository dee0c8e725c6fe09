"""`gmr-traj batch` as it is used: on processes of this machine, killed, hanging and interrupted, and on a cluster."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from batch_setup import gone

from gmr_traj.cli.exit_codes import ExitCode

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
PATIENCE = 600.0  # [s] far beyond what any of this takes

pytestmark = pytest.mark.slow


@pytest.fixture
def data(tmp_path):
    """Clips of a second, and a pipe that nobody writes to: reading it never ends."""
    folder = tmp_path / "clips"
    for name in ("a", "b", "c"):
        (folder / name).mkdir(parents=True)
        shutil.copy(EXAMPLES / "punch.npz", folder / name)
    os.mkfifo(tmp_path / "hangs.bvh")
    return tmp_path


_started: list[subprocess.Popen[str]] = []


@pytest.fixture(autouse=True)
def nothing_left() -> Iterator[None]:
    """What a test that failed has started is ended."""
    yield
    for process in _started:
        process.kill()
        process.wait()
    _started.clear()


def start(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "gmr_traj", "batch", *arguments]
    process = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    _started.append(process)
    return process


def finish(process: subprocess.Popen[str]) -> tuple[int, str]:
    _, errors = process.communicate(timeout=PATIENCE)
    return process.returncode, errors


def wait_for(what: Callable[[], object]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not what():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def family(process: int) -> list[int]:
    """All that a process has started, and they in turn."""
    children: dict[int, list[int]] = {}
    for name in os.listdir("/proc"):
        if name.isdigit():
            above = parent(int(name))
            if above is not None:
                children.setdefault(above, []).append(int(name))
    found, waiting = [], [process]
    while waiting:
        own = children.get(waiting.pop(), [])
        found += own
        waiting += own
    return found


def clips(process: int) -> dict[int, int]:
    """Processes of clips below one, and the workers that hold them."""
    below = family(process)
    servers = {child for child in below if b"clip_server" in cmdline(child)}
    found = {}
    for child in servers:
        if (server := parent(child)) in servers and (worker := parent(server)) is not None:
            found[child] = worker
    return found


def parent(process: int) -> int | None:
    try:
        return int(Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[1])
    except (FileNotFoundError, ProcessLookupError):
        return None


def cmdline(process: int) -> bytes:
    try:
        return Path(f"/proc/{process}/cmdline").read_bytes()
    except (FileNotFoundError, ProcessLookupError):
        return b""


def attempts(out: Path) -> set[str]:
    return {path.name for path in out.glob(".batch/run-*/*.*")}


def results(out: Path) -> dict[str, bytes]:
    """Outputs and records."""
    paths = (path.relative_to(out) for path in out.rglob("*") if path.is_file())
    return {p.as_posix(): (out / p).read_bytes() for p in paths if p.parts[0] != ".batch" and p.name != "times.jsonl"}


def holding(out: Path, name: str) -> bool:
    """Whether an attempt at the clip that hangs is on the way; it is the smallest file, and the last order."""
    return any(attempt.startswith(name) for attempt in attempts(out))


def test_killed_workers_cost_an_attempt_and_a_clip_that_hangs_costs_itself(data):
    out = data / "out"
    argv = ["clips", "hangs.bvh", "--out", "out", "--jobs", "2", "--time-limit", "20"]
    process = start(data, *argv)
    killed: set[int] = set()
    for _ in range(2):
        wait_for(lambda: set(clips(process.pid).values()) - killed)
        worker = min(set(clips(process.pid).values()) - killed)
        os.kill(worker, signal.SIGKILL)
        killed.add(worker)
    code, errors = finish(process)
    assert code == ExitCode.CLIP_FAILED
    found = results(out)
    names = {f"{name}/punch" for name in "abc"}
    assert found.keys() == {
        *(name + suffix for name in names for suffix in (".npz", ".record.json")),
        "hangs.record.json",
        "summary.jsonl",
        "totals.json",
    }
    assert "not done after --time-limit, 20 s" in json.loads(found["hangs.record.json"])["reason"]
    assert all(json.loads(found[f"{name}.record.json"])["status"] == "done" for name in names)
    times = [json.loads(line) for line in (out / "times.jsonl").read_text().splitlines()]
    assert sum(entry["attempts"] for entry in times) == 6
    assert [path.name for path in (out / ".batch").iterdir()] == ["lock"]

    code, errors = finish(start(data, *argv[:-1], "2"))
    assert code == ExitCode.CLIP_FAILED and "4 clips: 3 done before, 1 to do (1 failed before)" in errors
    again = results(out)
    assert {**again, "hangs.record.json": b"", "summary.jsonl": b""} == {
        **found,
        "hangs.record.json": b"",
        "summary.jsonl": b"",
    }


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_batch_goes_on(data, number):
    out = data / "out"
    argv = ["clips/a", "hangs.bvh", "--out", "out", "--jobs", "2"]
    process = start(data, *argv)
    wait_for(lambda: (out / "punch.record.json").exists() and holding(out, "1."))
    below = family(process.pid)
    assert len(below) > 3
    process.send_signal(number)
    code, errors = finish(process)
    assert code == ExitCode.INTERRUPTED and "interrupted with 1 clips to do" in errors
    assert all(gone(child) for child in below)
    assert results(out).keys() == {"punch.npz", "punch.record.json", "summary.jsonl", "totals.json"}
    assert [path.name for path in (out / ".batch").iterdir()] == ["lock"]
    code, errors = finish(start(data, *argv, "--time-limit", "1"))
    assert code == ExitCode.CLIP_FAILED and "2 clips: 1 done before, 1 to do (1 new)" in errors


def test_a_batch_that_is_killed_leaves_no_process_and_goes_on(data):
    out = data / "out"
    process = start(data, "clips/a", "hangs.bvh", "--out", "out", "--jobs", "2")
    wait_for(lambda: (out / "punch.record.json").exists() and holding(out, "1."))
    below = family(process.pid)
    process.kill()
    process.wait()
    assert all(gone(child, patience=20.0) for child in below)
    assert results(out).keys() == {"punch.npz", "punch.record.json"}
    code, errors = finish(start(data, "clips/a", "--out", "out"))
    assert code == ExitCode.OK and "1 clips: 1 done before, 0 to do" in errors
    assert [path.name for path in (out / ".batch").iterdir()] == ["lock"]


@pytest.fixture
def scheduler(tmp_path) -> Iterator[tuple[str, int]]:
    """Address and process of a scheduler with two workers, started by Dask's own command in another folder."""
    folder = tmp_path / "cluster"
    folder.mkdir()
    dask = [sys.executable, "-m", "dask"]
    address = folder / "scheduler.json"
    common = {"cwd": folder, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    options = ["--host", "127.0.0.1", "--port", "0", "--dashboard-address", "127.0.0.1:0", "--no-dashboard"]
    started = [subprocess.Popen([*dask, "scheduler", *options, "--scheduler-file", str(address)], **common)]
    wait_for(lambda: address.exists() and address.read_text().endswith("}"))
    worker = ["worker", "--host", "127.0.0.1", "--nthreads", "1", "--no-dashboard", "--scheduler-file", str(address)]
    started += [subprocess.Popen([*dask, *worker], **common) for _ in range(2)]
    yield json.loads(address.read_text())["address"], started[0].pid
    for process in reversed(started):
        process.terminate()
        process.wait(timeout=PATIENCE)


def test_a_scheduler_of_the_user_gives_the_same(data, scheduler):
    address, _ = scheduler
    code, errors = finish(start(data, "clips", "--out", "here", "--jobs", "1"))
    assert code == ExitCode.OK, errors
    code, errors = finish(start(data, "clips", "--out", "there", "--scheduler", address))
    assert code == ExitCode.OK, errors
    assert results(data / "there") == results(data / "here")
    times = [json.loads(line) for line in (data / "there" / "times.jsonl").read_text().splitlines()]
    assert len({entry["worker"] for entry in times}) == 2


def test_a_scheduler_of_the_user_outlives_an_interrupt_and_its_end_is_told(data, scheduler):
    address, process_of_it = scheduler
    process = start(data, "hangs.bvh", "--out", "first", "--scheduler", address)
    wait_for(lambda: len(clips(os.getpid())) == 1)
    (hanging,) = clips(os.getpid())
    process.send_signal(signal.SIGINT)
    code, errors = finish(process)
    assert code == ExitCode.INTERRUPTED
    assert gone(hanging)  # the workers live on, and have given up what they did

    process = start(data, "clips/a", "hangs.bvh", "--out", "second", "--scheduler", address)
    wait_for(lambda: (data / "second" / "punch.record.json").exists() and holding(data / "second", "1."))
    os.kill(process_of_it, signal.SIGKILL)
    code, errors = finish(process)
    assert code == ExitCode.CLIP_FAILED and "Traceback" not in errors
    assert errors.splitlines()[-1].startswith("gmr-traj: error: the scheduler was lost")
    assert results(data / "second").keys() == {"punch.npz", "punch.record.json", "summary.jsonl", "totals.json"}
