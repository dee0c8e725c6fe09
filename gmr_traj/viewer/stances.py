"""Stances: when which part of which foot rests on the floor, where it came down, and its contact points."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from gmr_traj import colours
from gmr_traj.robot import Sole
from gmr_traj.track import Track
from gmr_traj.viewer.paths import part
from gmr_traj.viewer.states import log_lane
from gmr_traj.viewer.timelines import Clock

if TYPE_CHECKING:
    import rerun as rr

POINT, ANCHOR = 0.009, 0.016  # radii [m]
IN_AIR: colours.RGB = (128, 128, 128)


def log_lanes(stream: rr.RecordingStream, track: Track, clock: Clock) -> None:
    """Log one lane for each part of each sole, ``/stances/<sole> <part>``: down while any of its points is."""
    for sole in track.robot.soles:
        for side in dict.fromkeys(sole.parts):
            down = np.full(track.motion.frames, -1)
            for stance in track.schedule.stances:
                if (stance.sole, stance.part) == (sole.name, side):
                    down[stance.start : stance.stop] = 0
            log_lane(
                stream,
                f"/stances/{part(sole.name)}_{side}",
                down,
                {0: "on the floor"},
                {0: colours.PARTS.get(side, IN_AIR)},
                track.motion.fps,
                clock,
            )


def log_points(stream: rr.RecordingStream, track: Track, clock: Clock) -> None:
    """Log the contact points of the soles: green while they rest on the floor, grey in the air."""
    import rerun as rr

    for sole, points in zip(track.robot.soles, track.observation.soles, strict=True):
        colour = np.empty((*points.shape[:2], 3), dtype=np.uint8)
        colour[:] = IN_AIR
        for stance in track.schedule.stances:
            if stance.sole == sole.name:
                colour[stance.start : stance.stop, stance.point] = _colour(sole, stance.point)
        path = f"/world/{part(track.name)}/soles/{part(sole.name)}"
        stream.log(path, rr.Points3D.from_fields(radii=[POINT]), static=True)
        clock.send(stream, path, track.time, _points(list(points), list(colour)))


def log_anchors(stream: rr.RecordingStream, track: Track, clock: Clock) -> None:
    """Log where the points in stance came down, as long as they are, on the floor."""
    import rerun as rr

    soles = {sole.name: place for place, sole in enumerate(track.robot.soles)}
    path, last = f"/world/{part(track.name)}/anchors", track.motion.frames
    edges = {frame for stance in track.schedule.stances for frame in (stance.start, stance.stop)}
    changes = sorted(frame for frame in {0, *edges} if frame < last)
    anchors, colour = [], []
    for frame in changes:
        standing = [stance for stance in track.schedule.stances if stance.start <= frame < stance.stop]
        came_down = [track.observation.soles[soles[s.sole]][s.start, s.point, :2] for s in standing]
        anchors.append(np.pad(np.reshape(came_down, (-1, 2)), ((0, 0), (0, 1))))  # on the floor
        colour.append(np.reshape([_colour(track.robot.soles[soles[s.sole]], s.point) for s in standing], (-1, 3)))
    stream.log(path, rr.Points3D.from_fields(radii=[ANCHOR]), static=True)
    clock.send(stream, path, np.array(changes) / track.motion.fps, _points(anchors, colour))


def _points(positions: list[np.ndarray], colour: list[np.ndarray]) -> Callable[[np.ndarray], rr.ComponentColumnList]:
    """Makes the columns of some points (K, 3) with their colours (K, 3) in each row; K may differ."""
    import rerun as rr

    def columns(rows: np.ndarray) -> rr.ComponentColumnList:
        everywhere = np.concatenate([positions[row] for row in rows])
        packed = _packed(np.concatenate([colour[row] for row in rows]))
        made = rr.Points3D.columns(positions=everywhere.astype(np.float32), colors=packed)
        return made.partition([len(positions[row]) for row in rows])

    return columns


def _colour(sole: Sole, point: int) -> colours.RGB:
    return colours.PARTS.get(sole.parts[point], IN_AIR)


def _packed(colour: np.ndarray) -> np.ndarray:
    """Colours (N, 3) as rerun's 32-bit integers, opaque."""
    red, green, blue = colour.astype(np.uint32).T
    return (red << 24) | (green << 16) | (blue << 8) | 0xFF
