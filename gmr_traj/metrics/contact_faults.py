"""Faults of feet, floor and body: slide, float, penetration, self-collision."""

from __future__ import annotations

import numpy as np

from gmr_traj.metrics.artefact import Artefact, Collector
from gmr_traj.metrics.figures import pair_name
from gmr_traj.metrics.observation import Observation
from gmr_traj.metrics.stances import StanceTrack


def stance_artefacts(observation: Observation, tracks: tuple[StanceTrack, ...], collector: Collector) -> list[Artefact]:
    """Slide: stances whose point drifts, over their length.  Float: frames in stance with a point off the floor."""
    names = tuple(sole.name for sole in observation.robot.soles)
    drift = np.zeros((observation.motion.frames, len(names)))
    height = np.zeros_like(drift)
    slides = np.zeros(drift.shape, dtype=bool)
    for track in tracks:
        span, sole = slice(track.stance.start, track.stance.stop), names.index(track.stance.sole)
        np.maximum(drift[span, sole], track.drift, out=drift[span, sole])
        np.maximum(height[span, sole], track.height, out=height[span, sole])
        slides[span, sole] |= track.drift.max() > collector.settings("slide", "report")
    return collector.collect("slide", names, drift, flagged=slides) + collector.collect("float", names, height)


def floor_artefacts(observation: Observation, collector: Collector) -> list[Artefact]:
    """Sole penetration: points and outline of a sole.  Floor penetration: shapes of the bodies without a sole."""
    robot = observation.robot
    soles = [
        np.maximum(0.0, -np.concatenate([points, outline], axis=1)[..., 2].min(axis=1))
        for points, outline in zip(observation.soles, observation.outlines, strict=True)
    ]  # S of (T,)
    found: list[Artefact] = []
    if soles:
        names = [sole.name for sole in robot.soles]
        found += collector.collect("sole_penetration", names, np.stack(soles, axis=1))
    feet = {sole.body for sole in robot.soles}
    owners = [capsule.body for capsule in robot.capsules]
    bodies = [name for name in dict.fromkeys(owners) if name not in feet]
    if bodies:
        depth = np.maximum(0.0, -observation.lowest)  # (T, C)
        columns = [depth[:, [i for i, owner in enumerate(owners) if owner == body]].max(axis=1) for body in bodies]
        found += collector.collect("floor_penetration", bodies, np.stack(columns, axis=1))
    return found


def self_collision_artefacts(observation: Observation, collector: Collector) -> list[Artefact]:
    """Self-collision: each pair of shapes by itself."""
    overlaps = observation.overlaps
    found: list[Artefact] = []
    for pair in np.unique(overlaps.pair):
        own = overlaps.pair == pair
        depth = np.zeros((observation.motion.frames, 1))
        depth[overlaps.frame[own], 0] = overlaps.depth[own]
        found += collector.collect("self_collision", [pair_name(observation.robot, int(pair))], depth)
    return found
