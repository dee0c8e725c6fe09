"""What the tests of the optimiser share: contexts, residuals in numbers, small problems."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import casadi as ca
import metrics_toy
import numpy as np
import pytest
import scipy.sparse as sp
from conftest import CHECKOUT

from gmr_traj.attempts import Attempt
from gmr_traj.band.program import Program
from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.formulation import Formulation
from gmr_traj.kinematics.casadi_kinematics import CasadiKinematics
from gmr_traj.motion import RobotMotion
from gmr_traj.problem import Problem, UsedTerm, load_problem
from gmr_traj.residuals import FrameResidual, LinearResidual, Residual, Used
from gmr_traj.robot import Robot
from gmr_traj.terms.context import Context
from gmr_traj.terms.term import Term
from gmr_traj.transcription import transcribe
from gmr_traj.variables import Variables
from gmr_traj.visited import Visited

#: A clip with faults of every kind, 64 frames of the G1.
EXAMPLE = CHECKOUT / "examples" / "punch.npz"

#: Ipopt to tight tolerances, so that closed forms and other solutions can be compared with.
# Gauss-Newton steps get slow next to the optimum: no stopping where progress is small.
TIGHT = Attempt(
    "tight",
    {"tol": 1e-7, "constr_viol_tol": 1e-8, "max_iter": 1000, "mu_strategy": "adaptive", "acceptable_iter": 0},
)


_KINEMATICS: dict[int, CasadiKinematics] = {}


def kinematics_of(robot: Robot) -> CasadiKinematics:
    """The robot's kinematics, one for all tests, so that its functions are compiled once."""
    return _KINEMATICS.setdefault(id(robot), CasadiKinematics(robot))


@lru_cache
def toy() -> Robot:
    """The robot of the metrics' tests, one for all tests."""
    return metrics_toy.toy()


def context_of(
    robot: Robot,
    centre: RobotMotion,
    *,
    target: RobotMotion | None = None,
    trust: np.ndarray | None = None,
    schedule: ContactSchedule | None = None,
    visited: tuple[RobotMotion, ...] | None = None,
) -> Context:
    """A context about ``centre``; what is not given is the centre itself, full trust, no stance."""
    return Context(
        robot=robot,
        kinematics=kinematics_of(robot),
        centre=centre,
        target=target or centre,
        trust=np.ones(centre.frames) if trust is None else trust,
        schedule=schedule or ContactSchedule(centre.frames, centre.fps, ()),
        visited=tuple(Visited(robot, motion) for motion in visited or (centre,)),
    )


def residuals_of(term: Term, context: Context) -> tuple[list[Residual], Variables]:
    """A term's residuals and the unknowns they are about."""
    variables = Variables(context.frames, 6 + context.robot.dof)
    return term.residuals(context, variables), variables


def values(residual: Residual, x: np.ndarray) -> np.ndarray:
    """All rows at x.  # (m, K) or (m,)"""
    if isinstance(residual, LinearResidual):
        return np.asarray(residual.matrix @ x[: residual.matrix.shape[1]] + residual.offset)
    columns = zip(residual.columns, residual.parameters.T, strict=True)
    return np.stack([np.array(residual.value(x[z], p)).ravel() for z, p in columns], axis=1)


def derivative(function: Callable[[np.ndarray], np.ndarray], x: np.ndarray, step: float = 1e-6) -> np.ndarray:
    """Jacobian by central differences.  # (..., nx)"""
    rows = [np.asarray(function(x + h) - function(x - h)) / (2 * step) for h in step * np.eye(len(x))]
    return np.stack(rows, axis=-1)


def jacobian_error(residual: FrameResidual, x: np.ndarray, step: float = 1e-6) -> float:
    """Largest difference of a residual's Jacobian from central differences, over its frames."""
    assert residual.jacobian is not None
    worst = 0.0
    for z, p in zip(residual.columns, residual.parameters.T, strict=True):
        numeric = derivative(lambda at, p=p: np.array(residual.value(at, p)).ravel(), x[z], step)  # type: ignore[misc]
        worst = max(worst, float(np.abs(np.array(ca.densify(residual.jacobian(x[z], p))) - numeric).max()))
    return worst


def problem_of(*terms: tuple[str, Term], passes: int = 4, attempt: Attempt = TIGHT) -> Problem:
    """A problem of (use, term) pairs, as a problem file would name them."""
    used = tuple(UsedTerm(type(term).__name__, term, use) for use, term in terms)
    return Problem("test", Path("test.toml"), used, passes, (attempt,), (attempt,))


def linear(
    matrix: np.ndarray, lower: np.ndarray, upper: np.ndarray, *, offset: float = 0.0, weight: float = 1.0
) -> LinearResidual:
    m = len(matrix)
    zero = np.zeros(m, int)
    return LinearResidual(
        "linear", "1", sp.csr_matrix(matrix), np.full(m, offset), lower, upper, np.full(m, weight), zero, zero, ["row"]
    )


def curved(lower: float, upper: float, weight: float, frames: int = 1) -> FrameResidual:
    """``z^2 + z`` of one unknown a frame."""
    z, p = ca.SX.sym("z"), ca.SX.sym("p")
    one = np.ones((1, frames))
    return FrameResidual(
        name="curved",
        unit="1",
        rows=["row"],
        frames=np.arange(frames),
        columns=np.arange(frames)[:, None],
        parameters=0 * one,
        value=ca.Function("r", [z, p], [z**2 + z]),
        jacobian=ca.Function("J", [z, p], [2 * z + 1]),
        lower=lower * one,
        upper=upper * one,
        weights=weight * one,
    )


def every_operation(x: ca.SX, p: ca.SX) -> list[ca.SX]:
    """Every kind of operation, constants twice, and outputs that are inputs, constants and structural zeros."""
    a, b = x[0], x[1]
    waves = ca.sin(a) + ca.cos(b) * ca.tan(a / 3) - ca.exp(-a) + ca.log(1 + b**2) + ca.sqrt(1 + a * a) + 2 * a
    angles = ca.atan2(a, 1 + b * b) + ca.asin(a / 9) - ca.acos(b / 9) + ca.atan(a) + ca.tanh(b) + a**3.5
    steps = ca.if_else(a < b, a, 3.0) + ca.fmin(a, p[0]) - ca.fmax(b, 3.0) + ca.fabs(b - 2) + ca.sign(b - 2)
    logic = ca.logic_or(a <= 1, ca.logic_and(b != 2, ca.logic_not(a == b))) + ca.floor(a) - ca.ceil(b) + 1 / (1 + a)
    return [ca.vertcat(waves, angles, a, 0.0, 7.0), ca.sparsify(ca.vertcat(steps, 0, logic)), ca.copysign(p[1], a - b)]


def built_parts(robot: Robot, motion: RobotMotion) -> tuple[Variables, list[Used]]:
    """Unknowns and residuals of the problem that ships, with one foot in stance and trust from 0.2 to 1."""
    count = motion.frames
    feet = metrics_toy.both_feet(count, motion.fps)
    schedule = replace(feet, stances=tuple(stance for stance in feet.stances if stance.sole == "left"))
    context = context_of(robot, motion, schedule=schedule, trust=np.linspace(0.2, 1, count))
    variables = Variables(count, 6 + robot.dof)
    problem = load_problem("refine")
    return variables, [Used(r, item.use) for item in problem.terms for r in item.term.residuals(context, variables)]


def compare_numbers_with_symbols(formulation: Formulation) -> None:
    """Value, gradient, rows, Jacobian and condensed matrix of either engine's form of a program, at some point."""
    nlp, program = transcribe(formulation), Program(formulation)
    rng = np.random.default_rng(5)
    x = nlp.initial + 0.02 * rng.normal(size=len(nlp.initial))
    value, gradient, rows = program.at(x)
    f = ca.Function("f", [nlp.problem["x"]], [nlp.problem["f"]])
    assert value == pytest.approx(float(f(x)), rel=1e-12)
    np.testing.assert_allclose(gradient, np.array(nlp.gradient(x, [])[1]).ravel(), rtol=1e-10, atol=1e-9)
    g, jacobian = (np.array(ca.densify(matrix)) for matrix in nlp.jacobian(x, []))
    np.testing.assert_allclose(rows, g.ravel(), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(program.jacobian.toarray(), jacobian, rtol=1e-12, atol=1e-12)
    upper = np.array(ca.densify(nlp.hessian(x, [], 1.0, 0.0)))
    unknowns, weights = rng.uniform(1, 2, program.size), rng.uniform(0, 1e3, program.rows)
    whole = upper + np.triu(upper, 1).T + jacobian.T @ np.diag(weights) @ jacobian + np.diag(unknowns)
    wanted = rng.normal(size=program.size)
    assert program.condense(unknowns, weights, wanted)
    np.testing.assert_allclose(program.factor.solve(whole @ wanted), wanted, rtol=1e-6, atol=1e-6)
