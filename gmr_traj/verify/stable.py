"""Where in a clip a robot can begin, and where it can stop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gmr_traj.metrics.intervals import intervals
from gmr_traj.metrics.settings import Settings, shipped
from gmr_traj.verify.audit import Audit


@dataclass(frozen=True)
class StableSpan:
    """The part of a clip between its first and its last stable stretch.

    Attributes:
        start: first frame of the first stretch of ``[start] hold`` seconds in which every frame is feasible and
            balanced: something presses on the floor, and the centre of mass is less than ``[start] com_cop`` away from
            the centre of pressure.
        stop: frame after the last such stretch.
    """

    start: int
    stop: int


def stable_span(audit: Audit, settings: Settings | None = None) -> StableSpan | None:
    """Propose a start frame and an end for a clip; None where no stretch of it is stable.

    Args:
        audit: of the clip.
        settings: ``configs/verify_audit.toml`` by default.
    """
    bars = settings or shipped("verify_audit")
    balanced = np.isfinite(audit.com_cop) & (np.nan_to_num(audit.com_cop, nan=np.inf) < bars("start", "com_cop"))
    hold = max(1, round(bars("start", "hold") * audit.fps))
    long = [(a, b) for a, b in intervals(balanced & ~audit.infeasible, 1) if b - a >= hold]
    return StableSpan(long[0][0], long[-1][1]) if long else None
