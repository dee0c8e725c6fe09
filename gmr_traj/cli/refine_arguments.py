"""Arguments of `gmr-traj refine`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from gmr_traj.cli.arguments import FORMAT, Common, Format, named
from gmr_traj.cli.human_options import METHOD, HumanOptions, Method


@dataclass(frozen=True, kw_only=True)
class RefineOptions(HumanOptions, Common):
    """What refining a clip depends on beside the clip; `gmr-traj batch` has the same options."""

    method: Annotated[Method, METHOD] = "gmr"
    """How a human motion is retargeted before it is refined."""

    format: Annotated[Format | None, FORMAT] = None
    """Format of the output; the input's where it is not given, gmr-traj for a human motion."""

    problem: Annotated[str, named("NAME|PATH")] = "refine"
    """Problem: one that ships with gmr-traj, or the path of a problem file."""

    window: Annotated[float | None, named("SECONDS", "the whole clip at once")] = None
    """Solve in windows of this length."""

    overlap: Annotated[float | None, named("SECONDS", "a quarter of the window")] = None
    """How far neighbouring windows overlap."""

    lead_in: Annotated[float | None, named("SECONDS", "none")] = None
    """Put frames before the clip that lead into it from the robot's default standing posture."""

    lead_out: Annotated[float | None, named("SECONDS", "none")] = None
    """Put frames after the clip that lead out of it, back to standing."""


@dataclass(frozen=True, kw_only=True)
class Refine(RefineOptions):
    """Refine a clip: one trajectory optimisation over all of its frames. A human motion is retargeted first.

    Writes the refined clip and, beside it, <output>.report.json with the certificate, the solver's report and the
    contact schedule.  The input is never overwritten.
    """

    clip: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="CLIP")]
    """Clip to refine: a robot's, or a human motion (BVH, SMPL or SMPL-X npz, DeepMimic txt, npz of joints)."""

    source: Annotated[Path | None, named("FILE", "what the clip brings along")] = None
    """Human motion that the clip is a retarget of: its bodies are followed, and its feet say where contacts are."""

    output: Annotated[Path | None, named("PATH", "<stem>_refined<suffix> beside the input")] = None
    """File to write."""

    contacts: Annotated[Path | None, named("JSON", "the clip's own, else detected")] = None
    """Contact schedule to use."""

    save_contacts: Annotated[Path | None, named("JSON", "not written")] = None
    """Write the contact schedule that was used, to edit it and pass it back with --contacts."""

    rerun: Annotated[Path | None, named("RRD", "not written")] = None
    """Write a recording of the clip before and after, for the rerun viewer."""

    view: bool = False
    """Open the viewer with that recording when it is done."""

    json: bool = False
    """Print the report as JSON on standard output instead of tables."""

    quiet: bool = False
    """Print nothing but errors."""

    force: bool = False
    """Overwrite output files that exist."""

    def run(self) -> int:
        """Refine the clip."""
        from gmr_traj.cli.refine import run

        return run(self)
