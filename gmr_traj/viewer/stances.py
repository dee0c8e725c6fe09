"""Stances: when which part of which foot, or which limb, rests on the floor, where it came down, and its points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gmr_traj import colours
from gmr_traj.contacts.limbs import limb_points
from gmr_traj.contacts.schedule import LIMB
from gmr_traj.track import Track
from gmr_traj.viewer.paths import part
from gmr_traj.viewer.states import log_lane
from gmr_traj.viewer.timelines import Clock

if TYPE_CHECKING:
    import rerun as rr

POINT, ANCHOR = 0.009, 0.016  # radii [m]
IN_AIR: colours.RGB = (128, 128, 128)


@dataclass(frozen=True)
class _Footing:
    """A sole, or another support that is in stance at some time.

    Attributes:
        name: of it.
        parts: of each of its points.  # K
        points: where it would touch the floor [m].  # (T, K, 3)
    """

    name: str
    parts: tuple[str, ...]
    points: np.ndarray


def log_lanes(stream: rr.RecordingStream, track: Track, clock: Clock) -> None:
    """Log one lane for each part of each sole, and for each limb that is in stance at some time: ``/stances/<...>``.

    It is down while any of its points is.
    """
    for footing in _footings(track):
        for side in dict.fromkeys(footing.parts):
            down = np.full(track.motion.frames, -1)
            for stance in track.schedule.stances:
                if (stance.sole, stance.part) == (footing.name, side):
                    down[stance.start : stance.stop] = 0
            log_lane(
                stream,
                f"/stances/{part(footing.name)}" + ("" if side == LIMB else f"_{side}"),
                down,
                {0: "on the floor"},
                {0: colours.PARTS.get(side, IN_AIR)},
                track.motion.fps,
                clock,
            )


def log_points(stream: rr.RecordingStream, track: Track, clock: Clock) -> None:
    """Log the contact points of the soles and of limbs in stance: coloured while they rest on the floor, else grey."""
    import rerun as rr

    for footing in _footings(track):
        colour = np.empty((*footing.points.shape[:2], 3), dtype=np.uint8)
        colour[:] = IN_AIR
        for stance in track.schedule.stances:
            if stance.sole == footing.name:
                colour[stance.start : stance.stop, stance.point] = colours.PARTS.get(stance.part, IN_AIR)
        path = f"/world/{part(track.name)}/soles/{part(footing.name)}"
        stream.log(path, rr.Points3D.from_fields(radii=[POINT]), static=True)
        clock.send(stream, path, track.time, _points(list(footing.points), list(colour)))


def log_anchors(stream: rr.RecordingStream, track: Track, clock: Clock) -> None:
    """Log where the points in stance came down, as long as they are, on the floor."""
    import rerun as rr

    footings = {footing.name: footing for footing in _footings(track)}
    path, last = f"/world/{part(track.name)}/anchors", track.motion.frames
    edges = {frame for stance in track.schedule.stances for frame in (stance.start, stance.stop)}
    changes = sorted(frame for frame in {0, *edges} if frame < last)
    anchors, colour = [], []
    for frame in changes:
        standing = [stance for stance in track.schedule.stances if stance.start <= frame < stance.stop]
        came_down = [footings[s.sole].points[s.start, s.point, :2] for s in standing]
        anchors.append(np.pad(np.reshape(came_down, (-1, 2)), ((0, 0), (0, 1))))  # on the floor
        colour.append(np.reshape([colours.PARTS.get(s.part, IN_AIR) for s in standing], (-1, 3)))
    stream.log(path, rr.Points3D.from_fields(radii=[ANCHOR]), static=True)
    clock.send(stream, path, np.array(changes) / track.motion.fps, _points(anchors, colour))


def _footings(track: Track) -> list[_Footing]:
    """All soles, and the supports that are in stance at some time."""
    robot, seen = track.robot, track.observation
    out = [_Footing(sole.name, sole.parts, points) for sole, points in zip(robot.soles, seen.soles, strict=True)]
    used = {stance.sole for stance in track.schedule.stances if stance.part == LIMB}
    if used:
        centres, radii = limb_points(robot, (seen.positions, seen.rotations))
        lowest, last = centres - radii[:, None] * [0.0, 0.0, 1.0], 0
        for support in robot.supports:
            own = slice(last, last := last + len(support.points))
            if support.name in used:
                out.append(_Footing(support.name, (LIMB,) * len(support.points), lowest[:, own]))
    return out


def _points(positions: list[np.ndarray], colour: list[np.ndarray]) -> Callable[[np.ndarray], rr.ComponentColumnList]:
    """Makes the columns of some points (K, 3) with their colours (K, 3) in each row; K may differ."""
    import rerun as rr

    def columns(rows: np.ndarray) -> rr.ComponentColumnList:
        everywhere = np.concatenate([positions[row] for row in rows])
        packed = _packed(np.concatenate([colour[row] for row in rows]))
        made = rr.Points3D.columns(positions=everywhere.astype(np.float32), colors=packed)
        return made.partition([len(positions[row]) for row in rows])

    return columns


def _packed(colour: np.ndarray) -> np.ndarray:
    """Colours (N, 3) as rerun's 32-bit integers, opaque."""
    red, green, blue = colour.astype(np.uint32).T
    return (red << 24) | (green << 16) | (blue << 8) | 0xFF
