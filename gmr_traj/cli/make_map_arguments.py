"""Arguments of `gmr-traj make-map`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from gmr_traj.cli.arguments import Subcommand, named


@dataclass(frozen=True, kw_only=True)
class MakeMap(Subcommand):
    """Fill in the rotation offsets of a human-to-robot map, from a posture that person and robot both take.

    The draft is a map whose targets need no rotation_offset, with a table [posture] of the robot's joints in that
    posture (docs/retargeting.md explains the fields). The result is a map for `gmr-traj retarget --map`.
    """

    draft: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="DRAFT")]
    """Map without rotation offsets."""

    file: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="FILE")]
    """A human motion of the rig."""

    frame: Annotated[int | None, named("N", "zero rotations of all joints")] = None
    """Frame of the motion in which the person takes the posture; by default the rig's own posture is meant."""

    facing: Annotated[float | None, named("DEGREES", "found from the positions")] = None
    """Where the person faces in the posture: the turn about the vertical from x, to the left."""

    output: Annotated[Path | None, named("PATH", "<stem>_map.toml beside the draft")] = None
    """File to write."""

    rig: Annotated[str | None, named("NAME", "by the names of the joints")] = None
    """Whose joint names and joint frames the motion has: lafan1, xsens, cmu, smplx, smpl, deepmimic, or your own."""

    up: Annotated[Literal["y", "z"] | None, named("y|z", "decided from the motion")] = None
    """Which axis of the motion's file points up; needed where no frame is named."""

    unit: Annotated[str | None, named("m|cm|mm|in|...", "decided from the skeleton")] = None
    """Unit of length of the motion's file."""

    force: bool = False
    """Overwrite an output file that exists."""

    def run(self) -> int:
        """Make the map."""
        from gmr_traj.cli.make_map import run

        return run(self)
