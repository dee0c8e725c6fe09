"""The command's arguments, one frozen dataclass a subcommand; tyro turns them into options and help."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import tyro

from gmr_traj.exceptions import GmrTrajError

Format = Literal[
    "gmr", "gmr-traj", "unitree-csv", "protomotions-csv", "bones-csv", "mjlab", "beyondmimic", "holosoma", "phc"
]
FORMAT = tyro.conf.arg(metavar="FORMAT", help_behavior_hint=f"({', '.join(get_args(Format))})")


def named(metavar: str, otherwise: str = "") -> Any:
    """An option whose value is called ``metavar`` in the help, with what happens where it is not given."""
    return tyro.conf.arg(metavar=metavar, help_behavior_hint=f"(default: {otherwise})" if otherwise else None)


@dataclass(frozen=True, kw_only=True)
class Subcommand(ABC):
    """Options that every subcommand has."""

    robot: Annotated[str, named("NAME|PATH")] = "unitree_g1"
    """Robot: one that ships with gmr-traj, or the path of a robot.toml."""

    traceback: bool = False
    """Print the Python traceback of an error (also: GMR_TRAJ_TRACEBACK=1)."""

    @abstractmethod
    def run(self) -> int:
        """Carry the subcommand out and return its exit code."""


@dataclass(frozen=True, kw_only=True)
class Common(Subcommand):
    """Options that every subcommand has whose input is a clip of a robot."""

    input_format: Annotated[Format | None, FORMAT] = None
    """Format of the input; detected from its content where it is not given."""

    fps: Annotated[float | None, named("HZ", "what the file says, else what its format implies")] = None
    """Frames per second of the input."""

    quaternion: Annotated[Literal["xyzw", "wxyz"] | None, named("xyzw|wxyz", "decided from the content")] = None
    """Order of the input's base quaternion."""


@dataclass(frozen=True, kw_only=True)
class Inspect(Common):
    """Report the artefacts of clips: what, where, how bad. Changes nothing.

    A folder is searched for clips, and they are ranked, the worst first.
    """

    paths: Annotated[
        tyro.conf.Positional[tuple[Path, ...]],
        tyro.conf.arg(metavar="CLIP|FOLDER...", help_behavior_hint="(at least one)"),
    ]
    """Clips, or folders of clips."""

    top: int = 10
    """How many artefacts (of a clip) or clips (of a folder) to list."""

    json: bool = False
    """Print the report as JSON on standard output instead of tables."""

    def run(self) -> int:
        """Inspect the clips."""
        if not self.paths:
            raise GmrTrajError("inspect needs at least one clip or folder of clips")
        from gmr_traj.cli.inspect import inspect

        return inspect(list(self.paths), self.robot, self.json, self.top, self.fps, self.quaternion, self.input_format)
