"""What a measurement says, and the medians of several."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from statistics import median
from typing import Any


@dataclass(frozen=True)
class Outcome:
    """What was done while it was measured.

    Attributes:
        frames: that went in.
        iterations: how often every frame was worked on: iterations of the solver, or inverse kinematics steps a frame.
        status: of the solver; ``done`` where there is none.
        evaluation_seconds: spent in function evaluations [s]; None where nobody counts it.
        linear_seconds: spent on linear systems, for Ipopt all that is not spent in function evaluations [s]; likewise.
    """

    frames: int
    iterations: float
    status: str = "done"
    evaluation_seconds: float | None = None
    linear_seconds: float | None = None


@dataclass(frozen=True)
class Run:
    """One process in which the same was done twice.

    Attributes:
        frames, iterations, status, evaluation_seconds, linear_seconds: of the second time, see :class:`Outcome`.
        seconds: wall-clock time of the second time [s].
        cpu_seconds: processor time of it, all threads together [s].
        first_seconds, first_cpu_seconds: of the first time, in which the robot's functions are written down [s].
        loading_seconds, loading_cpu_seconds: from the start of the process to the first time, without what had to be
            made for it [s].
        peak_megabytes: largest resident memory after the first time, the interpreter and its libraries included.
    """

    frames: int
    iterations: float
    status: str
    evaluation_seconds: float | None
    linear_seconds: float | None
    seconds: float
    cpu_seconds: float
    first_seconds: float
    first_cpu_seconds: float
    loading_seconds: float
    loading_cpu_seconds: float
    peak_megabytes: float

    @property
    def startup_seconds(self) -> float:
        """All that a first use takes longer: loading, and what the first time took more than the second [s]."""
        return self.loading_seconds + max(0.0, self.first_seconds - self.seconds)

    @property
    def startup_cpu_seconds(self) -> float:
        """The same in processor time, which depends less on what else the machine does [s]."""
        return self.loading_cpu_seconds + max(0.0, self.first_cpu_seconds - self.cpu_seconds)


#: The worst of several outcomes is that of all.
_RANKING = ("done", "converged", "acceptable", "not converged")


@dataclass(frozen=True)
class Figures:
    """Several runs of the same.

    Attributes:
        name: what was measured.
        runs: at least one.
    """

    name: str
    runs: tuple[Run, ...]

    def median(self, field: str) -> float:
        """Median over the runs of one of their numbers."""
        return float(median(getattr(run, field) for run in self.runs))

    @property
    def frames(self) -> int:
        """Of the clip."""
        return self.runs[0].frames

    @property
    def status(self) -> str:
        """The worst of all runs."""
        return max((run.status for run in self.runs), key=_RANKING.index)

    @property
    def frames_per_second(self) -> float:
        """Of the second time, start-up excluded."""
        return self.frames / self.median("seconds")

    @property
    def milliseconds_per_frame(self) -> float:
        """The same the other way round."""
        return 1e3 / self.frames_per_second

    def milliseconds(self, field: str) -> float | None:
        """A time of the runs for each frame and iteration; None where nobody counted it.

        Args:
            field: ``seconds``, ``evaluation_seconds`` or ``linear_seconds``.
        """
        if getattr(self.runs[0], field) is None:
            return None
        return 1e3 * float(median(getattr(run, field) / (run.frames * max(run.iterations, 1.0)) for run in self.runs))

    def to_json(self) -> dict[str, Any]:
        """Medians, what follows from them, and all runs; ready for ``json.dumps``."""
        names = [field.name for field in fields(Run) if field.name not in ("frames", "status")]
        counted = [name for name in names if getattr(self.runs[0], name) is not None]
        per_iteration = ("seconds", "evaluation_seconds", "linear_seconds")
        return {
            "name": self.name,
            "frames": self.frames,
            "status": self.status,
            **{name: self.median(name) if name in counted else None for name in names},
            "startup_seconds": self.median("startup_seconds"),
            "startup_cpu_seconds": self.median("startup_cpu_seconds"),
            "frames_per_second": self.frames_per_second,
            "milliseconds_per_frame": self.milliseconds_per_frame,
            "milliseconds_per_frame_and_iteration": {
                name.removesuffix("_seconds"): self.milliseconds(name) for name in per_iteration
            },
            "runs": [asdict(run) for run in self.runs],
        }


def gathered(named: Sequence[tuple[str, int | None, Run]]) -> list[Figures]:
    """Runs of the same name and length put together, in the order in which these first come."""
    found: dict[tuple[str, int | None], list[Run]] = {}
    for name, length, run in named:
        found.setdefault((name, length), []).append(run)
    return [Figures(name, tuple(runs)) for (name, _), runs in found.items()]
