"""The arguments of `gmr-traj report`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from gmr_traj.cli.arguments import Common, named


@dataclass(frozen=True, kw_only=True)
class Report(Common):
    """Put what is known about a clip, or about a clip and its refinement, on one page of HTML.

    The page holds tables, plots with the artefacts shaded, and stills of the worst artefacts; it needs no network.
    """

    clip: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="CLIP")]
    """The clip."""

    refined: Annotated[
        tyro.conf.Positional[Path | None], tyro.conf.arg(metavar="REFINED", help_behavior_hint="(optional)")
    ] = None
    """Its refinement: the same joints, frames and rate."""

    output: Annotated[Path | None, tyro.conf.arg(aliases=("-o",)), named("HTML", "<stem>.report.html")] = None
    """File to write."""

    stills: int = 3
    """How many of the worst artefacts get a still."""

    quiet: bool = False
    """Print nothing but errors."""

    force: bool = False
    """Overwrite a file that exists."""

    def run(self) -> int:
        """Write the report."""
        from gmr_traj.cli.report import run

        return run(self)
