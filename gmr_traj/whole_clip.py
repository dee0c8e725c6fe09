"""One problem over all frames it is given, solved again about its own solution where rows were missing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.evaluation import Row, evaluate, report
from gmr_traj.kinematics.casadi_kinematics import CasadiKinematics
from gmr_traj.motion import RobotMotion
from gmr_traj.outcome import SolveReport, TermReport
from gmr_traj.problem import Problem
from gmr_traj.solver import Solution, solve
from gmr_traj.terms.context import Context, stepped
from gmr_traj.transcription import Used, transcribe
from gmr_traj.variables import Variables

Progress = Callable[[str, int, int], None]

# A row that was not built may be off by this much [its own unit; lengths in m, rates as a share of 1 rad/s^k].
TOLERANCE = {"m": 2e-4, "rad": 1e-5, "rad/s": 1e-3, "rad/s^2": 1e-1}


@dataclass(frozen=True)
class Task:
    """Motions and schedule of the frames to solve for; ``held`` frames keep the centre's configuration."""

    centre: RobotMotion
    target: RobotMotion
    trust: np.ndarray
    schedule: ContactSchedule
    held: np.ndarray


def solve_clip(
    task: Task, kinematics: CasadiKinematics, problem: Problem, progress: Progress | None = None
) -> tuple[RobotMotion, SolveReport]:
    """Solve, look for constraints that are violated where they were not built, and solve again with them.

    Returns:
        the motion of the last pass, and the report of all passes together.
    """
    context = Context(
        kinematics.robot, kinematics, task.centre, task.target, task.trust, task.schedule, visited=(task.centre,)
    )
    solutions: list[Solution] = []
    while True:
        variables = Variables(context.frames, kinematics.tangent_size)
        used = build(context, variables, problem)
        variables.hold(task.held)
        nlp = transcribe(variables, used)
        if progress is not None:
            progress("solving", len(solutions), problem.passes)
        solution = solve(nlp, problem.again if solutions else problem.first)
        solutions.append(solution)
        motion = stepped(context.centre, solution.x[variables.steps])
        missing = _missing(replace(context, centre=motion, visited=(motion,)), used, problem)
        if not missing or len(solutions) == problem.passes or solution.status == "not converged":
            break
        context = replace(context, centre=motion, visited=(*context.visited, motion))
    reports = tuple(report(item, solution.x) for item in used)
    return motion, _summary(solutions, reports, missing)


def build(context: Context, variables: Variables, problem: Problem) -> list[Used]:
    """All residuals of the problem about the context's centre."""
    return [Used(residual, item.use) for item in problem.terms for residual in item.term.residuals(context, variables)]


def _missing(context: Context, used: list[Used], problem: Problem) -> set[Row]:
    """Constraint rows that the motion violates and the problem just solved did not have."""
    variables = Variables(context.frames, context.kinematics.tangent_size)
    now = [item for item in build(context, variables, problem) if item.use != "cost"]
    x = variables.initial()
    violated: set[Row] = set()
    for item in now:
        values = evaluate(item.residual, x)
        violated |= values.keys(values.off > TOLERANCE.get(item.residual.unit, 1e-4))
    if not violated:
        return violated
    had: set[Row] = set()
    for item in used:
        if item.use != "cost":
            values = evaluate(item.residual, np.zeros(max(variables.size, int(_reach(item)) + 1)))
            had |= values.keys(np.ones(values.off.size, bool))
    return violated - had


def _reach(item: Used) -> int:
    """Largest index of an unknown that a residual names."""
    residual = item.residual
    columns = residual.columns if hasattr(residual, "columns") else residual.matrix.indices
    return int(columns.max()) if columns.size else 0


def _summary(solutions: list[Solution], reports: tuple[TermReport, ...], missing: set[Row]) -> SolveReport:
    last = solutions[-1]
    message = ""
    if missing:
        name, _, frame = min(missing)
        message = f"{len(missing)} rows that the last pass did not have are violated, first {name} in frame {frame}"
    if last.status == "not converged":
        message = f"Ipopt stopped with {last.solver_status} after {last.iterations} iterations"
    return SolveReport(
        status=last.status,
        solver_status=last.solver_status,
        strategy=", ".join(s.strategy for s in solutions),
        iterations=sum(s.iterations for s in solutions),
        seconds=sum(s.seconds for s in solutions),
        evaluation_seconds=sum(s.evaluation_seconds for s in solutions),
        passes=len(solutions),
        objective=last.objective,
        terms=reports,
        message=message,
    )
