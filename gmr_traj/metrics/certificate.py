"""The certificate: what refining a clip has done, measured on both clips."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.contacts.source_level import source_height
from gmr_traj.metrics.artefact import Artefact
from gmr_traj.metrics.artefacts import find_artefacts
from gmr_traj.metrics.change import Change, change
from gmr_traj.metrics.faithfulness import target_distances
from gmr_traj.metrics.figures import Figures, figures
from gmr_traj.metrics.observation import Observation, observe
from gmr_traj.metrics.promise import Promise
from gmr_traj.metrics.promises import (
    change_promises,
    figure_promises,
    jump_promises,
    same_clip,
    source_promises,
    untouched_promises,
)
from gmr_traj.metrics.settings import Settings, shipped
from gmr_traj.metrics.stances import cut_to
from gmr_traj.motion import RobotMotion
from gmr_traj.references import BodyTargets
from gmr_traj.robot import Robot


@dataclass(frozen=True)
class Certificate:
    """What a refined clip is held to, and what it measures beside its input.

    Attributes:
        levelling: how far the input was raised to stand on the floor [m].
        figures_before: figures of the input as it came, not raised.
        figures_after: figures of the refined clip, over the same stances.
        change: refined against the input raised by ``levelling``.
        artefacts_before, artefacts_after: what ``inspect`` finds in each, worst first.
        promises: the promises, kept or broken.
    """

    levelling: float
    figures_before: Figures
    figures_after: Figures
    change: Change
    artefacts_before: tuple[Artefact, ...]
    artefacts_after: tuple[Artefact, ...]
    promises: tuple[Promise, ...]

    @property
    def held(self) -> bool:
        """Whether every promise holds."""
        return all(p.held for p in self.promises)

    @property
    def broken(self) -> tuple[Promise, ...]:
        """The promises that do not hold."""
        return tuple(p for p in self.promises if not p.held)

    def to_json(self) -> dict[str, Any]:
        """Everything but the single artefacts, which are counted by kind; ready for ``json.dumps``."""
        return {
            "held": self.held,
            "levelling_mm": 1e3 * self.levelling,
            "promises": [p.to_json() for p in self.promises],
            "before": self.figures_before.to_json(),
            "after": self.figures_after.to_json(),
            "change": self.change.to_json(),
            "artefacts_before": _count(self.artefacts_before),
            "artefacts_after": _count(self.artefacts_after),
        }


def certify(
    raw: RobotMotion,
    refined: RobotMotion,
    robot: Robot,
    schedule: ContactSchedule,
    *,
    levelling: float,
    references: BodyTargets | None = None,
    settings: Settings | None = None,
) -> Certificate:
    """Measure a refined clip against its input and hold it to the promises.

    Both clips are measured over the same stances, those found in the input, so that a foot cannot get better by
    being lifted.  Clips of different length are compared over the frames they share, and break a promise by it.

    Args:
        raw: the input as it was read.
        refined: the refined clip, read back from what was written.
        robot: robot of both clips.
        schedule: the input's stances.
        levelling: how far the input was raised to stand on the floor before it was refined [m].
        references: the source's targets in the input's world, where they are known.
        settings: the bars; by default ``configs/certificate.toml``.

    Raises:
        ClipError: where the joints of a clip are not the robot's.
        ScheduleError: where the schedule does not fit the input or the robot.
    """
    bars = settings or shipped("certificate")
    before, after = observe(raw, robot), observe(refined, robot)
    level = before.raised(levelling)
    same_stances = cut_to(schedule, refined.frames)
    figures_before, figures_after = figures(before, schedule), figures(after, same_stances)
    found_before = find_artefacts(before, replace(schedule, height=levelling))
    found_after = find_artefacts(after, replace(same_stances, height=0.0))
    moved = change(level, after)
    source: list[Promise] = []
    if references is not None:
        source = _source_promises(before, after, references, same_stances, bars)
    return Certificate(
        levelling=levelling,
        figures_before=figures_before,
        figures_after=figures_after,
        change=moved,
        artefacts_before=found_before,
        artefacts_after=found_after,
        promises=(
            *figure_promises(figures_before, figures_after, bars),
            *jump_promises(found_before, found_after, bars),
            *change_promises(moved, bars),
            *source,
            *untouched_promises(level, after, found_before, bars),
            *same_clip(raw, refined),
        ),
    )


def _source_promises(
    before: Observation, after: Observation, references: BodyTargets, schedule: ContactSchedule, bars: Settings
) -> list[Promise]:
    """Distances from the source, which stands on the floor where the refined clip does."""
    robot, frames = after.robot, min(before.motion.frames, after.motion.frames)
    known = references.of(robot.body_names)
    if not known.names or frames != known.frames:
        return []
    grounded = known.raised(source_height(known, robot, schedule))
    return source_promises(
        target_distances(before, known, known.names), target_distances(after, grounded, known.names), bars
    )


def _count(found: tuple[Artefact, ...]) -> dict[str, int]:
    counts: dict[str, int] = {}
    for artefact in found:
        counts[artefact.kind] = counts.get(artefact.kind, 0) + 1
    return counts
