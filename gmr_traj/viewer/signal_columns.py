"""The signals of the clips as curves, and every joint's speed and angle beside its limits."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from gmr_traj import colours
from gmr_traj.metrics import joints
from gmr_traj.metrics.signals import sole_heights
from gmr_traj.track import Track
from gmr_traj.viewer.paths import part
from gmr_traj.viewer.scene import Scene
from gmr_traj.viewer.timelines import Clock

if TYPE_CHECKING:
    import rerun as rr

WIDTH, THIN = 1.8, 1.0  # of a curve, of a limit [points]


def log(stream: rr.RecordingStream, scene: Scene, clock: Clock) -> None:
    """Log the signals under ``/signals/<signal>/<track>``, joints under ``/joints/<joint>/<quantity>/<track>``.

    Feet one by one are under ``/signals/foot_height/<sole>/<track>``.
    """
    for track in scene.tracks:
        colour = scene.colour(track)
        for signal in track.signals:
            path = f"/signals/{signal.name}/{part(track.name)}"
            curve(stream, path, track.time, signal.values, clock, track.name, colour)
        heights = 1e3 * sole_heights(track.observation) if track.robot.soles else np.zeros((track.motion.frames, 0))
        for sole, values in zip(track.robot.soles, heights.T, strict=True):
            path = f"/signals/foot_height/{part(sole.name)}/{part(track.name)}"
            curve(stream, path, track.time, values, clock, f"{track.name} {sole.name}", colour)
        _log_joints(stream, scene, track, clock)
    for signal in scene.tracks[0].signals:
        if signal.bar is not None:
            _line(stream, f"/signals/{signal.name}/limit", scene, clock, signal.bar, "limit")


def curve(
    stream: rr.RecordingStream,
    path: str,
    seconds: np.ndarray,
    values: np.ndarray,
    clock: Clock,
    name: str,
    colour: colours.RGB,
    width: float = WIDTH,
) -> None:
    """Log one curve: its values by time, its name, colour and width once."""
    import rerun as rr

    stream.log(path, rr.SeriesLines(colors=[colour], names=[name], widths=[width]), static=True)
    clock.send(stream, path, seconds, lambda rows: rr.Scalars.columns(scalars=values[rows]))


def _log_joints(stream: rr.RecordingStream, scene: Scene, track: Track, clock: Clock) -> None:
    velocities = np.full((track.motion.frames, track.robot.dof), np.nan)
    velocities[1:] = joints.velocities(track.motion)
    first = scene.tracks.index(track) == 0
    robot, colour = track.robot, scene.colour(track)
    for j, joint in enumerate(robot.joint_names):
        for quantity, values, lower, upper in (
            ("velocity", velocities[:, j], -robot.velocity_limit[j], robot.velocity_limit[j]),
            ("angle", track.motion.qpos[:, 7 + j], robot.position_lower[j], robot.position_upper[j]),
        ):
            path = f"/joints/{part(joint)}/{quantity}"
            curve(stream, f"{path}/{part(track.name)}", track.time, values, clock, track.name, colour)
            if first:
                _line(stream, f"{path}/lower_limit", scene, clock, lower, "limit")
                _line(stream, f"{path}/upper_limit", scene, clock, upper, "limit")


def _line(stream: rr.RecordingStream, path: str, scene: Scene, clock: Clock, value: float, name: str) -> None:
    """A constant from the beginning of the recording to its end."""
    ends = np.unique([0.0, *(clock.window or ()), scene.seconds])
    curve(stream, path, ends, np.full(len(ends), value), clock, name, colours.LIMIT, THIN)
