"""Arguments of `gmr-traj retarget`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from gmr_traj.cli.arguments import FORMAT, Format, Subcommand, named
from gmr_traj.cli.human_options import METHOD, HumanOptions, Method


@dataclass(frozen=True, kw_only=True)
class Retarget(HumanOptions, Subcommand):
    """Retarget a human motion to a robot, frame by frame (GMR's two-stage inverse kinematics).

    Writes the robot's clip together with the scaled human targets it followed; refine it with `gmr-traj refine`.
    """

    file: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="FILE")]
    """Human motion: BVH, SMPL or SMPL-X npz, DeepMimic txt, or an npz of joint placements."""

    method: Annotated[Method, METHOD] = "gmr"
    """gmr as its paper says, gmr-code as its published code does; phc and protomotions, in variants, to compare."""

    output: Annotated[Path | None, named("PATH", "<stem>_retargeted<suffix> beside the input")] = None
    """File to write."""

    format: Annotated[Format, FORMAT] = "gmr-traj"
    """Format of the output; all but gmr-traj leave the scaled human targets out."""

    fps: Annotated[float | None, named("HZ", "what the file says")] = None
    """Frames per second of the motion."""

    velocity_limit: Annotated[float | None, named("FACTOR", "none")] = None
    """No joint moves faster than this factor times its velocity limit, from one frame to the next."""

    json: bool = False
    """Print the report as JSON on standard output instead of text."""

    quiet: bool = False
    """Print nothing but errors."""

    force: bool = False
    """Overwrite an output file that exists."""

    def run(self) -> int:
        """Retarget the motion."""
        from gmr_traj.cli.retarget import run

        return run(self)
