"""What is done with one clip, as the processes pass it on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from gmr_traj.batch.settings import Limits


@dataclass(frozen=True)
class Result:
    """What came of a clip that was carried out to its end.

    Attributes:
        content: for the record, ready for ``json.dumps``, the same for equal runs.
        outputs: names of the files written, by what they are.
        failed: why there are no outputs, in a sentence; empty where there are.
    """

    content: Mapping[str, Any]
    outputs: Mapping[str, str] = field(default_factory=dict)
    failed: str = ""


class Work(Protocol):
    """Something to be done with one file; it is pickled, and its module is imported where it is carried out."""

    @property
    def path(self) -> Path:
        """The input."""

    @property
    def versions(self) -> Mapping[str, str]:
        """What the packages must be for the result to be the same everywhere."""

    def prepare(self) -> None:
        """Make what several clips share, in the process that the clips' own are forked from.

        Nothing here may take long, need other threads, or raise: nobody watches it.
        """

    def carry_out(self, folder: Path) -> Result:
        """Write the outputs into a folder that is there and empty.

        Raises:
            GmrTrajError: the clip cannot be done.
        """


@dataclass(frozen=True)
class Order:
    """One clip, as it is sent to a worker.

    Attributes:
        name: of its outputs.
        index: which of the run's clips it is.
        work: what is to be done.
        run: the run's folder for unfinished work; the order is void when it is gone.
        limits: what the clip may take.
    """

    name: str
    index: int
    work: Work
    run: Path
    limits: Limits


@dataclass(frozen=True)
class Ended:
    """How an order ended.

    Attributes:
        name: of the clip.
        failed: why there are no outputs, in a sentence; empty where there are.
        folder: what was written is there, with ``result.json``; None where nothing was.
        void: whether the run was given up meanwhile.
        seconds: wall-clock time of the last attempt [s].
        peak: largest resident memory of its process [bytes].
        attempts: how often it was begun.
        worker: host and process that carried it out.
    """

    name: str
    failed: str = ""
    folder: Path | None = None
    void: bool = False
    seconds: float = 0.0
    peak: int = 0
    attempts: int = 0
    worker: str = ""
