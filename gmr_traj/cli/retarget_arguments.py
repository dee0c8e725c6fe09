"""Arguments of `gmr-traj retarget`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, get_args

import tyro

from gmr_traj.cli.arguments import FORMAT, Format, Subcommand, named

Method = Literal["gmr", "gmr-code", "phc", "phc-paper", "phc-adam", "protomotions", "protomotions-paper"]
METHOD = tyro.conf.arg(metavar="METHOD", help_behavior_hint=f"({', '.join(get_args(Method))}; default: gmr)")


@dataclass(frozen=True, kw_only=True)
class Retarget(Subcommand):
    """Retarget a human motion to a robot, frame by frame (GMR's two-stage inverse kinematics).

    Writes the robot's clip together with the scaled human targets it followed; refine it with `gmr-traj refine`.
    """

    file: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="FILE")]
    """Human motion: BVH, SMPL or SMPL-X npz, DeepMimic txt, or an npz of joint placements."""

    map: Annotated[str | None, named("NAME|PATH", "the one that ships for the motion's rig and the robot")] = None
    """Which human joint tells which body of the robot: a map that ships with gmr-traj, or the path of a file."""

    method: Annotated[Method, METHOD] = "gmr"
    """gmr as its paper says, gmr-code as its published code does; phc and protomotions, in variants, to compare."""

    height: Annotated[float | None, named("M", "measured on the skeleton")] = None
    """How tall the person is [m]."""

    output: Annotated[Path | None, named("PATH", "<stem>_retargeted<suffix> beside the input")] = None
    """File to write."""

    format: Annotated[Format, FORMAT] = "gmr-traj"
    """Format of the output; all but gmr-traj leave the scaled human targets out."""

    rig: Annotated[str | None, named("NAME", "by the names of the joints")] = None
    """Whose joint names and joint frames the motion has: lafan1, xsens, cmu, smplx, smpl, deepmimic, or your own."""

    fps: Annotated[float | None, named("HZ", "what the file says")] = None
    """Frames per second of the motion."""

    up: Annotated[Literal["y", "z"] | None, named("y|z", "decided from the motion")] = None
    """Which axis of the file points up."""

    unit: Annotated[str | None, named("m|cm|mm|in|...", "decided from the skeleton")] = None
    """Unit of length of the file."""

    body_model: Annotated[Path | None, named("PATH", "a mean skeleton")] = None
    """SMPL or SMPL-X model file, for the joint positions of motions that come without."""

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
