"""Motions, targets and schedules at another frame rate, on a timeline that begins with their first frame."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.motion import RobotMotion
from gmr_traj.references import BodyTargets

_SAME_RATE = 1e-6  # [Hz]
_ON_FRAME = 1e-6  # of a frame; a time this close to a frame is that frame


def same_rate(first: float, second: float) -> bool:
    """Whether two frame rates [Hz] are the same."""
    return abs(first - second) <= _SAME_RATE


def frames_within(seconds: float, fps: float) -> int:
    """How many frames at ``fps`` lie within ``seconds`` from the first, both ends included."""
    return math.floor(seconds * fps + _ON_FRAME) + 1


def resample(motion: RobotMotion, fps: float) -> RobotMotion:
    """A motion at another frame rate: base position and joints linear between frames, its orientation by slerp.

    The new clip ends at or before the old one's last frame.
    """
    if same_rate(motion.fps, fps) or motion.frames == 1:
        return replace(motion, fps=fps)
    times = _times(motion.frames, motion.fps, fps)
    qpos = _linear(motion.qpos, motion.fps, times)
    qpos[:, 3:7] = _slerp(motion.qpos[:, 3:7], motion.fps, times)
    return replace(motion, qpos=qpos, fps=fps)


def resample_targets(targets: BodyTargets, fps: float, new_fps: float) -> BodyTargets:
    """Body targets of ``fps`` at another frame rate, positions linear, orientations by slerp."""
    if same_rate(fps, new_fps) or targets.frames == 1:
        return targets
    times = _times(targets.frames, fps, new_fps)
    turns = [_slerp(targets.quaternions[:, b], fps, times) for b in range(len(targets.names))]
    return replace(targets, positions=_linear(targets.positions, fps, times), quaternions=np.stack(turns, axis=1))


def resample_schedule(schedule: ContactSchedule, fps: float, frames: int) -> ContactSchedule:
    """A schedule at another frame rate and length: the frames whose times are within each stance."""
    stances = []
    for stance in schedule.stances:
        start = math.ceil(stance.start / schedule.fps * fps - _ON_FRAME)
        stop = frames_within((stance.stop - 1) / schedule.fps, fps)
        if start < min(stop, frames):
            stances.append(replace(stance, start=start, stop=min(stop, frames)))
    return replace(schedule, frames=frames, fps=fps, stances=tuple(stances))


def _times(frames: int, fps: float, new_fps: float) -> np.ndarray:
    """Times of the new frames [s], within the old ones."""
    last = (frames - 1) / fps
    return np.minimum(np.arange(frames_within(last, new_fps)) / new_fps, last)


def _linear(values: np.ndarray, fps: float, times: np.ndarray) -> np.ndarray:
    """Values (T, ...) interpolated at ``times`` [s]."""
    at = times * fps
    first = np.minimum(at.astype(int), len(values) - 2)
    share = (at - first).reshape(-1, *([1] * (values.ndim - 1)))
    return (1.0 - share) * values[first] + share * values[first + 1]


def _slerp(quaternions: np.ndarray, fps: float, times: np.ndarray) -> np.ndarray:
    """Quaternions wxyz (T, 4) interpolated at ``times`` [s]."""
    rotations = Rotation.from_quat(quaternions, scalar_first=True)
    return Slerp(np.arange(len(quaternions)) / fps, rotations)(times).as_quat(scalar_first=True)
