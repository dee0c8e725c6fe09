"""A clip in overlapping windows, one after another: for streams, and for clips too long for one problem.

A window starts on the last frames that are already final, held as they are: three frames fix position, velocity and
acceleration, so that the smoothness terms see no seam, and a stance that spans it keeps its anchor through them.  It
looks ``overlap`` seconds ahead of what is kept of it.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from gmr_traj.attempts import RANKING
from gmr_traj.exceptions import ProblemError
from gmr_traj.kinematics.casadi_kinematics import CasadiKinematics
from gmr_traj.motion import RobotMotion
from gmr_traj.outcome import SolveReport, TermReport
from gmr_traj.problem import Problem
from gmr_traj.task import HELD, Task
from gmr_traj.whole_clip import Progress, solve_clip


def solve_windows(
    task: Task,
    kinematics: CasadiKinematics,
    problem: Problem,
    window: float,
    overlap: float | None,
    progress: Progress | None = None,
) -> tuple[RobotMotion, SolveReport]:
    """Solve the windows of a clip in turn.

    Args:
        task: the whole clip.
        kinematics: of its robot.
        problem: solved in every window.
        window: length of a window [s].
        overlap: look-ahead of a window [s]; None for a quarter of the window.
        progress: called with what is being done, frames done and frames in all.

    Raises:
        ProblemError: lengths that are no lengths, or leave nothing to keep of a window.
    """
    if not (math.isfinite(window) and window > 0):
        raise ProblemError(f"the window is {window:g} s; expected a positive number of seconds")
    if overlap is not None and not (math.isfinite(overlap) and overlap >= 0):
        raise ProblemError(f"the overlap is {overlap:g} s; expected a number of seconds, zero or more")
    fps, frames = task.centre.fps, task.centre.frames
    length = round(window * fps)
    ahead = round((0.25 * window if overlap is None else overlap) * fps)
    if length - ahead < 2 * HELD:
        raise ProblemError(
            f"a window of {window:g} s with an overlap of {ahead / fps:g} s keeps {length - ahead} frames at {fps:g} "
            f"fps; at least {2 * HELD} are needed: choose a longer window or a shorter overlap"
        )
    qpos = task.centre.qpos.copy()
    reports: list[SolveReport] = []
    final = 0
    while final < frames:
        start = max(0, final - HELD)
        stop = min(frames, start + length)
        if frames - stop < 2 * HELD:
            stop = frames
        if progress is not None:
            progress("windows", final, frames)
        held = np.union1d(np.arange(start, final), task.held[(task.held >= start) & (task.held < stop)]) - start
        part = task.part(task.centre.with_qpos(qpos), start, stop, held)
        motion, report = solve_clip(part, kinematics, problem)
        kept = stop if stop == frames else stop - ahead
        # What the window saw beyond what is kept of it is where the next one starts from: there is no jump to get over.
        qpos[final:stop] = motion.qpos[final - start :]
        reports.append(_shifted(report, start))
        final = kept
        if report.status == "not converged":
            break
    return task.centre.with_qpos(qpos), _merged(reports)


def _shifted(report: SolveReport, start: int) -> SolveReport:
    """A window's report with frames counted in the clip."""
    terms = []
    for term in report.terms:
        place, mark, frame = term.where.rpartition(", frame ")
        terms.append(replace(term, where=f"{place}{mark}{int(frame) + start}" if mark else term.where))
    return replace(report, terms=tuple(terms))


def _merged(reports: list[SolveReport]) -> SolveReport:
    """One report of all windows; rows and values are sums, violations the largest."""
    terms: dict[tuple[str, str], TermReport] = {}
    for term in (term for report in reports for term in report.terms):
        known = terms.get((term.name, term.use))
        if known is None:
            terms[term.name, term.use] = term
            continue
        worse = term if term.violation > known.violation else known
        terms[term.name, term.use] = replace(worse, rows=known.rows + term.rows, value=known.value + term.value)
    worst = max(reports, key=lambda report: RANKING.index(report.status))
    return SolveReport(
        status=worst.status,
        solver_status=worst.solver_status,
        strategy=", ".join(sorted({report.strategy for report in reports})),
        iterations=sum(report.iterations for report in reports),
        repairs=sum(report.repairs for report in reports),
        repair_iterations=sum(report.repair_iterations for report in reports),
        seconds=sum(report.seconds for report in reports),
        evaluation_seconds=sum(report.evaluation_seconds for report in reports),
        linear_seconds=sum(report.linear_seconds for report in reports),
        passes=max(report.passes for report in reports),
        objective=sum(report.objective for report in reports),
        terms=tuple(terms.values()),
        message="; ".join(dict.fromkeys(report.message for report in reports if report.message)),
    )
