"""Arguments of `gmr-traj compare`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from gmr_traj.cli.arguments import Common, named
from gmr_traj.exceptions import GmrTrajError


@dataclass(frozen=True, kw_only=True)
class Compare(Common):
    """Compare retargets of one motion in a table of quality figures, the best of each row marked. Changes nothing.

    All clips are judged over the same stances and the same seconds. Formats, frame rates and lengths may differ, and so
    may the joints (29 or 23 of the G1).
    """

    clips: Annotated[
        tyro.conf.Positional[tuple[Path, ...]],
        tyro.conf.arg(metavar="CLIP...", help_behavior_hint="(at least one)"),
    ]
    """Robot clips that begin at the same moment of the same motion."""

    names: Annotated[tuple[str, ...], named("NAME...", "the files' names")] = ()
    """What to call the clips in the table, one name each."""

    source: Annotated[Path | None, named("FILE", "targets and contacts that a clip's file carries")] = None
    """Human motion the clips are retargets of: says where feet are in contact and where bodies should be."""

    map: Annotated[str | None, named("NAME|PATH", "the one for the source's skeleton and the robot")] = None
    """Body map that scales the source to the robot."""

    seconds: Annotated[tuple[float, float] | None, named("FROM TO", "what all clips have")] = None
    """Stretch of every clip, and of the source, to compare [s]."""

    verify: bool = False
    """Audit the clips' dynamics and let a simulated robot follow each (some 3 s of computing a second and clip)."""

    policy: Annotated[Path | None, named("FILE.onnx", "model-predictive control")] = None
    """With --verify: the trained tracker that follows the clips."""

    conditions: str = "sim"
    """With --verify: the simulation to follow them in: sim, sim-dr, sim2sim, or a file of your own."""

    seed: int = 0
    """With --verify: of everything random, the same for all clips."""

    json: bool = False
    """Print the comparison as JSON on standard output instead of a table."""

    markdown: Annotated[Path | None, named("PATH|-", "not written")] = None
    """Write the table as Markdown; `-` prints it instead of the table."""

    force: bool = False
    """Overwrite the Markdown file if it exists."""

    def run(self) -> int:
        """Compare the clips."""
        if not self.clips:
            raise GmrTrajError("compare needs at least one clip")
        from gmr_traj.cli.compare import run

        return run(self)
