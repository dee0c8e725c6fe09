"""Jobs for test_bench.py, which a process of its own imports."""

import os
import signal
import time
from dataclasses import dataclass

from gmr_traj.bench.figures import Outcome
from gmr_traj.bench.fresh import Moment, Prepared
from gmr_traj.exceptions import GmrTrajError


@dataclass(frozen=True)
class Sleeps:
    """Takes 0.3 s the first time and 0.1 s the second; counts frames by its calls."""

    megabytes: int = 0

    def prepare(self) -> Prepared:
        loaded, calls = Moment.now(), []
        time.sleep(0.2)  # what is made is not start-up

        def action() -> Outcome:
            print("printed by a library")
            calls.append(bytearray(1_000_000 * self.megabytes))
            time.sleep(0.3 if len(calls) == 1 else 0.1)
            return Outcome(10 * len(calls), 2.0, "converged", 0.05, 0.04)

        return Prepared(action, loaded)


@dataclass(frozen=True)
class Fails:
    how: str

    def prepare(self) -> Prepared:
        if self.how == "refused":
            raise GmrTrajError("walk.bvh: no such file")
        if self.how == "killed":
            os.kill(os.getpid(), signal.SIGKILL)
        raise ValueError("a fault")
