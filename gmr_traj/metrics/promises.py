"""The promises, each from the figures it rests on."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from gmr_traj.metrics.artefact import Artefact
from gmr_traj.metrics.change import Change, upper_body_change
from gmr_traj.metrics.faithfulness import Distances
from gmr_traj.metrics.figures import Figures
from gmr_traj.metrics.intervals import near
from gmr_traj.metrics.observation import Observation
from gmr_traj.metrics.promise import Promise
from gmr_traj.metrics.settings import Settings
from gmr_traj.motion import RobotMotion

_SENTENCES = {
    "limit_frames": "every joint is inside its range",
    "over_frames": "every joint is within its velocity limit",
    "acceleration_ratio": "every joint is within its acceleration limit",
    "jerk_rms": "joints are no jerkier than in the input",
    "jumps": "the jumps are gone",
    "transient": "the first frames do not jump",
    "drift_p95": "feet stay where they came down (95 %)",
    "drift_max": "feet stay where they came down (worst)",
    "slide_mean": "feet do not skate in stance (mean)",
    "float_p95": "feet in stance are on the floor (95 %)",
    "sole_depth": "no sole is below the floor",
    "floor_depth": "no part of the body is below the floor",
    "self_depth": "no part of the body is inside another",
    "self_share": "hardly a frame is over 1 mm deep in itself",
    "change_position": "bodies are where the input has them (mean)",
    "change_orientation": "bodies are turned as in the input (mean)",
    "source_position": "bodies are where the human has them (mean)",
    "source_orientation": "bodies are turned as the human's (mean)",
    "untouched_mean": "where no fault was, little changed (mean)",
    "untouched_p95": "where no fault was, little changed (95 %)",
    "frames": "as many frames as the input",
    "rate": "the same frame rate as the input",
}
# Mending these moves the feet and with them the legs and the base, not the upper body seen from the base.
_FEET = ("slide", "float", "sole_penetration", "height")
_SAME_RATE = 1e-6  # [Hz]


def figure_promises(before: Figures, after: Figures, bars: Settings) -> list[Promise]:
    """Joint limits, stances, floor and self-collision."""
    a, b = after, before

    def of_input(table: str, key: str, figure: float) -> float:
        """The bar, or a share of the input's own figure where that is more."""
        return max(bars(table, key), bars(table, f"{key}_of_input") * figure)

    jerk = of_input("joints", "jerk", b.jerk_rms)
    p95, most = of_input("stances", "drift_p95", b.drift_p95), of_input("stances", "drift_max", b.drift_max)
    slide, rest = of_input("stances", "slide", b.slide_mean), bars("stances", "float")
    ratio, share = bars("joints", "acceleration_ratio"), bars("penetration", "self_share")
    sole, floor, inside = (bars("penetration", key) for key in ("sole", "floor", "self"))
    fastest = a.speed_joint if a.over_frames else ""
    sole_a, sole_b = max(0.0, -a.sole_lowest), max(0.0, -b.sole_lowest)
    hardest, of_limit = a.acceleration_joint, "of the limit"
    return [
        _promise("limit_frames", a.limit_frames, 0, "frames", a.limit_joint, b.limit_frames),
        _promise("over_frames", a.over_frames, 0, "frames", fastest, b.over_frames),
        _promise("acceleration_ratio", a.acceleration_ratio, ratio, of_limit, hardest, b.acceleration_ratio),
        _promise("jerk_rms", a.jerk_rms, jerk, "rad/s^3", "", b.jerk_rms),
        _promise("drift_p95", a.drift_p95, p95, "mm", "", b.drift_p95),
        _promise("drift_max", a.drift_max, most, "mm", a.drift_sole, b.drift_max),
        _promise("slide_mean", a.slide_mean, slide, "mm/s", "", b.slide_mean),
        _promise("float_p95", a.float_p95, rest, "mm", "", b.float_p95),
        _promise("sole_depth", sole_a, sole, "mm", a.sole_name, sole_b),
        _promise("floor_depth", -a.floor_lowest, floor, "mm", a.floor_body, -b.floor_lowest),
        _promise("self_depth", a.self_depth, inside, "mm", a.self_pair, b.self_depth),
        _promise("self_share", 100 * a.self_share, 100 * share, "% of frames", a.self_pair, 100 * b.self_share),
    ]


def jump_promises(before: Iterable[Artefact], after: Iterable[Artefact], bars: Settings) -> list[Promise]:
    """The single-frame jumps and the first frames' transient are gone."""
    was, left = list(before), list(after)

    def one(kind: str, share: float) -> Promise:
        had, has = [x for x in was if x.kind == kind], [x for x in left if x.kind == kind]
        name = {"jump": "jumps"}.get(kind, kind)
        return _promise(name, len(has), math.floor(share * len(had)), "", has[0].where if has else "", len(had))

    return [one("jump", bars("joints", "jumps_of_input")), one("transient", 0.0)]


def change_promises(moved: Change, bars: Settings) -> list[Promise]:
    """The motion is still the input's: mean change over frames and key bodies; where: the body that changed most."""
    furthest = max(moved.bodies, key=lambda body: body.position_mean).body
    turned = max(moved.bodies, key=lambda body: body.orientation_mean).body
    return [
        _promise("change_position", moved.position, bars("change", "position"), "mm", furthest),
        _promise("change_orientation", moved.orientation, bars("change", "orientation"), "deg", turned),
    ]


def source_promises(before: Distances, after: Distances, bars: Settings) -> list[Promise]:
    """The motion is the human's as much as the input was: mean distance from the scaled human's key bodies.

    Args:
        before: distances of the input.
        after: distances of the refined clip.
        bars: the bars: a share of the input's distance or millimetres more, degrees more than the input's orientation.
    """
    out = []
    if after.placed.any():
        far, was = (1e3 * d.position[:, d.placed].mean(axis=0) for d in (after, before))
        bar = max(bars("source", "position_of_input") * was.mean(), was.mean() + bars("source", "position_over_input"))
        where = after.bodies[np.flatnonzero(after.placed)[(far - was).argmax()]]
        out.append(_promise("source_position", far.mean(), bar, "mm", where, was.mean()))
    if after.turned.any():
        angle, was = (np.degrees(d.orientation[:, d.turned].mean(axis=0)) for d in (after, before))
        bar = was.mean() + bars("source", "orientation_over_input")
        where = after.bodies[np.flatnonzero(after.turned)[(angle - was).argmax()]]
        out.append(_promise("source_orientation", angle.mean(), bar, "deg", where, was.mean()))
    return out


def untouched_promises(
    before: Observation, after: Observation, found: Iterable[Artefact], bars: Settings
) -> list[Promise]:
    """What had no fault stays as it was: the upper body, seen from the base, in frames away from any artefact.

    Frames within ``margin`` of an artefact of the input are left out, but for the feet's own artefacts, which do not
    excuse the upper body.  Where no frame or no body is left the values are 0 and ``where`` says so.

    Args:
        before: the input, raised to the floor.
        after: the refined clip.
        found: the input's artefacts.
        bars: the bars.
    """
    moved, bodies = upper_body_change(before, after)  # (T, U)
    touched = [(x.start, x.stop) for x in found if x.kind not in _FEET]
    margin = math.ceil(bars("untouched", "margin") * before.motion.fps)
    clean = ~near(touched, before.motion.frames, margin)[: len(moved)]
    sample = moved[clean]
    mean, p95, where = 0.0, 0.0, f"no frame is {bars('untouched', 'margin'):g} s from any artefact"
    if not bodies:
        where = "every key body carries a foot"
    if sample.size:
        mean, p95 = float(sample.mean()), float(np.quantile(sample, 0.95))
        where = f"{bodies[int(sample.mean(axis=0).argmax())]}, over {int(clean.sum())} frames"
    return [
        _promise("untouched_mean", mean, bars("untouched", "mean"), "mm", where),
        _promise("untouched_p95", p95, bars("untouched", "p95"), "mm", where),
    ]


def same_clip(raw: RobotMotion, refined: RobotMotion) -> list[Promise]:
    """As many frames at the same rate; the joints are held to the robot's when a clip is observed."""
    return [
        _promise("frames", abs(refined.frames - raw.frames), 0, "frames"),
        _promise("rate", abs(refined.fps - raw.fps), _SAME_RATE, "Hz"),
    ]


def _promise(name: str, value: float, bar: float, unit: str, where: str = "", before: float | None = None) -> Promise:
    """A promise, held where ``value <= bar`` (a value that is not a number never holds)."""
    return Promise(name, _SENTENCES[name], bool(value <= bar), float(value), float(bar), unit, where, before)
