"""Work for the processes of a batch that does what clips may do: end, fail, hang, crash, and take memory."""

import ctypes
import os
import signal
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import casadi as ca
import numpy as np

from gmr_traj.batch.settings import Limits
from gmr_traj.batch.work import Result
from gmr_traj.exceptions import ClipError
from gmr_traj.threads import threads

LIMITS = Limits(seconds=30.0, memory=2 * 10**9, retries=1)


@dataclass(frozen=True)
class Toy:
    """Does what its name says and notes that it has begun: a line in ``path`` with its process."""

    path: Path
    what: str
    versions: Mapping[str, str] = field(default_factory=dict)

    def prepare(self) -> None:
        pass

    def carry_out(self, folder: Path) -> Result:
        with self.path.open("a") as stream:
            stream.write(f"{os.getpid()}\n")
        result: Result | None = getattr(self, self.what)(folder)
        return result or Result({"begun": 1})

    def write(self, folder: Path) -> Result:
        (folder / "clip.npz").write_bytes(b"clip")
        return Result({"value": 1.5}, {"clip": "clip.npz"})

    def count_threads(self, folder: Path) -> Result:
        return Result({"threads": threads()})

    def fail(self, folder: Path) -> None:
        raise ClipError("the clip is\nnot one")

    def break_(self, folder: Path) -> None:
        raise ZeroDivisionError("a fault")

    def sleep(self, folder: Path) -> None:
        time.sleep(60.0)

    def solve(self, folder: Path) -> None:
        """Ipopt on something it cannot finish: it does not return to Python."""
        x = ca.MX.sym("x", 400)
        f = ca.sumsqr(ca.sin(x[1:]) * x[:-1] - 1) + ca.sumsqr(ca.cos(x * x))
        ipopt = {
            "print_level": 5,
            "max_iter": 10**9,
            "tol": 1e-300,
            "acceptable_iter": 0,
            "diverging_iterates_tol": 1e99,
        }
        options = {"ipopt": {**ipopt, "hessian_approximation": "limited-memory"}, "error_on_fail": False}
        solver = ca.nlpsol("s", "ipopt", {"x": x, "f": f}, options)
        while True:
            solver(x0=[0.3 * i % 7 for i in range(400)])

    def crash(self, folder: Path) -> None:
        ctypes.string_at(0)

    def crash_once(self, folder: Path) -> None:
        if len(self.path.read_text().splitlines()) == 1:
            os.kill(os.getpid(), signal.SIGKILL)

    def grow(self, folder: Path) -> None:
        """Take memory bit by bit."""
        held = []
        while True:
            held.append(np.ones(2 * 10**6))
            time.sleep(0.01)

    def grab(self, folder: Path) -> None:
        """Take much memory at once."""
        np.ones(4 * 10**8)

    def reserve(self, folder: Path) -> None:
        """Ask for much memory and use none of it, as sparse solvers do."""
        np.empty(4 * 10**8)

    def spawn(self, folder: Path) -> None:
        """Start a process, and hang."""
        child = os.fork()
        if child == 0:
            time.sleep(60.0)
            os._exit(0)
        with self.path.open("a") as stream:
            stream.write(f"{child}\n")
        time.sleep(60.0)


def gone(process: int, patience: float = 5.0) -> bool:
    """Whether a process has ended, or does within some time."""
    deadline = time.monotonic() + patience
    while time.monotonic() < deadline:
        try:
            state = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0]
        except (FileNotFoundError, ProcessLookupError):
            return True
        if state == "Z":
            return True
        time.sleep(0.02)
    return False


def begun(path: Path, count: int = 1, patience: float = 30.0) -> list[int]:
    """Processes that have begun, as many as are waited for."""
    deadline = time.monotonic() + patience
    while time.monotonic() < deadline:
        processes = [int(line) for line in path.read_text().split()] if path.exists() else []
        if len(processes) >= count:
            return processes
        time.sleep(0.02)
    raise AssertionError(f"{count} processes have not begun within {patience} s")
