"""The figures of one aligned clip, group by group."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np

from gmr_traj.comparison.entrant import Aligned
from gmr_traj.comparison.metric import Measure
from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.metrics import joints
from gmr_traj.metrics.artefact import Collector
from gmr_traj.metrics.balance import centre_of_mass, centre_of_pressure, zero_moment_point, zmp_margins
from gmr_traj.metrics.faithfulness import target_distances
from gmr_traj.metrics.figures import Figures, figures, pair_name
from gmr_traj.metrics.floor_depth import lowest_points
from gmr_traj.metrics.foot_contact import contact_shares, slide_speeds, sole_heights, stance_mask
from gmr_traj.metrics.intervals import intervals
from gmr_traj.metrics.settings import Settings, shipped
from gmr_traj.metrics.spikes import joint_artefacts
from gmr_traj.metrics.stances import stance_tracks
from gmr_traj.references import BodyTargets
from gmr_traj.resampling import resample

_PERCENT, _MM = 100.0, 1e3


@dataclass(frozen=True)
class Judged:
    """A clip with what it is judged by.

    Attributes:
        clip: the clip.
        schedule: the stances, the same for all clips, at the shared frame rate.
        known: whether the stances are the source's (and not found on the clips).
        targets: where the bodies should be, at the shared frame rate; None where nobody says so.
        bodies: the bodies that all clips move.
        fps: the shared frame rate [Hz].
        settings: ``configs/compare.toml``.
    """

    clip: Aligned
    schedule: ContactSchedule
    known: bool
    targets: BodyTargets | None
    bodies: Collection[str]
    fps: float
    settings: Settings

    @property
    def mask(self) -> np.ndarray:
        """Whether each foot is in stance.  # (T, S)"""
        return stance_mask(self.schedule, self.clip.shared.robot)


def foot_figures(judged: Judged) -> dict[str, Measure]:
    """M1 slide speed, M2 drift, M4 floating, over the shared stances."""
    observation, mask = judged.clip.shared, judged.mask
    tracks = stance_tracks(observation, judged.schedule)
    drift = np.array([track.drift.max() for track in tracks])
    slide = slide_speeds(observation, mask)
    lifted = np.maximum(0.0, sole_heights(observation)[mask]) if mask.any() else np.zeros(0)
    lowest, _ = lowest_points(observation)
    standing = lowest.min(axis=1)[mask.any(axis=1)]
    return {
        "slide_mean": _of(slide, np.mean, _MM),
        "slide_p95": _p95(slide, _MM),
        "slide_max": _of(slide, np.max, _MM),
        "drift_p95": _p95(drift, _MM),
        "drift_max": _of(drift, np.max, _MM, tracks[int(drift.argmax())].stance.sole if tracks else ""),
        "float_mean": _of(lifted, np.mean, _MM),
        "hover_share": _of(standing > judged.settings("floor", "hover"), np.mean, _PERCENT),
    }


def contact_figures(judged: Judged) -> dict[str, Measure]:
    """M5 contact preservation, against the source's contacts alone."""
    if not judged.known:
        return _nothing("contact_kept", "contact_added")
    heights = sole_heights(judged.clip.shared)
    kept, added = contact_shares(heights, judged.mask, judged.settings("contact", "near"))
    return {"contact_kept": _scaled(kept, _PERCENT), "contact_added": _scaled(added, _PERCENT)}


def penetration(judged: Judged) -> dict[str, Measure]:
    """M3 penetration."""
    lowest, bodies = lowest_points(judged.clip.own)
    depth = np.maximum(0.0, -lowest)
    deepest = int(depth.max(axis=0).argmax())
    share = float((depth.max(axis=1) > judged.settings("floor", "deep")).mean())
    return {
        "penetration_max": Measure(_MM * float(depth.max()), bodies[deepest] if depth.max() > 0.0 else ""),
        "penetration_share": Measure(_PERCENT * share),
    }


def self_penetration(judged: Judged) -> dict[str, Measure]:
    """M6 self-penetration."""
    found = judged.clip.own.overlaps
    deep = float((found.by_frame() > judged.settings("self_collision", "deep")).mean())
    if not found.depth.size:
        return {"self_share": Measure(0.0), "self_depth": Measure(0.0)}
    worst = int(found.depth.argmax())
    pair = pair_name(judged.clip.own.robot, int(found.pair[worst]))
    return {"self_share": Measure(_PERCENT * deep), "self_depth": Measure(_MM * float(found.depth[worst]), pair)}


def joint_figures(judged: Judged) -> dict[str, Measure]:
    """M7 velocity, M8 jumps, M9 jerk, M10 limits, of the joints that all clips have."""
    observation = judged.clip.joints
    measured = _plain_figures(judged)
    steps = max(1, measured.frames - 1)
    collector = Collector(observation.motion.fps, shipped("inspect"))
    jumps = [a for a in joint_artefacts(observation, collector) if a.kind in ("jump", "transient")]
    worst = max(jumps, key=lambda a: a.score, default=None)
    # A slower clip has its jerk smoothed by what lies between its frames; so all are brought to the slowest first.
    jerk = joints.jerks(resample(observation.motion, judged.fps))
    return {
        "over_share": Measure(_PERCENT * measured.over_frames / steps),
        "speed_ratio": Measure(measured.speed_ratio, measured.speed_joint),
        "jumps": Measure(float(len(jumps)), worst.where if worst else ""),
        "jerk_rms": _of(jerk, lambda x: np.sqrt(np.mean(np.square(x))), 1.0),
        "jerk_p99": _of(np.abs(jerk), lambda x: np.quantile(x, 0.99), 1.0),
        "limit_share": Measure(_PERCENT * measured.limit_frames / measured.frames),
        "limit_excess": Measure(measured.limit_excess, measured.limit_joint),
    }


def _plain_figures(judged: Judged) -> Figures:
    """The figures of ``inspect`` for the joints; it needs a schedule, of which they take no notice."""
    motion = judged.clip.joints.motion
    return figures(judged.clip.joints, ContactSchedule(motion.frames, motion.fps, ()))


def balance_figures(judged: Judged) -> dict[str, Measure]:
    """M11 centre of mass over the centre of pressure, M13 zero-moment point, in frames with a stance."""
    observation, mask, settings = judged.clip.shared, judged.mask, judged.settings
    centre = centre_of_mass(observation)
    standing = mask.any(axis=1)
    away = np.linalg.norm(centre[:, :2] - centre_of_pressure(observation, settings("stability", "rate")), axis=1)
    stretches = intervals(standing & (away >= settings("stability", "far")), 1)
    longest = max((stop - start for start, stop in stretches), default=0) / judged.fps
    zmp = zero_moment_point(centre, judged.fps, settings("zmp", "window"))
    margins = zmp_margins(observation, zmp, mask)
    margins = margins[np.isfinite(margins)]
    return {
        "com_cop_mean": _of(away[standing], np.mean, _MM),
        "com_cop_longest": Measure(longest if standing.any() else None),
        "zmp_margin_p05": _of(margins, lambda x: np.quantile(x, 0.05), _MM),
        "zmp_outside": _of(margins < 0.0, np.mean, _PERCENT),
    }


def faithfulness_figures(judged: Judged) -> dict[str, Measure]:
    """M14 distance to the scaled person."""
    if judged.targets is None:
        return _nothing("position_mean", "position_max", "relative_mean", "orientation_mean", "orientation_max")
    found = target_distances(judged.clip.shared, judged.targets, judged.bodies)
    relative = found.relative[:, found.placed]
    placed = [body for body, wanted in zip(found.bodies, found.placed, strict=True) if wanted]
    turned = [body for body, wanted in zip(found.bodies, found.turned, strict=True) if wanted]
    position, orientation = found.position[:, found.placed], np.degrees(found.orientation[:, found.turned])
    return {
        "position_mean": _of(position, np.mean, _MM),
        "position_max": _of(position, np.max, _MM, _worst(position, placed)),
        "relative_mean": _of(relative if np.isfinite(relative).all() else np.zeros(0), np.mean, _MM),
        "orientation_mean": _of(orientation, np.mean, 1.0),
        "orientation_max": _of(orientation, np.max, 1.0, _worst(orientation, turned)),
    }


def _nothing(*keys: str) -> dict[str, Measure]:
    """Metrics that nothing is known of."""
    return {key: Measure(None) for key in keys}


def _of(values: np.ndarray, statistic: Callable[[np.ndarray], float], scale: float, where: str = "") -> Measure:
    """A statistic of values; None of no values."""
    return Measure(scale * float(statistic(values)) if values.size else None, where)


def _p95(values: np.ndarray, scale: float) -> Measure:
    return _of(values, lambda x: np.quantile(x, 0.95), scale)


def _scaled(value: float | None, scale: float) -> Measure:
    return Measure(None if value is None else scale * value)


def _worst(values: np.ndarray, names: list[str]) -> str:
    return names[int(values.max(axis=0).argmax())] if values.size else ""
