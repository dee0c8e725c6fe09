"""Arguments of `gmr-traj batch`."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Literal

import tyro

from gmr_traj.cli.arguments import Common, named
from gmr_traj.cli.human_options import HumanOptions
from gmr_traj.cli.refine_arguments import Refine, RefineOptions
from gmr_traj.cli.verify_arguments import Verify
from gmr_traj.exceptions import GmrTrajError

Step = Literal["retarget", "refine", "verify"]
ORDER: tuple[Step, ...] = ("retarget", "refine", "verify")


@dataclass(frozen=True, kw_only=True)
class Batch(RefineOptions):
    """Retarget, refine and verify many clips, on all cores or on a cluster. Run it again to go on where it stopped.

    Writes into DIR, for every clip, the clip and <clip>.record.json (inputs, versions, options, certificate), or only
    the record with the reason where it failed; then summary.jsonl and totals.json. A second run does what is new,
    changed, missing or failed. Needs the extra `batch`.
    """

    inputs: Annotated[
        tyro.conf.Positional[tuple[str, ...]],
        tyro.conf.arg(metavar="FOLDER|PATTERN|FILE|@LIST...", help_behavior_hint="(at least one)"),
    ]
    """Folders (with their subfolders), quoted patterns, files, or @list.txt with one of these a line."""

    out: Annotated[Path, named("DIR")]
    """Folder to write to; the inputs' places in their folders are kept in it."""

    steps: Annotated[
        tuple[Step, ...],
        tyro.conf.arg(metavar="STEP...", help_behavior_hint="(retarget, refine, verify; default: refine)"),
    ] = ("refine",)
    """refine retargets human motion first; retarget refine keeps the retargeted clip, too; verify is of the result."""

    controller: Literal["none", "mpc", "pd"] = "none"
    """Of verify: what tracks the clip in simulation; none audits its dynamics only."""

    conditions: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME|PATH...")] = ("sim",)
    """Of verify: simulations to track it in: sim, sim-dr, sim2sim, or files of your own."""

    contacts: Annotated[Path | None, named("FOLDER", "the clips' own, else detected")] = None
    """Contact schedules to use: <clip>.json in this folder, for the clips that have one there."""

    jobs: Annotated[int | None, named("N", "by cores and memory")] = None
    """Clips to do at the same time on this machine."""

    scheduler: Annotated[str | None, named("ADDRESS", "a cluster on this machine")] = None
    """Dask scheduler to use, such as tcp://127.0.0.1:8786; its workers must see the same files."""

    dashboard: bool = False
    """Open Dask's dashboard on this machine (needs bokeh); its address is printed."""

    time_limit: Annotated[float | None, named("SECONDS", "of the settings")] = None
    """A clip is killed after this time."""

    memory_limit: Annotated[float | None, named("GB", "of the settings")] = None
    """A clip is killed when it takes more memory."""

    retries: Annotated[int | None, named("N", "of the settings")] = None
    """How often a clip is tried again whose process crashed or whose worker died."""

    settings: Annotated[str, named("NAME|PATH")] = "batch"
    """Limits and waiting times: a file of configs/, or your own."""

    retry_failed: Annotated[bool, tyro.conf.arg(help_behavior_hint="(default: they are tried again)")] = True
    """Leave clips that failed before alone where nothing has changed."""

    force: bool = False
    """Do all clips again, and overwrite files that are not a batch's."""

    rerun: Annotated[str | None, named("worst:N|all", "not written")] = None
    """Write recordings of clips before and after, for the rerun viewer: of the N that fall short most, or of all."""

    top: int = 10
    """How many clips to list at the end, what falls short most first."""

    json: bool = False
    """Print totals and all clips as JSON on standard output instead of a table."""

    quiet: bool = False
    """Print nothing but errors."""

    def run(self) -> int:
        """Run the batch."""
        if not self.inputs:
            raise GmrTrajError("batch needs at least one folder, pattern, file or @list.txt")
        from gmr_traj.cli.batch import run

        return run(self)

    def of_clip(self, clip: Path, human: bool, contacts: Path | None) -> Refine:
        """The arguments with which `gmr-traj refine` alone would do one of the clips.

        Options about human motion are for those, options about robots' clips for those: a batch may have both.
        """
        left_out = {field.name for field in fields(HumanOptions)} if not human else {"input_format", "quaternion"}
        common = {field.name: getattr(self, field.name) for field in fields(RefineOptions)}
        own = {name: value for name, value in common.items() if name not in left_out}
        return Refine(clip=clip, contacts=contacts, quiet=True, **own)

    def of_verify(self, clip: Path) -> Verify:
        """The arguments with which `gmr-traj verify` would verify one of the clips."""
        common = {field.name: getattr(self, field.name) for field in fields(Common)}
        return Verify(
            clips=(clip,), controller=self.controller, conditions=self.conditions, workers=1, json=True, **common
        )
