"""The recording that `gmr-traj refine` leaves: the clip before and after."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from gmr_traj.cli.human_input import Start
from gmr_traj.cli.terminal import console
from gmr_traj.formats import Clip
from gmr_traj.metrics import Certificate
from gmr_traj.refine import Refinement

if TYPE_CHECKING:
    from gmr_traj.cli.refine_arguments import Refine


def plan(arguments: Refine) -> Path | None:
    """Where the recording goes, None where none is wanted; refused before any work is done.

    Raises:
        GmrTrajError: the file would destroy something, or there is no screen to show it on.
    """
    if arguments.rerun is None and not arguments.view:
        return None
    from gmr_traj.cli.view import check_recording
    from gmr_traj.viewer.window import check_screen, unnamed

    if arguments.view:
        check_screen()
    if arguments.rerun is None:
        return unnamed()
    check_recording(arguments.rerun, (arguments.clip,), arguments.force)
    return arguments.rerun


def write(path: Path, begun: Start, refined: Clip, refinement: Refinement, certificate: Certificate) -> None:
    """Write the input, raised to the floor, and the refined clip as it was written.

    Args:
        path: the recording.
        begun: the input, with the person it comes from where known.
        refined: the refined clip as it was written, its targets on the floor.
        refinement: what it came of.
        certificate: of the refinement.
    """
    from gmr_traj.track import track
    from gmr_traj.viewer import Scene, save

    schedule = refinement.schedule
    tracks = (
        track("raw", begun.clip.motion, begun.robot, schedule),
        track("refined", refined.motion, begun.robot, replace(schedule, height=0.0)),
    )
    scene = Scene(
        title=path.stem,
        tracks=tracks,
        certificate=certificate,
        trace=refinement.report.trace,
        human=begun.human,
        targets=refined.references,
    )
    save(scene, path)


def announce(path: Path, arguments: Refine) -> None:
    """Say where the recording is, and show it where that is wanted."""
    if arguments.view:
        from gmr_traj.viewer.window import show

        show(path)
    if not (arguments.quiet or arguments.json):
        console().print(f"recording: {path}", markup=False, soft_wrap=True)
