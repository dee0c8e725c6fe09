"""The recording that `gmr-traj refine` leaves: the clip before and after."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from gmr_traj.cli.human_input import Start
from gmr_traj.cli.terminal import console
from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.formats import Clip
from gmr_traj.metrics import Certificate

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


def write(
    path: Path,
    begun: Start,
    refined: Clip,
    schedule: ContactSchedule,
    certificate: Certificate,
    trace: Mapping[str, tuple[float, ...]] | None = None,
) -> None:
    """Write the input, raised to the floor, and the refined clip as it was written.

    Args:
        path: the recording.
        begun: the input, with the person it comes from where known.
        refined: the refined clip as it was written, its targets on the floor.
        schedule: the stances it was planted by.
        certificate: of the refinement.
        trace: Ipopt's figures by iteration, where they are known.
    """
    from gmr_traj.track import track
    from gmr_traj.viewer import Scene, save

    tracks = (
        track("raw", begun.clip.motion, begun.robot, schedule),
        track("refined", refined.motion, begun.robot, replace(schedule, height=0.0)),
    )
    scene = Scene(
        title=path.stem,
        tracks=tracks,
        certificate=certificate,
        trace=trace or {},
        human=begun.human,
        targets=refined.references,
    )
    save(scene, path)


def write_one(path: Path, begun: Start) -> None:
    """Write a clip that was not refined, raised to the floor, with the person it comes from where known."""
    from gmr_traj.track import track
    from gmr_traj.viewer import Scene, save

    clip = begun.clip
    raw = track("raw", clip.motion, begun.robot, clip.schedule)
    targets = None if clip.references is None else clip.references.raised(raw.raised)
    save(Scene(title=path.stem, tracks=(raw,), human=begun.human, targets=targets), path)


def announce(path: Path, arguments: Refine) -> None:
    """Say where the recording is, and show it where that is wanted."""
    if arguments.view:
        from gmr_traj.viewer.window import show

        show(path)
    if not (arguments.quiet or arguments.json):
        console().print(f"recording: {path}", markup=False, soft_wrap=True)
