"""Measuring in a process of its own, so that nothing is in memory, in a cache or written down before it begins.

The process is this module run as a program: it takes one pickled ``(job, moment of its start)`` from its standard
input and answers with a line of JSON.
"""

from __future__ import annotations

import json
import os
import pickle
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Protocol

from gmr_traj.bench.figures import Outcome, Run
from gmr_traj.exceptions import BenchError, GmrTrajError
from gmr_traj.memory import keep_freed


@dataclass(frozen=True)
class Moment:
    """A moment, by two clocks.

    Attributes:
        wall: by the monotonic clock, which all processes share [s].
        cpu: processor time of this process so far, all threads together [s].
    """

    wall: float
    cpu: float

    @staticmethod
    def now() -> Moment:
        """This one."""
        return Moment(time.monotonic(), time.process_time())


@dataclass(frozen=True)
class Prepared:
    """Something that is ready to be measured.

    Attributes:
        action: does it; the same again each time.
        loaded: when all that start-up has to load was loaded; what was made after that is not counted.
    """

    action: Callable[[], Outcome]
    loaded: Moment


class Job(Protocol):
    """What can be measured; it is pickled."""

    def prepare(self) -> Prepared:
        """Load, and make what is needed, in the process that measures."""
        ...


def measured(job: Job) -> Run:
    """Start a process, do the job twice in it, and say what that took.

    Raises:
        GmrTrajError: the job cannot be done; the message says why.
        BenchError: the process ended without an answer.
    """
    # What this process can import the other can, too.
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    command = [sys.executable, "-P", "-m", "gmr_traj.bench.fresh"]
    done = subprocess.run(
        command, input=pickle.dumps((job, time.monotonic())), capture_output=True, env=environment, check=False
    )
    lines = done.stdout.splitlines()
    if done.returncode == 0 and lines:
        answer = json.loads(lines[-1])
        if "refused" in answer:
            raise GmrTrajError(answer["refused"])
        return Run(**answer)
    if done.returncode < 0:
        name = signal.Signals(-done.returncode).name
        hint = "; it may have needed more memory than there is" if name == "SIGKILL" else ""
        raise BenchError(f"the process that measures was killed by {name}{hint}")
    said = done.stderr.decode(errors="replace").strip().splitlines()
    raise BenchError(f"the process that measures ended with exit code {done.returncode}: {said[-1] if said else ''}")


def twice(prepared: Prepared, started: float) -> Run:
    """Do it twice, the second time with everything written down.

    Args:
        prepared: what to do.
        started: when the process was started, by the monotonic clock [s].
    """
    first = Moment.now()
    prepared.action()
    done = Moment.now()
    peak = peak_megabytes()
    second = Moment.now()
    outcome = prepared.action()
    again = Moment.now()
    return Run(
        **asdict(outcome),
        seconds=again.wall - second.wall,
        cpu_seconds=again.cpu - second.cpu,
        first_seconds=done.wall - first.wall,
        first_cpu_seconds=done.cpu - first.cpu,
        loading_seconds=prepared.loaded.wall - started,
        loading_cpu_seconds=prepared.loaded.cpu,
        peak_megabytes=peak,
    )


def peak_megabytes() -> float:
    """Largest resident memory of this process so far [MB]."""
    status = Path("/proc/self/status")
    if status.exists():  # the other count below is inherited from the process that started this one
        line = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM:"))
        return 1024 * int(line.split()[1]) / 1e6
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6  # bytes on macOS


def main() -> None:
    """Do the one job that comes by standard input."""
    # What a library prints must not come between the answer and who waits for it.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    keep_freed()
    job, started = pickle.load(sys.stdin.buffer)
    answer: dict[str, Any]
    try:
        answer = asdict(twice(job.prepare(), started))
    except GmrTrajError as error:
        answer = {"refused": str(error)}
    answers.write(json.dumps(answer) + "\n")
    answers.flush()


if __name__ == "__main__":
    main()
