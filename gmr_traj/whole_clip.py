"""One problem over all frames it is given, then repairs where rows turn out to have been missing.

Constraint rows are built where the input comes near a constraint.  Now and then the solution violates one elsewhere,
in a handful of frames; those frames and their surroundings are solved again about the solution, with the rows that
were missing, between frames that are held.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gmr_traj.attempts import RANKING, Attempt, Solution
from gmr_traj.engines import solve
from gmr_traj.evaluation import Row, bounded_rows, evaluate, report
from gmr_traj.formulation import formulate
from gmr_traj.kinematics.casadi_kinematics import CasadiKinematics
from gmr_traj.motion import RobotMotion
from gmr_traj.outcome import SolveReport, TermReport
from gmr_traj.problem import Problem
from gmr_traj.residuals import Used
from gmr_traj.task import HELD, Task
from gmr_traj.terms.context import Context, stepped
from gmr_traj.unkept import unkept
from gmr_traj.variables import Variables
from gmr_traj.visited import Visited

Progress = Callable[[str, int, int], None]

# A row that was not built may be off by this much, by unit; so may one that went with where the feet and legs were.
TOLERANCE = {"m": 4e-4, "rad": 1e-5, "rad/s": 1e-3, "rad/s^2": 1e-1, "m g": 1e-2, "m g m": 1e-2}

# Time around a violated frame that a repair may change [s].
SURROUNDINGS = 0.5


def solve_clip(
    task: Task, kinematics: CasadiKinematics, problem: Problem, progress: Progress | None = None
) -> tuple[RobotMotion, SolveReport]:
    """Solve the whole task, then repair until no constraint is violated or ``problem.passes`` are used up.

    Returns:
        the motion, and the report of all passes together.
    """
    if progress is not None:
        progress("solving", 0, problem.passes)
    robot = kinematics.robot
    start = Visited(robot, task.centre)
    motion, solution, used = _solve(task, start, kinematics, problem, problem.first)
    solutions, passes, built = [solution], 1, _built(used)
    task, latest = replace(task, visited=(*task.visited, start)), Visited(robot, motion)
    missing = _violated(task, latest, kinematics, problem, built)
    while missing and passes < problem.passes and solutions[-1].status != "not converged":
        if progress is not None:
            progress("repairing", passes, problem.passes)
        passes += 1
        qpos = motion.qpos.copy()
        for first, stop in _spans(sorted({frame for _, _, frame in missing}), motion):
            held = np.arange(stop - first)
            held = held[((held < HELD) & (first > 0)) | ((held >= stop - first - HELD) & (stop < motion.frames))]
            fixed = task.held[(task.held >= first) & (task.held < stop)] - first
            part = task.part(motion, first, stop, np.union1d(held, fixed))
            repaired, solution, _ = _solve(part, latest.part(first, stop), kinematics, problem, problem.again)
            solutions.append(solution)
            qpos[first:stop] = repaired.qpos
        motion = motion.with_qpos(qpos)
        built |= missing
        task, latest = replace(task, visited=(*task.visited, latest)), Visited(robot, motion)
        missing = _violated(task, latest, kinematics, problem, built)
    final, variables = _residuals(task, latest, kinematics, problem)
    reports = tuple(report(item, variables.initial()) for item in final)
    return motion, _summary(solutions, passes, reports, missing)


def _solve(
    task: Task, centre: Visited, kinematics: CasadiKinematics, problem: Problem, attempts: tuple[Attempt, ...]
) -> tuple[RobotMotion, Solution, list[Used]]:
    """One program about the task's centre."""
    used, variables = _residuals(task, centre, kinematics, problem)
    variables.hold(task.held)
    solution = solve(formulate(variables, used), attempts)
    return stepped(task.centre, solution.x[variables.steps]), solution, used


def _residuals(
    task: Task, centre: Visited, kinematics: CasadiKinematics, problem: Problem
) -> tuple[list[Used], Variables]:
    """All residuals of the problem about a motion, and the unknowns they name."""
    visited = (*task.visited, centre)
    context = Context(
        robot=kinematics.robot,
        kinematics=kinematics,
        centre=centre.motion,
        target=task.target,
        trust=task.trust,
        schedule=task.schedule,
        visited=visited,
        references=task.references,
    )
    variables = Variables(centre.motion.frames, kinematics.tangent_size)
    used = [Used(residual, item.use) for item in problem.terms for residual in item.term.residuals(context, variables)]
    return used, variables


def _violated(task: Task, motion: Visited, kinematics: CasadiKinematics, problem: Problem, built: set[Row]) -> set[Row]:
    """Constraint rows that a motion violates; soft ones only where the problem did not have them."""
    constraints = replace(problem, terms=tuple(item for item in problem.terms if item.use != "cost"))
    used, variables = _residuals(replace(task, visited=()), motion, kinematics, constraints)
    violated: set[Row] = set()
    for item in used:
        values = evaluate(item.residual, variables.initial())
        rows = values.keys(values.off > TOLERANCE.get(item.residual.unit, 1e-4))
        violated |= rows - built if item.use == "soft" else rows
    return violated


def _built(used: list[Used]) -> set[Row]:
    """The rows of all constraints."""
    return {row for item in used if item.use != "cost" for row in bounded_rows(item.residual)}


def _spans(frames: list[int], motion: RobotMotion) -> list[tuple[int, int]]:
    """Runs of frames around the given ones, merged where they would touch."""
    reach = round(SURROUNDINGS * motion.fps) + HELD
    spans: list[tuple[int, int]] = []
    for frame in frames:
        start, stop = max(0, frame - reach), min(motion.frames, frame + reach + 1)
        if spans and start <= spans[-1][1]:
            start = spans.pop()[0]
        spans.append((start, stop))
    return spans


def _summary(solutions: list[Solution], passes: int, reports: tuple[TermReport, ...], missing: set[Row]) -> SolveReport:
    worst = max(solutions, key=lambda solution: RANKING.index(solution.status))
    message = ""
    if missing:
        name, _, frame = min(missing)
        message = f"{len(missing)} rows that were not part of the problem are violated, first {name} in frame {frame}"
    if worst.status == "not converged":
        message = f"the solver stopped with {worst.solver_status} after {worst.iterations} iterations"
        message += unkept(reports, TOLERANCE)
    return SolveReport(
        status=worst.status,
        solver_status=worst.solver_status,
        strategy=", ".join(dict.fromkeys(solution.strategy for solution in solutions)),
        iterations=solutions[0].iterations,
        repairs=len(solutions) - 1,
        repair_iterations=sum(solution.iterations for solution in solutions[1:]),
        seconds=sum(solution.seconds for solution in solutions),
        evaluation_seconds=sum(solution.evaluation_seconds for solution in solutions),
        linear_seconds=sum(solution.linear_seconds for solution in solutions),
        passes=passes,
        objective=sum(term.value for term in reports),
        terms=reports,
        message=message,
        trace={
            key: tuple(value for solution in solutions for value in solution.trace.get(key, ()))
            for key in solutions[0].trace
        },
    )
