"""`gmr-traj report`: one page of HTML about a clip and its refinement."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from gmr_traj import atomic
from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.cli.outputs import check
from gmr_traj.cli.terminal import console
from gmr_traj.cli.tracks import load_tracks
from gmr_traj.exceptions import ClipError, DrawingError, GmrTrajError
from gmr_traj.metrics import Artefact
from gmr_traj.render import Look, to_png
from gmr_traj.render.stills import still
from gmr_traj.report import Illustration, page
from gmr_traj.track import Track

if TYPE_CHECKING:
    from gmr_traj.cli.report_arguments import Report

LOOK = Look(320, 380)


def run(arguments: Report) -> int:
    """Write the report.

    Raises:
        GmrTrajError: anything the user can put right; nothing was written then.
    """
    paths = [arguments.clip] if arguments.refined is None else [arguments.clip, arguments.refined]
    target = arguments.output or paths[-1].with_name(f"{paths[-1].stem}.report.html")
    for path in paths:
        check(target, path, arguments.force)
    if arguments.stills < 0:
        raise GmrTrajError(f"--stills {arguments.stills}: give 0 or more")
    shown = load_tracks(paths, arguments)
    if shown.apart:
        raise ClipError(
            f"a report holds two clips against each other frame by frame, but {shown.apart}; report them one by one, "
            "or look at them with gmr-traj view"
        )
    notes = [note for clip in shown.clips for note in clip.notes]
    try:
        illustrations = _illustrations(shown.tracks, arguments.stills)
    except DrawingError as error:  # the numbers are worth having without the pictures
        illustrations = []
        notes.append(f"No stills: {error}")
    with atomic.write(target) as stream:
        text = page(_title(paths), shown.tracks, shown.certificate, illustrations, list(dict.fromkeys(notes)))
        stream.write(text.encode("utf-8"))
    if not arguments.quiet:
        screen = console()
        for note in notes:
            screen.print(f"note: {note}", markup=False, soft_wrap=True)
        screen.print(f"written: {target}", markup=False, soft_wrap=True)
    return ExitCode.OK


def _title(paths: list[Path]) -> str:
    return paths[0].name if len(paths) == 1 else f"{paths[0].name} and {paths[1].name}"


def _illustrations(tracks: tuple[Track, ...], count: int) -> list[Illustration]:
    """Stills of the worst artefacts of the first clip, those at the same place and time but once."""
    chosen: list[Artefact] = []
    for artefact in tracks[0].artefacts:
        again = any(abs(artefact.peak - other.peak) < 0.5 * tracks[0].motion.fps for other in chosen)
        if len(chosen) < count and artefact.kind != "height" and not again:
            chosen.append(artefact)
    fps = tracks[0].motion.fps
    return [Illustration(artefact, to_png(still(tracks, artefact.peak / fps, LOOK))) for artefact in chosen]
