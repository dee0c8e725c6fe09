"""Ipopt's wrapper: attempts in turn, statuses, what it refuses."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from optimiser_setup import TIGHT

from gmr_traj import solver
from gmr_traj.attempts import Attempt, Solution, in_turn
from gmr_traj.exceptions import SolverError
from gmr_traj.solver import refused_options
from gmr_traj.transcription import Nlp

ONE_STEP = Attempt("one step", {"max_iter": 1})


def solve(nlp: Nlp, attempts: tuple[Attempt, ...]) -> Solution:
    return in_turn(attempts, nlp.initial, lambda attempt, start: solver.solve(nlp, attempt, start))


def program(f: ca.MX, x: ca.MX, g: ca.MX | None = None, *, start: list[float], upper: float = 0.0) -> Nlp:
    """``min f`` subject to ``g <= upper``, with exact derivatives."""
    g = ca.MX(0, 1) if g is None else g
    p, lam_f, lam_g = ca.MX.sym("p", 0), ca.MX.sym("lam_f"), ca.MX.sym("lam_g", g.numel())
    hessian = ca.hessian(lam_f * f + ca.dot(lam_g, g), x)[0]
    free = np.full(x.numel(), np.inf)
    return Nlp(
        problem={"x": x, "p": p, "f": f, "g": g},
        gradient=ca.Function("grad_f", [x, p], [f, ca.gradient(f, x)], ["x", "p"], ["f", "grad_f_x"]),
        jacobian=ca.Function("jac_g", [x, p], [g, ca.jacobian(g, x)], ["x", "p"], ["g", "jac_g_x"]),
        hessian=ca.Function(
            "hess_lag", [x, p, lam_f, lam_g], [ca.triu(hessian)], ["x", "p", "lam_f", "lam_g"], ["triu_hess_gamma_x_x"]
        ),
        initial=np.array(start),
        lower=-free,
        upper=free,
        row_lower=np.full(g.numel(), -np.inf),
        row_upper=np.full(g.numel(), upper),
    )


X = ca.MX.sym("x", 2)
ROSENBROCK = program((1 - X[0]) ** 2 + 100 * (X[1] - X[0] ** 2) ** 2, X, start=[-1.2, 1.0])
INFEASIBLE = program(ca.sumsqr(X), X, ca.sumsqr(X) + 1, start=[1.0, 1.0])


@given(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), st.floats(-3, 3))
def test_projection_onto_a_half_plane(point: tuple[float, float], upper: float) -> None:
    """``min |x - a|^2`` with ``x1 + x2 <= b``: the projection, and its value."""
    a = np.array(point)
    nlp = program(ca.sumsqr(X - a), X, X[0] + X[1], start=[0.0, 0.0], upper=upper)
    solution = solve(nlp, (TIGHT,))
    expected = a - max(0.0, a.sum() - upper) / 2
    assert solution.status == "converged" and solution.solver_status == "Solve_Succeeded"
    np.testing.assert_allclose(solution.x, expected, atol=1e-3)  # the bound may be active and weigh nothing
    assert solution.objective == pytest.approx(((expected - a) ** 2).sum(), abs=1e-3)


def test_attempts_go_on_from_where_the_last_one_stopped() -> None:
    alone = solve(ROSENBROCK, (TIGHT,))
    helped = solve(ROSENBROCK, (Attempt("ten steps", {"max_iter": 10}), TIGHT))
    first = solve(ROSENBROCK, (Attempt("ten steps", {"max_iter": 10}),))
    assert (first.status, first.solver_status) == ("not converged", "Maximum_Iterations_Exceeded")
    assert helped.status == "converged" and helped.strategy == "tight"
    np.testing.assert_allclose(helped.x, [1, 1], atol=1e-6)
    # Iterations of all attempts count, and the second one did not start over.
    assert first.iterations < helped.iterations < first.iterations + alone.iterations
    assert helped.seconds >= helped.evaluation_seconds > 0.0
    assert helped.evaluation_seconds + helped.linear_seconds == pytest.approx(helped.seconds)
    assert len(alone.trace["obj"]) == alone.iterations + 1


def test_a_converged_attempt_is_the_last() -> None:
    solution = solve(ROSENBROCK, (TIGHT, Attempt("never", {"max_iter": 0})))
    assert (solution.status, solution.strategy) == ("converged", "tight")


def test_an_acceptable_solution_is_the_last() -> None:
    loose = {"tol": 1e-12, "acceptable_tol": 1e2, "acceptable_iter": 1, "acceptable_dual_inf_tol": 1e9}
    solution = solve(ROSENBROCK, (Attempt("loose", loose), ONE_STEP))
    assert (solution.status, solution.strategy) == ("acceptable", "loose")
    assert solution.iterations == solve(ROSENBROCK, (Attempt("loose", loose),)).iterations


def test_what_has_no_solution_is_not_converged() -> None:
    solution = solve(INFEASIBLE, (TIGHT,))
    assert solution.status == "not converged" and solution.solver_status == "Infeasible_Problem_Detected"
    assert np.isfinite(solution.x).all()


def test_values_that_are_no_numbers_are_not_converged() -> None:
    solution = solve(program(ca.sqrt(X[0]) + X[1] ** 2, X, start=[-1.0, 0.0]), (TIGHT,))
    assert solution.status == "not converged" and np.isfinite(solution.x).all()


def test_equal_runs_are_equal_to_the_last_bit() -> None:
    one, other = solve(ROSENBROCK, (TIGHT,)), solve(ROSENBROCK, (TIGHT,))
    assert one.x.tobytes() == other.x.tobytes() and one.trace == other.trace


@pytest.mark.parametrize(
    ("option", "value"),
    [("tolerance", 1.0), ("tol", "small"), ("tol", -1.0), ("tol", [1.0]), ("mu_strategy", "bold"), ("max_iter", {})],
)
def test_options_ipopt_does_not_take(capfd: pytest.CaptureFixture[str], option: str, value: object) -> None:
    assert refused_options({"max_iter": 5, option: value}) == {option: value}
    assert capfd.readouterr() == ("", "")  # Ipopt's explanations stay out of the terminal


def test_a_linear_solver_that_is_not_there() -> None:
    assert refused_options({"linear_solver": "ma57", "tol": 1e-3}) == {"linear_solver": "ma57"}
    with pytest.raises(SolverError, match=r"Ipopt stopped with Invalid_Option \(strategy licensed\)"):
        solve(ROSENBROCK, (Attempt("licensed", {"linear_solver": "ma57"}),))


def test_options_that_pass_the_door_but_not_ipopt_are_one_line() -> None:
    with pytest.raises(SolverError, match=r"Ipopt refused the options of strategy typo: .*tolerance") as raised:
        solve(ROSENBROCK, (Attempt("typo", {"tolerance": 1.0}),))
    assert "\n" not in str(raised.value)


def test_no_strategy_is_an_error() -> None:
    with pytest.raises(SolverError, match="names no solver strategy"):
        solve(ROSENBROCK, ())


def test_an_interrupt_is_passed_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(solver, "INTERRUPTED", ("Solve_Succeeded",))
    with pytest.raises(KeyboardInterrupt):
        solve(ROSENBROCK, (TIGHT,))
