"""How well the feet stay where they came down."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gmr_traj.contacts.schedule import LIMB, ContactSchedule, Stance
from gmr_traj.exceptions import ScheduleError
from gmr_traj.metrics.observation import Observation


@dataclass(frozen=True)
class StanceTrack:
    """One sole point p over one stance ``[start, stop)``.

    Attributes:
        stance: the stance.
        drift: ``||p_xy[t] - p_xy[start]||`` [m].  # (stop - start,)
        speed: ``||p_xy[t+1] - p_xy[t]|| fps`` [m/s].  # (stop - start - 1,)
        height: ``p_z[t]``; in frames in which a hand, a knee or another limb is in stance, too, of the foot's lowest
            point, shapes included: there a foot stands on its tip, however steeply [m].  # (stop - start,)
    """

    stance: Stance
    drift: np.ndarray
    speed: np.ndarray
    height: np.ndarray


def stance_tracks(observation: Observation, schedule: ContactSchedule) -> tuple[StanceTrack, ...]:
    """The sole point of every stance of a foot over its frames, in the schedule's order.

    Stances of hands, knees and other limbs are not among them: what is promised and reported of stances is of feet.

    Raises:
        ScheduleError: where the schedule is for another number of frames, or a stance names a sole, a point or
            frames that are not there.
    """
    motion, robot = observation.motion, observation.robot
    if schedule.frames != motion.frames:
        raise ScheduleError(
            f"the contact schedule is for {schedule.frames} frames, the clip has {motion.frames}: detect them again"
        )
    soles = {sole.name: points for sole, points in zip(robot.soles, observation.soles, strict=True)}
    on_limbs = np.zeros(motion.frames, bool)
    for stance in (s for s in schedule.stances if s.part == LIMB):
        on_limbs[stance.start : stance.stop] = True
    tips = _lowest_of_feet(observation) if on_limbs.any() else {}
    tracks = []
    for stance in (s for s in schedule.stances if s.part != LIMB):
        points = soles.get(stance.sole)
        if points is None:
            raise ScheduleError(f"a stance names sole {stance.sole!r}; robot {robot.name} has {', '.join(soles)}")
        if not 0 <= stance.point < points.shape[1]:
            raise ScheduleError(
                f"a stance names point {stance.point} of sole {stance.sole!r}, whose last is {points.shape[1] - 1}"
            )
        if not 0 <= stance.start < stance.stop <= motion.frames:
            raise ScheduleError(
                f"a stance of sole {stance.sole!r} lasts from frame {stance.start} to {stance.stop}; "
                f"it needs 0 <= start < stop <= {motion.frames}"
            )
        span = slice(stance.start, stance.stop)
        p = points[span, stance.point]  # (N, 3)
        flat = p[:, :2]
        tracks.append(
            StanceTrack(
                stance=stance,
                drift=np.linalg.norm(flat - flat[0], axis=1),
                speed=np.linalg.norm(np.diff(flat, axis=0), axis=1) * motion.fps,
                height=np.where(on_limbs[span], tips[stance.sole][span], p[:, 2]) if tips else p[:, 2],
            )
        )
    return tuple(tracks)


def _lowest_of_feet(observation: Observation) -> dict[str, np.ndarray]:
    """Sole -> height of the lowest point that is known of its foot, shapes included [m].  # (T,)"""
    robot, out = observation.robot, {}
    for sole, *both in zip(robot.soles, observation.soles, observation.outlines, strict=True):
        shapes = observation.lowest[:, [capsule.body == sole.body for capsule in robot.capsules]]
        out[sole.name] = np.concatenate([*(points[..., 2] for points in both), shapes], axis=1).min(axis=1)
    return out


def cut_to(schedule: ContactSchedule, frames: int) -> ContactSchedule:
    """The schedule of the clip's first ``frames`` frames (or of a longer clip that begins with it)."""
    stances = tuple(replace(s, stop=min(s.stop, frames)) for s in schedule.stances if s.start < frames)
    return replace(schedule, frames=frames, stances=stances)
