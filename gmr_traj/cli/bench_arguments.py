"""Arguments of `gmr-traj bench`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from gmr_traj.cli.arguments import named
from gmr_traj.cli.refine_arguments import RefineOptions

Measure = Literal["gmr-loop", "gmr-loop-lean", "retarget", "refine", "end-to-end"]
Engine = Literal["band", "ipopt"]

#: Lengths of --growth [frames].
GROWTH = (150, 600, 2400, 7800)


@dataclass(frozen=True, kw_only=True)
class Bench(RefineOptions):
    """Measure what retargeting and refining take, beside GMR's frame-by-frame loop, and how it grows with the length.

    Each figure is the median of several processes, one after the other, in each of which the same is done twice: frames
    a second are of the second time, the first and all loading before it are start-up. Nothing is kept of the results.
    """

    clip: Annotated[
        tyro.conf.Positional[Path | None],
        tyro.conf.arg(metavar="[CLIP]", help_behavior_hint="(default: the kick that ships with gmr-traj)"),
    ] = None
    """Robot's clip (of which only refining is measured) or human motion."""

    measure: Annotated[
        tuple[Measure, ...],
        tyro.conf.arg(
            metavar="WHAT...",
            help_behavior_hint="(gmr-loop, gmr-loop-lean, retarget, refine, end-to-end; default: all but the lean one)",
        ),
    ] = ("gmr-loop", "retarget", "refine", "end-to-end")
    """gmr-loop hands joint limits to mink as GMR's code does, gmr-loop-lean so that mink makes them once."""

    engines: Annotated[
        tuple[Engine, ...],
        tyro.conf.arg(metavar="ENGINE...", help_behavior_hint="(band, ipopt; default: all that the problem names)"),
    ] = ()
    """Engines to refine with, each with the problem's attempts for it alone; end-to-end has the problem as it is."""

    repeats: Annotated[int, named("N")] = 5
    """Processes for each figure."""

    growth: bool = False
    """Refine 150, 600, 2400 and 7800 frames, too: the clip, played forth and back where it is too short."""

    seconds: Annotated[tuple[float, ...], named("SECONDS...", "as --growth says")] = ()
    """Refine these lengths [s] instead of those of --growth."""

    plot: Annotated[Path | None, named("PNG", "not drawn")] = None
    """Draw frames a second, and time a frame against the length."""

    json: Annotated[Path | None, named("FILE|-", "not written")] = None
    """Write all figures as JSON; `-` prints them instead of the tables."""

    force: bool = False
    """Overwrite the plot and the JSON file if they exist."""

    quiet: bool = False
    """Print nothing but errors."""

    def run(self) -> int:
        """Run the measurements."""
        from gmr_traj.cli.bench import run

        return run(self)
