"""The arguments of `gmr-traj view`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from gmr_traj.cli.arguments import Common, named
from gmr_traj.exceptions import GmrTrajError


@dataclass(frozen=True, kw_only=True)
class View(Common):
    """Look at clips in the rerun viewer: side by side and in one place, with what is wrong with them.

    The first clip is seen through, so that the others show.  Clips of different length or rate run on one clock.  With
    --output the recording is written instead of shown; given one .rrd file, that is shown.
    """

    clips: Annotated[
        tyro.conf.Positional[tuple[Path, ...]],
        tyro.conf.arg(metavar="CLIP|RRD...", help_behavior_hint="(at least one)"),
    ]
    """Clips of one robot, or one recording."""

    source: Annotated[Path | None, named("FILE", "not shown")] = None
    """Human motion that the first clip came from (BVH, SMPL-X, ...)."""

    output: Annotated[Path | None, tyro.conf.arg(aliases=("-o",)), named("RRD", "shown in a window")] = None
    """Recording to write instead of opening a window."""

    time: Annotated[float | None, named("SECONDS", "the worst artefact")] = None
    """Time the recording opens at."""

    as_is: bool = False
    """Leave the clips at their height; otherwise each is raised or lowered, as a whole, to stand on the floor."""

    no_meshes: bool = False
    """Show collision shapes only; link meshes (of the extra `meshes`) make a recording 11 MB larger."""

    force: bool = False
    """Overwrite a recording that exists."""

    def run(self) -> int:
        """Show the clips."""
        if not self.clips:
            raise GmrTrajError("view needs at least one clip, or one recording (.rrd)")
        from gmr_traj.cli.view import run

        return run(self)
