"""Artefacts as intervals: one lane a kind, and the list of the worst."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from gmr_traj import colours
from gmr_traj.metrics.artefact import Artefact
from gmr_traj.track import Track
from gmr_traj.viewer.paths import part
from gmr_traj.viewer.states import log_lane
from gmr_traj.viewer.timelines import Clock

if TYPE_CHECKING:
    import rerun as rr

#: Colours of severity 0, 1/2 and 1 or more.
SEVERITY = ((226, 196, 96), (232, 128, 56), colours.FAULT)


def log(stream: rr.RecordingStream, track: Track, clock: Clock) -> None:
    """Log one lane for each kind of artefact, ``/artefacts/<track>/<kind>``; where several meet, the worst shows."""
    kinds = dict.fromkeys(a.kind for a in track.artefacts if a.kind != "height")
    for kind in kinds:
        own = [a for a in track.artefacts if a.kind == kind]
        states = np.full(track.motion.frames, -1)
        for k in reversed(range(len(own))):  # worst first in the list, so the worst is written last
            states[own[k].start : own[k].stop] = k
        shown = np.unique(states[states >= 0]).tolist()
        log_lane(
            stream,
            f"/artefacts/{part(track.name)}/{kind}",
            states,
            {k: label(own[k]) for k in shown},
            {k: severity_colour(own[k].score) for k in shown},
            track.motion.fps,
            clock,
        )


def label(artefact: Artefact) -> str:
    """Where it is and how bad: ``left_knee 17.5 rad/s``."""
    return f"{artefact.where.removesuffix('_joint')} {artefact.value:.3g} {artefact.unit}"


def severity_colour(score: float) -> colours.RGB:
    """From yellow over orange to red at a score of 1."""
    return SEVERITY[min(2, int(2.0 * score))]
