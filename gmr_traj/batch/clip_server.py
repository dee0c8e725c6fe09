"""A process that forks one for every clip, watches it, and ends it where it takes too much.

A worker starts it (``python -m gmr_traj.batch.clip_server``) and writes one pickled ``(work, folder, limits)`` after
the other to its standard input; for each it answers with a line of JSON.  It is not the worker itself because a solver
that does not return cannot be ended within a process, and it imports what the work needs and prepares what clips share
once, so that a clip costs a fork and not the seconds that this takes.  It has one thread, which makes the fork safe.

It ends, with the clip it watches, when its standard input is closed: that is, when the worker dies, however it dies.
"""

from __future__ import annotations

import json
import os
import pickle
import select
import signal
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

from gmr_traj.batch.clip_process import RESULT, clip_process
from gmr_traj.batch.settings import Limits
from gmr_traj.batch.work import Work
from gmr_traj.memory import keep_freed
from gmr_traj.threads import VARIABLE

# How often the clip's process is looked at [s].  Its resident memory is held to the limit by looking, not by a limit of
# the system's on what it asks for: solvers ask for several times what they touch.
LOOK = 0.05
LEASE = 0.5  # how often it is looked whether the run still goes on [s]
_PAGE = os.sysconf("SC_PAGE_SIZE")


@dataclass(frozen=True)
class Watched:
    """How the process of a clip ended.

    Attributes:
        how: ``finished`` where it left a result; ``killed`` where it took too much, and ``why`` says what;
            ``crashed``; ``void`` where the run was given up.
        why: the reason, in a sentence.
        seconds: its wall-clock time [s].
        peak: its largest resident memory [bytes].
    """

    how: Literal["finished", "killed", "crashed", "void"]
    why: str
    seconds: float
    peak: int


def main() -> None:
    """Serve until standard input is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    keep_freed()
    # What a library prints must not come between the answers.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    # Not buffered: whether more is to be read is asked of the system.
    orders = os.fdopen(0, "rb", buffering=0)
    while (size := orders.read(8)) and len(size) == 8:
        work, folder, limits = pickle.loads(_exactly(orders.fileno(), int.from_bytes(size, "big")))
        work.prepare()
        answers.write(json.dumps(asdict(watch(work, folder, limits))) + "\n")
        answers.flush()


def _exactly(handle: int, count: int) -> bytes:
    parts = bytearray()
    while len(parts) < count:
        part = os.read(handle, count - len(parts))
        if not part:
            sys.exit(0)
        parts += part
    return bytes(parts)


def watch(work: Work, folder: Path, limits: Limits) -> Watched:
    """Fork a process for the work and wait for its end, which comes at the limits if not before."""
    parent, begun = os.getpid(), time.monotonic()
    child = os.fork()
    if child == 0:
        try:
            os.environ[VARIABLE] = str(limits.threads)
            clip_process(work, folder, parent)
        finally:  # whatever happens, a second server must not come of it
            os._exit(1)
    peak, seen, killed = 0, begun, ""
    how: Literal["killed", "void"] = "killed"
    while True:
        # Anything to read here is the end of the worker: it waits for our answer.
        if select.select([0], [], [], LOOK)[0]:
            _end(child)
            sys.exit(0)
        done, status, usage = os.wait4(child, os.WNOHANG)
        now = time.monotonic()
        if done:
            break
        peak = max(peak, _resident(child))
        if peak > limits.memory:
            killed = f"it took {peak / 1e9:.2f} GB of memory, --memory-limit is {limits.memory / 1e9:g} GB"
        elif now - begun > limits.seconds:
            killed = f"it was not done after --time-limit, {limits.seconds:g} s"
        elif now - seen > LEASE:
            seen = now
            if not folder.is_dir():
                how, killed = "void", "the run was given up"
        if killed:
            _end(child)
            return Watched(how, killed, time.monotonic() - begun, peak)
    seconds, peak = now - begun, max(peak, 1024 * usage.ru_maxrss)
    if (folder / RESULT).is_file():
        return Watched("finished", "", seconds, peak)
    if not folder.is_dir():
        return Watched("void", "the run was given up", seconds, peak)
    code = os.waitstatus_to_exitcode(status)
    why = f"was killed by {signal.Signals(-code).name}" if code < 0 else f"ended with exit code {code}"
    return Watched("crashed", f"its process {why}", seconds, peak)


def _end(child: int) -> None:
    """Kill the process of a clip with all that it started, and wait until it is gone."""
    for target in (-child, child):  # its group, and itself where it has none yet
        try:
            os.kill(target, signal.SIGKILL)
        except ProcessLookupError:
            continue
    os.waitpid(child, 0)


def _resident(process: int) -> int:
    """Resident memory of a process [bytes]; 0 where it has just ended."""
    try:
        return _PAGE * int(Path(f"/proc/{process}/statm").read_text().split()[1])
    except (OSError, IndexError):
        return 0


if __name__ == "__main__":
    main()
