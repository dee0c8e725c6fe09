"""Batch settings as data: `configs/batch.toml`, or a file of the user's own."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from gmr_traj import resources
from gmr_traj.exceptions import BatchError
from gmr_traj.toml_table import read_toml


@dataclass(frozen=True)
class Limits:
    """What one clip may take.

    Attributes:
        seconds: wall-clock time [s].
        memory: resident memory of its process [bytes].
        retries: how often it is tried again after its process crashed or its worker died.
        threads: that it computes with.

    Raises:
        BatchError: time or memory are not above zero, or retries are negative.
    """

    seconds: float
    memory: int
    retries: int
    threads: int = 1

    def __post_init__(self) -> None:
        if not self.seconds > 0:
            raise BatchError(f"the time limit is {self.seconds:g} s; it must be above zero")
        if not self.memory > 0:
            raise BatchError(f"the memory limit is {self.memory} bytes; it must be above zero")
        if self.retries < 0:
            raise BatchError(f"retries are {self.retries}; expected a number of zero or more")


@dataclass(frozen=True)
class Settings:
    """A file of batch settings.

    Attributes:
        limits: of one clip.
        patience: how long to wait for a scheduler and its first worker [s].
    """

    limits: Limits
    patience: float


def load_settings(name_or_path: str | Path = "batch") -> Settings:
    """Read batch settings.

    Raises:
        ResourceError: there is no such file.
        BatchError: a field is missing, unknown or out of range.
    """
    table = read_toml(resources.find("configs", name_or_path), BatchError)
    threads = table.count("threads", 1)
    if threads < 1:
        raise table.error("threads is 0; a clip computes with at least 1")
    limits = Limits(
        seconds=table.number("time_limit_s", above=0.0),
        memory=round(1e9 * table.number("memory_limit_gb", above=0.0)),
        retries=table.count("retries", 2),
        threads=threads,
    )
    settings = Settings(limits, table.number("patience_s", above=0.0))
    table.done()
    return settings
