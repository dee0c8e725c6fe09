"""Recordings of a batch's clips, made when it is known which are wanted."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from gmr_traj.batch.publish import RECORDING
from gmr_traj.batch.records import Record, output_path, read_whole
from gmr_traj.batch.work import Result
from gmr_traj.cli import recordings
from gmr_traj.cli.batch_work import ClipWork
from gmr_traj.cli.human_input import start
from gmr_traj.cli.refine import read_back
from gmr_traj.cli.refine_arguments import Refine
from gmr_traj.contacts import schedule_json
from gmr_traj.exceptions import BatchError


@dataclass(frozen=True, kw_only=True)
class Recording(ClipWork):
    """The recording of one clip, before and after where it was refined.

    Attributes:
        refined: the refined clip; None where there is none.
        contacts: the schedule it was planted by, as JSON; None where there is none.
    """

    refined: Path | None = None
    contacts: str | None = None

    def carry_out(self, folder: Path) -> Result:
        """Write the recording.

        Raises:
            GmrTrajError: a clip cannot be read.
        """
        file = self.name + RECORDING
        begun = start(self.refine)
        if self.refined is not None and self.contacts is not None:
            begun, _, _ = self.extended(begun)
            motion = begun.clip.motion
            schedule = schedule_json.from_json(self.contacts, begun.robot, frames=motion.frames, fps=motion.fps)
            written = read_back(self.refined, begun, schedule, self.refine.format)
            recordings.write(folder / file, begun, written.clip, schedule, written.certificate)
        else:
            recordings.write_one(folder / file, begun)
        return Result({}, {"recording": file})


def wanted(rerun: str | None) -> int | None:
    """How many of the worst clips to record; None for all.

    Raises:
        BatchError: it is neither ``all`` nor ``worst:N``.
    """
    if rerun is None:
        return 0
    if rerun == "all":
        return None
    kind, _, count = rerun.partition(":")
    if kind != "worst" or not count.isdecimal() or int(count) < 1:
        raise BatchError(f"--rerun is {rerun!r}; expected worst:10, say, or all")
    return int(count)


def recording(name: str, record: Record, refine: Refine, out: Path, versions: Mapping[str, str]) -> Recording:
    """What records the clip of a record."""
    refined, contacts = None, None
    if "certificate" in record:
        refined = output_path(out, name, record["outputs"]["clip"]["file"])
        contacts = json.dumps(read_whole(out, name)["contacts"])
    return Recording(name=Path(name).name, refine=refine, versions=versions, refined=refined, contacts=contacts)
