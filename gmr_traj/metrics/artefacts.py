"""The artefact report: every fault of a clip, worst first."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.metrics.artefact import Artefact, Collector
from gmr_traj.metrics.contact_faults import floor_artefacts, self_collision_artefacts, stance_artefacts
from gmr_traj.metrics.observation import Observation, observe
from gmr_traj.metrics.settings import Settings, shipped
from gmr_traj.metrics.spikes import joint_artefacts
from gmr_traj.metrics.stances import stance_tracks
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot


def artefacts(
    motion: RobotMotion, robot: Robot, schedule: ContactSchedule, settings: Settings | None = None
) -> tuple[Artefact, ...]:
    """All artefacts of a clip, worst first.

    The clip is first raised by ``schedule.height``: one that hovers or is sunk as a whole has one fault of kind
    ``height``, and its feet are judged against the floor it meant.

    Args:
        motion: the clip.
        robot: its robot.
        schedule: when which sole point rests on the floor.
        settings: thresholds; by default ``configs/inspect.toml``.

    Raises:
        ClipError: where the clip's joints are not the robot's.
        ScheduleError: where the schedule does not fit the clip or the robot.
    """
    return find_artefacts(observe(motion, robot), schedule, settings)


def find_artefacts(
    observation: Observation, schedule: ContactSchedule, settings: Settings | None = None
) -> tuple[Artefact, ...]:
    """The same as :func:`artefacts`, from a clip observed before."""
    collector = Collector(observation.motion.fps, settings or shipped("inspect"))
    found: list[Artefact] = []
    if abs(schedule.height) > collector.settings("height", "report"):
        where = "above the floor" if schedule.height < 0.0 else "below the floor"
        whole = (0, observation.motion.frames)
        found.append(collector.artefact("height", where, whole, 0, abs(schedule.height)))
    level = observation.raised(schedule.height)
    found += joint_artefacts(level, collector)
    found += stance_artefacts(level, stance_tracks(level, schedule), collector)
    found += floor_artefacts(level, collector)
    found += self_collision_artefacts(level, collector)
    return tuple(sorted(found, key=lambda a: (-a.score, a.start, a.kind, a.where)))


def clip_score(found: Iterable[Artefact], motion: RobotMotion, settings: Settings | None = None) -> float:
    """How bad a clip is on the whole: 0 without artefacts, 1 with one severe fault throughout.

    ``sum over kinds of mean over frames of the largest score of that kind in the frame``; an artefact shorter than
    ``moment`` counts for that long.  Several places with the same fault at once count once, so an arm that is in the
    leg with three of its shapes is not three times as bad.
    """
    least = (settings or shipped("inspect"))("merge", "moment") * motion.fps  # frames
    worst: dict[str, np.ndarray] = {}
    for artefact in found:
        scores = worst.setdefault(artefact.kind, np.zeros(motion.frames))
        margin = math.ceil(max(0.0, least - (artefact.stop - artefact.start)) / 2.0)
        span = scores[max(0, artefact.start - margin) : artefact.stop + margin]
        np.maximum(span, artefact.score, out=span)
    return float(sum(scores.mean() for scores in worst.values()))
