"""Which files `gmr-traj refine` writes, decided and refused before any work is done."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from gmr_traj.exceptions import GmrTrajError
from gmr_traj.formats.clip import SUFFIXES


@dataclass(frozen=True)
class Outputs:
    """Files of one refinement.

    Attributes:
        clip: the refined clip.
        contacts: the schedule that was used, where it is asked for.
    """

    clip: Path
    contacts: Path | None = None

    @property
    def unconverged(self) -> Path:
        """Where the solver's last iterate goes when it did not converge: never under the clip's own name."""
        return self.clip.with_name(f"{self.clip.stem}.unconverged{self.clip.suffix}")

    def report(self, clip: Path) -> Path:
        """The report beside a written clip."""
        return clip.with_name(f"{clip.name}.report.json")


def plan(clip: Path, output: Path | None, file_format: str | None, contacts: Path | None, force: bool) -> Outputs:
    """Choose the names, and refuse those that would destroy something.

    Args:
        clip: the input.
        output: what the user asked for; ``<stem>_refined<suffix>`` beside the input otherwise.
        file_format: format to write, which decides the default suffix; None for the input's.
        contacts: where the schedule is to be written.
        force: existing files may be replaced (never the input).

    Raises:
        GmrTrajError: an output is the input, a folder, exists without ``force``, or lies in no folder.
    """
    suffix = SUFFIXES[file_format] if file_format else clip.suffix
    outputs = Outputs(output or clip.with_name(f"{clip.stem}_refined{suffix}"), contacts)
    for path in (outputs.clip, outputs.report(outputs.clip), outputs.contacts):
        if path is not None:
            check(path, clip, force)
    return outputs


def check(path: Path, clip: Path, force: bool, option: str = "--output") -> None:
    """Refuse an output that would destroy something or cannot be written.

    Args:
        path: the output.
        clip: the input.
        force: an existing file may be replaced (never the input).
        option: that names the output.

    Raises:
        GmrTrajError: it is the input, a folder, exists without ``force``, or lies in no folder.
    """
    if path.exists() and clip.exists() and path.samefile(clip):
        raise GmrTrajError(f"{path}: this is the input, which is never overwritten; name another file with {option}")
    if path.is_dir():
        raise GmrTrajError(f"{path}: this is a folder; name a file in it")
    if not path.parent.is_dir():
        raise GmrTrajError(f"{path}: there is no folder {path.parent}; create it first")
    if path.exists() and not force:
        raise GmrTrajError(f"{path}: this file exists; name another with {option}, or overwrite it with --force")


@contextmanager
def staged(target: Path) -> Iterator[Path]:
    """A temporary path with the name of ``target``, in a hidden folder beside it that is gone after the block.

    The name is the same because a format may hold it (PHC's does).

    Move the file away with ``os.replace`` inside the block to keep it.
    """
    with TemporaryDirectory(dir=target.parent, prefix=f".{target.stem}.") as folder:
        yield Path(folder) / target.name


def publish(staged_clip: Path, clip: Path, report: Path, report_text: str) -> None:
    """Put a clip and its report in place: the report first, so that no clip is ever without its mark."""
    from gmr_traj.atomic import write

    with write(report) as stream:
        stream.write(report_text.encode())
    os.replace(staged_clip, clip)
