"""`gmr-traj view`: clips in the rerun viewer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.cli.outputs import check
from gmr_traj.cli.terminal import console
from gmr_traj.cli.tracks import load_tracks
from gmr_traj.contacts.source_level import source_height
from gmr_traj.exceptions import GmrTrajError
from gmr_traj.formats.human import read_human
from gmr_traj.viewer import Scene, save
from gmr_traj.viewer.window import check_screen, show, unnamed

if TYPE_CHECKING:
    from gmr_traj.cli.view_arguments import View

RECORDING = ".rrd"


def run(arguments: View) -> int:
    """Show clips, or write the recording of them.

    Raises:
        GmrTrajError: anything the user can put right; nothing was written then.
    """
    recordings = [path for path in arguments.clips if path.suffix == RECORDING]
    if recordings:
        return _show_recording(recordings, arguments)
    if arguments.output is None:
        check_screen()
    else:
        check_recording(arguments.output, arguments.clips, arguments.force)
    shown = load_tracks(arguments.clips, arguments, level=not arguments.as_is)
    longest = max(track.motion.duration for track in shown.tracks)
    if arguments.time is not None and not 0.0 <= arguments.time <= longest:
        raise GmrTrajError(f"--time {arguments.time:g}: the clips last {longest:.2f} s; give a time within them")
    first, targets = shown.tracks[0], shown.clips[0].references
    if targets is not None and not arguments.as_is:
        schedule = replace(first.schedule, height=first.raised)
        targets = targets.raised(source_height(targets, first.robot, schedule))
    scene = Scene(
        title=" and ".join(track.name for track in shown.tracks),
        tracks=shown.tracks,
        certificate=shown.certificate,
        human=None if arguments.source is None else read_human(arguments.source),
        targets=targets,
        focus=arguments.time,
    )
    target = unnamed() if arguments.output is None else arguments.output
    save(scene, target, meshes=not arguments.no_meshes)
    screen = console()
    for track in shown.tracks:
        if abs(track.raised) > 5e-4:
            line = f"{track.name}: moved by {1e3 * track.raised:+.0f} mm to stand on the floor (not with --as-is)"
            screen.print(line, markup=False)
    if shown.apart:
        screen.print(f"no certificate: {shown.apart}", markup=False, soft_wrap=True)
    if arguments.output is None:
        show(target)
    screen.print(f"written: {target}", markup=False, soft_wrap=True)
    return ExitCode.OK


def check_recording(path: Path, inputs: tuple[Path, ...], force: bool) -> None:
    """Refuse a recording's name that would destroy something, or that the viewer would not know.

    Raises:
        GmrTrajError: it does not end in .rrd, or see :func:`gmr_traj.cli.outputs.check`.
    """
    if path.suffix != RECORDING:
        raise GmrTrajError(f"{path}: a recording ends in {RECORDING}, by which the viewer knows it")
    for clip in inputs:
        check(path, clip, force)


def _show_recording(recordings: list[Path], arguments: View) -> int:
    if len(arguments.clips) > 1 or arguments.output is not None or arguments.source is not None:
        raise GmrTrajError(f"{recordings[0]}: a recording is shown alone, without --output and --source")
    if not recordings[0].is_file():
        raise GmrTrajError(f"{recordings[0]}: no such file")
    check_screen()
    show(recordings[0])
    return ExitCode.OK
