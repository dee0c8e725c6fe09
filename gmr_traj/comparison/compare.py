"""Comparing clips: one table of figures, the best of each row known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from gmr_traj.comparison.entrant import Entrant, Field, align, cut_frames, cut_targets
from gmr_traj.comparison.figures import Judged
from gmr_traj.comparison.groups import GROUPS, Group
from gmr_traj.comparison.metric import Measure, Metric
from gmr_traj.comparison.stances import by_vote, from_targets
from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.metrics.settings import Settings, shipped
from gmr_traj.references import BodyTargets
from gmr_traj.resampling import resample_schedule, resample_targets
from gmr_traj.retarget.source import Source
from gmr_traj.robot import Robot

_TIE = 1e-9  # relative; values this close are equally good


@dataclass(frozen=True)
class Row:
    """One metric of all clips.

    Attributes:
        group: title of the group it belongs to.
        metric: the metric.
        measures: one a clip, in the comparison's order.
    """

    group: str
    metric: Metric
    measures: tuple[Measure, ...]

    @property
    def best(self) -> tuple[bool, ...]:
        """Which of the clips are best; none where all are equally good or fewer than two have a value."""
        known = [m.value for m in self.measures if m.value is not None]
        if len(known) < 2:
            return (False,) * len(self.measures)
        best, worst = (min(known), max(known)) if self.metric.better == "less" else (max(known), min(known))
        tie = _TIE * max(abs(best), abs(worst))
        if abs(best - worst) <= tie:
            return (False,) * len(self.measures)
        return tuple(m.value is not None and abs(m.value - best) <= tie for m in self.measures)


@dataclass(frozen=True)
class Comparison:
    """Figures of several clips of one motion.

    Attributes:
        names: the clips.
        rows: the metrics, group by group.
        seconds: how much of the clips was compared [s].
        fps: frame rate of what is compared frame by frame [Hz].
        stance_rule: where the stances come from by which the feet are judged.
        notes: what else to know, one sentence each.
    """

    names: tuple[str, ...]
    rows: tuple[Row, ...]
    seconds: float
    fps: float
    stance_rule: str
    notes: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """Everything, ready for ``json.dumps``."""
        return {
            "clips": list(self.names),
            "seconds": self.seconds,
            "fps": self.fps,
            "stances": self.stance_rule,
            "notes": list(self.notes),
            "metrics": [
                {
                    "key": row.metric.key,
                    "group": row.group,
                    "title": row.metric.title,
                    "unit": row.metric.unit,
                    "better": row.metric.better,
                    "values": {name: m.value for name, m in zip(self.names, row.measures, strict=True)},
                    "where": {name: m.where for name, m in zip(self.names, row.measures, strict=True) if m.where},
                    "best": [name for name, best in zip(self.names, row.best, strict=True) if best],
                }
                for row in self.rows
            ],
        }


def compare(
    entrants: Sequence[Entrant],
    robot: Robot,
    *,
    source: Source | None = None,
    seconds: tuple[float, float] | None = None,
    settings: Settings | None = None,
    more: Sequence[Group] = (),
) -> Comparison:
    """Compare retargets of one motion.

    The feet of all clips are judged by one schedule, so that none gets better by being airborne: the source's where
    it is given; else where the targets that a clip's file carries have the soles at rest; else wherever at least half
    of the clips have them at rest.  Faithfulness is measured against the source's targets, else those of the first
    file that carries any.

    Args:
        entrants: the clips.
        robot: their robot, with all its joints.
        source: the human motion, where it is at hand; it begins with the clips.
        seconds: stretch of every clip (and of the source) to compare, from and to [s].
        settings: by default ``configs/compare.toml``.
        more: further groups, such as ``gmr_traj.verify.compared.verify_groups``.

    Raises:
        ClipError: the clips cannot be compared; the message says which and why.
    """
    if source is not None and seconds is not None:
        source = _cut(source, cut_frames(seconds, source.fps, source.schedule.frames, source.name))
    end = None if source is None else (source.schedule.frames - 1) / source.fps
    field = align(entrants, robot, seconds, end)
    targets, origin = _targets(field, entrants, source, seconds)
    schedule, rule, known = _schedule(field, targets, origin, source)
    chosen = settings or shipped("compare")
    judged = [Judged(c, schedule, known, targets, field.bodies, field.fps, chosen) for c in field.clips]
    rows = []
    for title, metrics, fill in (*GROUPS, *more):
        cells = [fill(one) for one in judged]
        rows += [Row(title, metric, tuple(own[metric.key] for own in cells)) for metric in metrics]
    notes = field.notes
    if targets is None:
        notes = (*notes, "without a human motion (--source) contacts and faithfulness are not known")
    else:
        notes = (*notes, f"the scaled person is that of {origin}, each clip turned and shifted as a whole to meet it")
    return Comparison(
        names=tuple(clip.name for clip in field.clips),
        rows=tuple(rows),
        seconds=field.frames / field.fps,
        fps=field.fps,
        stance_rule=rule,
        notes=notes,
    )


def _targets(
    field: Field, entrants: Sequence[Entrant], source: Source | None, seconds: tuple[float, float] | None
) -> tuple[BodyTargets | None, str]:
    """Body targets on the shared frames, and where they are from."""
    if source is not None:
        fps, targets, origin = source.fps, source.targets, source.name
    else:
        carrying = next((e for e in entrants if e.references is not None), None)
        if carrying is None or carrying.references is None:
            return None, ""
        fps, targets, origin = carrying.motion.fps, carrying.references, carrying.name
        if seconds is not None:
            targets = cut_targets(targets, cut_frames(seconds, fps, targets.frames, origin))
    return cut_targets(resample_targets(targets, fps, field.fps), slice(0, field.frames)), origin


def _schedule(
    field: Field, targets: BodyTargets | None, origin: str, source: Source | None
) -> tuple[ContactSchedule, str, bool]:
    """The stances, where they are from, and whether that is the source."""
    if source is not None:
        rule = f"stances of {source.name}: heel and toe of the person at rest on the floor"
        return resample_schedule(source.schedule, field.fps, field.frames), rule, True
    if targets is not None:
        found = from_targets(targets, field.robot, field.fps)
        if found is not None:
            rule = f"stances of the targets of {origin}: the soles at rest where the scaled person has them"
            return found, rule, True
    shared = [clip.shared.motion for clip in field.clips]
    half = "on the clip itself" if len(shared) == 1 else f"on at least half of the {len(shared)} clips"
    return by_vote(shared, field.robot), f"stances found {half}, the same for all", False


def _cut(source: Source, span: slice) -> Source:
    """Some of the frames of a source."""
    schedule = source.schedule
    frames = span.stop - span.start
    stances = tuple(
        replace(s, start=max(0, s.start - span.start), stop=min(frames, s.stop - span.start))
        for s in schedule.stances
        if s.start < span.stop and s.stop > span.start
    )
    cut = replace(schedule, frames=frames, stances=stances)
    return replace(source, schedule=cut, targets=cut_targets(source.targets, span))
