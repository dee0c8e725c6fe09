"""Stills of clips at given times."""

from __future__ import annotations

from collections.abc import Sequence

from PIL import Image

from gmr_traj import colours
from gmr_traj.render.look import Look, heading
from gmr_traj.render.painter import Painter
from gmr_traj.render.sheet import Row, sheet, side_by_side
from gmr_traj.track import Track


def rows(tracks: Sequence[Track], times: Sequence[float], look: Look) -> list[Row]:
    """The clips at the same times, one row a clip; the camera follows each robot and keeps its direction.

    Args:
        tracks: the clips.
        times: from the clips' start [s].
        look: size and camera.

    Raises:
        DrawingError: there is no driver to draw with.
    """
    found = []
    for place, track in enumerate(tracks):
        frames = [track.frame(time) for time in times]
        turned = heading(tracks[0], tracks[0].frame(times[0]))
        with Painter(track, look) as painter:
            pictures = [painter.draw(frame, track.motion.qpos[frame, :2], turned) for frame in frames]
        found.append(Row(track.name, colours.role(track.name, place), pictures))
    return found


def still(tracks: Sequence[Track], time: float, look: Look) -> Image.Image:
    """The clips beside each other at one time."""
    return side_by_side(rows(tracks, [time], look), f"{time:.2f} s")


def strip(tracks: Sequence[Track], times: Sequence[float], look: Look) -> Image.Image:
    """A film strip: clips below each other, times from left to right."""
    return sheet(rows(tracks, times, look), [f"{time:.2f} s" for time in times])
