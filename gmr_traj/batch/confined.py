"""A worker's side of its clip server: hand over one clip, wait for what became of it."""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping
from pathlib import Path

from gmr_traj.batch.clip_server import Watched
from gmr_traj.batch.settings import Limits
from gmr_traj.batch.work import Work
from gmr_traj.threads import VARIABLE

# One thread each: every core has a clip of its own, and BLAS' results must not depend on how many compute.
THREADS: Mapping[str, str] = {
    VARIABLE: "1",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
}
_own = threading.local()


def run_confined(work: Work, folder: Path, limits: Limits) -> Watched:
    """Carry out work in a process that is killed where it takes too much.

    Each thread that calls this has a server of its own, which outlives the call; a server that died is replaced.

    Args:
        work: what to do.
        folder: an empty folder for its outputs; the work is ended when the folder is gone.
        limits: what it may take.
    """
    server: _Server | None = getattr(_own, "server", None)
    if server is None or not server.alive:
        server = _own.server = _Server()
    return server.run(work, folder, limits)


class _Server:
    """The process, and what it last complained of."""

    def __init__(self) -> None:
        self.complaints = tempfile.TemporaryFile()
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", "gmr_traj.batch.clip_server"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self.complaints,
            # What this process can import the server can, too.
            env={**os.environ, **THREADS, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
            start_new_session=True,  # Ctrl-C in the terminal is for the command, which ends its workers itself
        )

    @property
    def alive(self) -> bool:
        return self.process.poll() is None

    def run(self, work: Work, folder: Path, limits: Limits) -> Watched:
        assert self.process.stdin is not None and self.process.stdout is not None
        order = pickle.dumps((work, folder, limits))
        try:
            self.process.stdin.write(len(order).to_bytes(8, "big") + order)
            self.process.stdin.flush()
            answer = self.process.stdout.readline()
        except BrokenPipeError:
            answer = b""
        if answer.endswith(b"\n"):
            return Watched(**json.loads(answer))
        self.process.kill()
        code = self.process.wait()
        self.complaints.seek(0)
        lines = self.complaints.read().decode(errors="replace").split("\n")
        said = next((line.strip() for line in reversed(lines) if line.strip()), "")
        why = f"the process that watches it ended with exit code {code}{': ' if said else ''}{said}"
        return Watched("crashed", why, 0.0, 0)
