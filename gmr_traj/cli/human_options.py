"""Options about a human motion, for every subcommand that reads one."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, get_args

import tyro

from gmr_traj.cli.arguments import named
from gmr_traj.exceptions import MapError

if TYPE_CHECKING:
    from gmr_traj.human_motion import HumanMotion
    from gmr_traj.retarget.body_map import BodyMap
    from gmr_traj.robot import Robot

Method = Literal["gmr", "gmr-code", "phc", "phc-paper", "phc-adam", "protomotions", "protomotions-paper"]
METHOD = tyro.conf.arg(metavar="METHOD", help_behavior_hint=f"({', '.join(get_args(Method))}; default: gmr)")


@dataclass(frozen=True, kw_only=True)
class HumanOptions:
    """How to read a human motion, and which map takes it to the robot."""

    map: Annotated[str | None, named("NAME|PATH", "the one that ships for the motion's rig and the robot")] = None
    """Which human joint tells which body of the robot: a map that ships with gmr-traj, or the path of a file."""

    height: Annotated[float | None, named("M", "measured on the skeleton")] = None
    """How tall the person is [m]."""

    rig: Annotated[str | None, named("NAME", "by the names of the joints")] = None
    """Whose joint names and joint frames the motion has: lafan1, xsens, cmu, smplx, smpl, deepmimic, or your own."""

    up: Annotated[Literal["y", "z"] | None, named("y|z", "decided from the motion")] = None
    """Which axis of the human motion's file points up."""

    unit: Annotated[str | None, named("m|cm|mm|in|...", "decided from the skeleton")] = None
    """Unit of length of the human motion's file."""

    body_model: Annotated[Path | None, named("PATH", "a mean skeleton")] = None
    """SMPL or SMPL-X model file, for the joint positions of motions that come without."""

    def read_human(self, path: Path, fps: float | None = None) -> HumanMotion:
        """Read a human motion.

        Raises:
            ClipError: the file cannot be read, or leaves a question open.
        """
        from gmr_traj.formats.human import read_human

        return read_human(
            path, fps=fps, height=self.height, up=self.up, unit=self.unit, body_model=self.body_model, rig=self.rig
        )

    def load_map(self, human: HumanMotion, path: Path, robot: Robot) -> BodyMap:
        """The map from the person to the robot.

        Raises:
            MapError, ResourceError: there is none, or it does not fit; the message names the motion's file.
        """
        from gmr_traj.retarget.body_map import default_map_name, load_map

        if self.map is not None:
            return load_map(self.map, robot)
        with about(path):
            return load_map(default_map_name(human.rig, robot.name), robot)

    def given(self) -> tuple[str, ...]:
        """Names of the options that were set."""
        values = {
            "--map": self.map,
            "--height": self.height,
            "--rig": self.rig,
            "--up": self.up,
            "--unit": self.unit,
            "--body-model": self.body_model,
        }
        return tuple(option for option, value in values.items() if value is not None)


@contextmanager
def about(file: Path) -> Iterator[None]:
    """Name the motion's file in errors about how map and motion fit."""
    try:
        yield
    except MapError as error:
        raise MapError(f"{file}: {error}") from error
