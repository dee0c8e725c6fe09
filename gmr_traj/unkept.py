"""Which hard constraints a solve that did not converge has left broken, in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gmr_traj.outcome import TermReport

# For units that have no tolerance of their own.
_TOLERANCE = 1e-4


def unkept(reports: Sequence[TermReport], tolerance: Mapping[str, float]) -> str:
    """A clause that names the worst row of every term of which one is broken; empty where all are kept.

    Args:
        reports: of all residuals.
        tolerance: by how much a row may be off, by unit.
    """
    worst: dict[str, tuple[float, TermReport]] = {}
    for report in reports:
        times, term = report.violation / tolerance.get(report.unit, _TOLERANCE), report.name.partition("/")[0]
        if report.use == "hard" and times > max(1.0, worst[term][0] if term in worst else 0.0):
            worst[term] = times, report
    named = [
        f"{report.name} ({report.where}: off by {report.violation:.3g} {report.unit})"
        for _, report in sorted(worst.values(), key=lambda pair: -pair[0])
    ]
    if not named:
        return ""
    return f"; hard constraints that are not kept: {', '.join(named)}; used as soft ones they would give way"
