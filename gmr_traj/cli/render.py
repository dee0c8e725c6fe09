"""`gmr-traj render`: stills, film strips and video without a screen."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np

from gmr_traj import atomic
from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.cli.outputs import check, staged
from gmr_traj.cli.terminal import console, progress
from gmr_traj.cli.tracks import load_tracks
from gmr_traj.exceptions import GmrTrajError
from gmr_traj.render import Look, to_png, video
from gmr_traj.render.stills import still, strip
from gmr_traj.track import Track

if TYPE_CHECKING:
    from gmr_traj.cli.render_arguments import Render

PICTURE, VIDEO = ".png", ".mp4"


def run(arguments: Render) -> int:
    """Draw clips.

    Raises:
        GmrTrajError: anything the user can put right; nothing was written then.
    """
    target = arguments.output
    if target.suffix not in (PICTURE, VIDEO):
        raise GmrTrajError(f"{target}: pictures end in {PICTURE}, video in {VIDEO}")
    for clip in arguments.clips:
        check(target, clip, arguments.force)
    look = _look(arguments)
    if target.suffix == VIDEO:
        video.check_encoder()
    for name in ("speed", "rate"):
        if not getattr(arguments, name) > 0.0:
            raise GmrTrajError(f"--{name} {getattr(arguments, name):g}: give a number above 0")
    if arguments.columns < 1:
        raise GmrTrajError(f"--columns {arguments.columns}: give at least 1")
    tracks = load_tracks(arguments.clips, arguments, level=not arguments.as_is).tracks
    begin, end = _range(tracks, arguments)
    if target.suffix == VIDEO:
        with staged(target) as path, progress(not arguments.quiet) as callback:
            count = video.write(
                tracks, path, (begin, end), look, rate=arguments.rate, speed=arguments.speed, progress=callback
            )
            os.replace(path, target)
        said = f"{count} pictures, {count / arguments.rate:.1f} s"
    else:
        columns = 1 if end == begin else arguments.columns
        # The pictures are of the first frame, the last one, and of what is evenly between them.
        times = np.linspace(begin, end, columns).tolist()
        page = still(tracks, begin, look) if columns == 1 else strip(tracks, times, look)
        with atomic.write(target) as stream:
            stream.write(to_png(page))
        said = f"{page.width} x {page.height} pixels, from {begin:.2f} s" + (f" to {end:.2f} s" if end > begin else "")
    if not arguments.quiet:
        console().print(f"written: {target} ({said})", markup=False, soft_wrap=True)
    return ExitCode.OK


def _look(arguments: Render) -> Look:
    strip_wanted = arguments.to is not None and arguments.output.suffix == PICTURE
    width, height = arguments.size or ((320, 380) if strip_wanted else (480, 560))
    return Look(width, height, arguments.azimuth, arguments.elevation, arguments.distance, meshes=not arguments.shapes)


def _range(tracks: tuple[Track, ...], arguments: Render) -> tuple[float, float]:
    """Begin and end of what is drawn [s]; the same for a still.

    Raises:
        GmrTrajError: it is not within every clip, or ends before it begins.
    """
    shortest = min(tracks, key=lambda track: track.motion.duration)
    last = (shortest.motion.frames - 1) / shortest.motion.fps
    moving = arguments.output.suffix == VIDEO
    begin, end = arguments.time, arguments.to
    if begin is None and end is None and not moving:
        worst = tracks[0].worst()
        begin = 0.0 if worst is None else min(last, worst.peak / tracks[0].motion.fps)
    begin = 0.0 if begin is None else begin
    if end is None:
        end = shortest.motion.duration if moving else begin
    elif not moving:
        end = min(end, last) if end <= shortest.motion.duration else end
    for option, value in (("--time", begin), ("--to", end)):
        if not 0.0 <= value <= shortest.motion.duration:
            raise GmrTrajError(
                f"{option} {value:g}: {shortest.name} lasts {shortest.motion.duration:.2f} s; give a time within it"
            )
    if end < begin or (moving and end == begin):
        raise GmrTrajError(f"--to {end:g}: the range begins at {begin:g} s; let it end later")
    return begin, end
