"""The banded engine: its Cholesky factors, its vectors of frames, and its optima, against other ways to get them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given
from hypothesis import strategies as st
from metrics_toy import clip, standing
from optimiser_setup import (
    EXAMPLE,
    TIGHT,
    built_parts,
    compare_numbers_with_symbols,
    curved,
    every_operation,
    linear,
    toy,
)

from gmr_traj import frames
from gmr_traj.attempts import Attempt
from gmr_traj.band import interior_point
from gmr_traj.band.cholesky import BlockCholesky
from gmr_traj.band.ordering import order
from gmr_traj.band.program import Program
from gmr_traj.band.settings import Settings
from gmr_traj.engines import solve
from gmr_traj.formats import read_clip
from gmr_traj.formulation import Formulation, formulate
from gmr_traj.frames import Frames
from gmr_traj.residuals import Used
from gmr_traj.variables import Variables
from gmr_traj.vector_machine import instructions

BAND = Attempt("band", {"max_iter": 100, "tol": 1e-4, "compl_inf_tol": 1e-9, "acceptable_iter": 1000}, "band")


@given(
    st.integers(1, 30),
    st.integers(1, 4),
    st.integers(1, 3),
    st.integers(0, 5),
    st.integers(0, 2**32 - 1),
    st.booleans(),
)
def test_factors_solve_what_numpy_solves(
    count: int, width: int, reach: int, extra: int, seed: int, meeting: bool
) -> None:
    """Frames that couple with their neighbours, and unknowns that couple with stretches of frames or one another."""
    rng = np.random.default_rng(seed)
    n = count * width + extra
    frame = np.concatenate([np.repeat(np.arange(count), width), np.full(extra, -1)])
    pattern = np.abs(frame[:, None] - frame) <= reach
    for k in range(count * width, n):
        ends = np.sort(rng.integers(0, count, 2))
        pattern[k] = pattern[:, k] = (frame >= ends[0]) & (frame <= ends[1])
    if meeting and extra:
        pattern[count * width :, count * width :] = True
    matrix = np.where(np.tril(pattern), rng.normal(size=(n, n)), 0.0)
    matrix = np.tril(matrix, -1) + np.tril(matrix, -1).T + np.diag(n + rng.uniform(1, 2, n))
    rows, columns = np.nonzero(np.tril(matrix))
    swap = rng.random(len(rows)) < 0.5
    rows, columns = np.where(swap, columns, rows), np.where(swap, rows, columns)
    couplings = [(rows, columns)]
    factor = BlockCholesky(order(frame, couplings), n, couplings)
    right = rng.normal(size=n)
    for _ in range(2):  # the store is filled anew for every factorisation
        other = rng.normal(size=n)
        assert factor.factor(matrix[rows, columns], other)
        np.testing.assert_allclose(factor.finish(), np.linalg.solve(matrix, other), rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(factor.solve(right), np.linalg.solve(matrix, right), rtol=1e-9, atol=1e-12)


def test_a_matrix_that_is_not_definite_is_told() -> None:
    couplings = [(np.array([1, 0, 1, 2, 3]), np.array([0, 0, 1, 2, 3]))]
    factor = BlockCholesky(order(np.arange(4), couplings), 4, couplings)
    assert factor.factor(np.array([0.5, 1.0, 1.0, 1.0, 1.0]), np.zeros(4))
    assert not factor.factor(np.array([0.5, 1.0, 1.0, -1.0, 1.0]), np.zeros(4))


@pytest.mark.parametrize("count", [1, 149, 150, 1024, 2500])
def test_vectors_of_frames_give_what_casadi_gives(count: int) -> None:
    x, p = ca.SX.sym("x", 2), ca.SX.sym("p", 2)
    function = ca.Function("f", [x, p], every_operation(x, p))
    assert instructions(function) is not None
    rng = np.random.default_rng(count)
    unknowns, parameters = rng.uniform(0.1, 3.0, 2 * count), rng.uniform(-2, 2, (2, count))
    columns = rng.permutation(2 * count).reshape(count, 2)
    machine = Frames(function, columns, parameters)
    for values in (unknowns, unknowns[::-1].copy()):  # the second use overwrites the first
        machine.at(values)
        expected = function.map(count)(values[columns].T, parameters)
        for output, wanted in zip(machine.outputs, expected, strict=True):
            np.testing.assert_allclose(output.T.ravel(), wanted.nonzeros(), rtol=1e-14, atol=1e-14)


def test_an_operation_without_a_vector_form_goes_to_casadi(monkeypatch: pytest.MonkeyPatch) -> None:
    x, p = ca.SX.sym("x"), ca.SX.sym("p", 0)
    function = ca.Function("f", [x, p], [ca.erf(x)])
    assert instructions(function) is None
    monkeypatch.setattr(frames, "_WORTHWHILE", 1)
    machine = Frames(function, np.arange(3)[:, None], np.zeros((0, 3)))
    machine.at(np.array([0.0, 0.5, 1.0]))
    np.testing.assert_allclose(machine.outputs[0], [[0.0, 0.5204998778, 0.8427007929]], atol=1e-9)


@pytest.fixture(params=["toy", "g1"])
def formulation(request: pytest.FixtureRequest) -> Formulation:
    """The problem that ships, over frames with every kind of term active."""
    if request.param == "toy":
        robot, qpos = toy(), standing(200)
        qpos[:, 0], qpos[:, 9], qpos[3, 7] = 0.01 * np.arange(200), -1.0, 0.5
        return formulate(*built_parts(robot, clip(qpos)))
    robot = request.getfixturevalue("g1")
    recorded = read_clip(EXAMPLE, robot).motion
    return formulate(*built_parts(robot, recorded.with_qpos(recorded.qpos[20:26])))


def test_numbers_are_those_of_the_symbols(formulation: Formulation) -> None:
    """Value, gradient, rows, Jacobian; and the condensed matrix, by what its factor solves."""
    compare_numbers_with_symbols(formulation)


def test_both_engines_find_the_same_optimum(formulation: Formulation) -> None:
    mine, theirs = solve(formulation, (BAND,)), solve(formulation, (TIGHT,))
    assert mine.status == theirs.status == "converged" and mine.strategy == "band"
    assert mine.objective == pytest.approx(theirs.objective, rel=1e-6)
    steps = formulation.variables.steps
    np.testing.assert_allclose(mine.x[steps], theirs.x[steps], atol=2e-4)
    assert len(mine.trace["obj"]) == mine.iterations + 1 and mine.trace["obj"][-1] == mine.objective
    again = solve(formulation, (BAND,))
    assert again.x.tobytes() == mine.x.tobytes() and again.trace == mine.trace


@given(st.tuples(*[st.floats(-5, 5)] * 3), st.floats(-3, 3), st.sampled_from(["hard", "soft"]))
def test_projection_onto_a_half_space(point: tuple[float, float, float], upper: float, use: str) -> None:
    """``min |x - a|^2 / 2`` with ``x1 + x2 + x3 <= b``: the projection, or all but for what a heavy slack gives way."""
    a, ones = np.array(point), np.ones((1, 3))
    pull = linear(np.eye(3), a, a)
    limit = linear(ones, np.array([-np.inf]), np.array([upper]), weight=1e6)
    solution = solve(formulate(Variables(3, 1), [Used(pull, "cost"), Used(limit, use)]), (BAND,))
    assert solution.status == "converged"
    np.testing.assert_allclose(solution.x[:3], a - max(0.0, a.sum() - upper) / 3, atol=1e-4)


def test_curved_rows_and_two_sided_bounds() -> None:
    """``1 <= z^2 + z <= 2`` pulls 3 down to 1, and -0.2 up to 0.618; each in its frame."""
    target = np.array([3.0, -0.2, 0.8])
    used = [Used(linear(np.eye(3), target, target), "cost"), Used(curved(1.0, 2.0, 1.0, frames=3), "hard")]
    variables = Variables(3, 1)
    solution = solve(formulate(variables, used), (BAND,))
    np.testing.assert_allclose(solution.x, [1.0, (np.sqrt(5) - 1) / 2, 0.8], atol=1e-5)


def test_a_step_that_overshoots_is_halved() -> None:
    """``min (z^2 + z - 6)^2 / 2`` from 0: the step of the linear model goes to 6, where the objective is 36 times as
    large, on the way to 2."""
    solution = solve(formulate(Variables(1, 1), [Used(curved(6.0, 6.0, 1.0), "cost")]), (BAND,))
    assert solution.status == "converged"
    np.testing.assert_allclose(solution.x, [2.0], atol=1e-5)
    assert solution.trace["obj"][0] == 18.0 and max(solution.trace["obj"]) <= 1.1 * 18.0


def test_rows_that_must_be_equal_to_something() -> None:
    used = [
        Used(linear(np.eye(2), np.array([1.0, 2.0]), np.array([1.0, 2.0])), "cost"),
        Used(linear(np.array([[1.0, 1.0]]), np.array([1.0]), np.array([1.0])), "hard"),
    ]
    solution = solve(formulate(Variables(2, 1), used), (BAND,))
    assert solution.status == "converged"
    np.testing.assert_allclose(solution.x, [0.0, 1.0], atol=1e-4)


def test_held_unknowns_do_not_move() -> None:
    variables = Variables(6, 1)
    variables.hold(np.array([0, 5]))
    steps = np.diff(np.eye(6), axis=0)
    used = [
        Used(linear(np.eye(6), np.full(6, 3.0), np.full(6, 3.0)), "cost"),
        Used(linear(steps, np.full(5, -1.0), np.full(5, 1.0)), "hard"),
    ]
    solution = solve(formulate(variables, used), (BAND,))
    np.testing.assert_array_equal(solution.x[[0, 5]], 0.0)
    np.testing.assert_allclose(solution.x[1:5], [1.0, 2.0, 2.0, 1.0], atol=1e-5)


def _impossible() -> Formulation:
    apart = [Used(curved(low, low + 0.1, 1.0), "hard") for low in (0.0, 1.0)]
    return formulate(Variables(1, 1), [Used(linear(np.eye(1), np.zeros(1), np.zeros(1)), "cost"), *apart])


def _no_number() -> Formulation:
    z, p = ca.SX.sym("z"), ca.SX.sym("p")
    root = replace(
        curved(0.0, 9.0, 1.0), value=ca.Function("r", [z, p], [ca.sqrt(z)]), jacobian=ca.Function("J", [z, p], [1 / z])
    )
    start = linear(np.eye(1), np.full(1, -2.0), np.full(1, -1.0))
    return formulate(Variables(1, 1), [Used(root, "hard"), Used(start, "hard")])


@pytest.mark.parametrize("make", [_impossible, _no_number])
def test_what_has_no_solution_is_not_converged_and_goes_on_to_the_next(make: Callable[[], Formulation]) -> None:
    formulation = make()
    with np.errstate(invalid="ignore"):
        alone = solve(formulation, (BAND,))
        assert alone.status == "not converged" and np.isfinite(alone.x).all()
        both = solve(formulation, (BAND, replace(TIGHT, options={"max_iter": 1})))
    assert both.strategy == "tight" and both.iterations >= alone.iterations


def test_a_matrix_without_rows_or_bounds() -> None:
    matrix = np.array([[2.0, 1.0], [0.0, 1.0]])
    free = linear(matrix, np.array([3.0, 1.0]), np.array([3.0, 1.0]))
    solution = solve(formulate(Variables(2, 1), [Used(free, "cost")]), (BAND,))
    np.testing.assert_allclose(solution.x, [1.0, 1.0], atol=1e-9)
    assert sp.issparse(Program(formulate(Variables(2, 1), [Used(free, "cost")])).jacobian)


def test_slacks_follow_rows_that_are_farther_inside(formulation: Formulation) -> None:
    """The residual of a row with one bound is never that the row is farther inside than its slack."""
    program = Program(formulation)
    state = interior_point._State(program, Settings(), formulation.initial)
    below = np.isfinite(program.row_lower) & ~np.isfinite(program.row_upper)
    above = ~np.isfinite(program.row_lower) & np.isfinite(program.row_upper)
    for _ in range(6):
        state.measure()
        assert state.advance()
        slacks = state._w[program.size :]
        assert (slacks[below] >= state._rows[below]).all() and (slacks[above] <= state._rows[above]).all()
        assert (slacks >= program.row_lower - 1e-4).all() and (slacks <= program.row_upper + 1e-4).all()
    assert below.any()
