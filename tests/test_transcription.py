"""The sparse program: assembly, uses of a residual, bounds, held unknowns; all derivatives by finite differences."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given
from hypothesis import strategies as st
from metrics_toy import clip, standing
from optimiser_setup import EXAMPLE, TIGHT, built_parts, context_of, curved, linear, residuals_of, toy

from gmr_traj import assembly
from gmr_traj.assembly import SparseSum, to_dm
from gmr_traj.constraints import SOFT_SLOPE
from gmr_traj.engines import solve
from gmr_traj.exceptions import ProblemError
from gmr_traj.formats import read_clip
from gmr_traj.formulation import formulate
from gmr_traj.residuals import FrameResidual, LinearResidual, Used
from gmr_traj.robot import Robot
from gmr_traj.terms.tracking import Tracking
from gmr_traj.threads import VARIABLE
from gmr_traj.transcription import Nlp, transcribe
from gmr_traj.variables import Variables

ENTRIES = st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4), st.floats(-5, 5)), max_size=12)


def minimum(unknowns: int, *used: tuple[str, LinearResidual | FrameResidual]) -> np.ndarray:
    solution = solve(formulate(Variables(unknowns, 1), [Used(r, use) for use, r in used]), (TIGHT,))
    assert solution.status == "converged"
    return solution.x[:unknowns]


@given(ENTRIES, ENTRIES, st.booleans())
def test_sparse_sum_adds_up(
    constant: list[tuple[int, int, float]], symbolic: list[tuple[int, int, float]], upper: bool
) -> None:
    """Repeated places are summed; of a symmetric sum the lower entries land at their mirror place."""
    total, expected = SparseSum((5, 5), upper=upper), np.zeros((5, 5))
    x = ca.MX.sym("x", max(len(symbolic), 1))
    for entries in filter(None, (constant, symbolic)):
        i, j, v = (np.array(column) for column in zip(*entries, strict=True))
        if entries is constant:
            total.add_constant(i, j, v)
        else:
            total.add(i, j, x)
        np.add.at(expected, (np.minimum(i, j), np.maximum(i, j)) if upper else (i, j), v)
    numbers = np.array([v for _, _, v in symbolic] or [0.0])
    out = ca.Function("sum", [x], [total.total()])(numbers)
    np.testing.assert_allclose(np.array(ca.densify(out)), expected, atol=1e-12)
    assert out.nnz() == len({(min(i, j), max(i, j)) if upper else (i, j) for i, j, _ in constant + symbolic})


def test_constants_keep_their_sparsity() -> None:
    matrix = sp.csr_matrix(np.array([[0.0, 2.0, 0.0], [1.0, 0.0, 3.0]]))
    out = to_dm(matrix)
    np.testing.assert_array_equal(np.array(ca.densify(out)), matrix.toarray())
    assert out.nnz() == 3


@pytest.mark.parametrize("kind", ["linear", "curved"])
def test_cost_hard_and_soft_use_of_one_residual(kind: str) -> None:
    """Pulled to 2 with weight 1 and wanted at most at 1 (z^2 + z at most 2): each use has its closed form."""
    pull = linear(np.eye(1), np.array([2.0]), np.array([2.0]))

    def limit(upper: float = 1.0, target: bool = False, weight: float = 1e4) -> LinearResidual | FrameResidual:
        if kind == "linear":
            low = np.array([upper if target else -np.inf])
            return linear(np.eye(1), low, np.array([upper]), weight=weight)
        value = upper**2 + upper
        return curved(value if target else -np.inf, value, weight)

    assert minimum(1, ("cost", pull), ("hard", limit()))[0] == pytest.approx(1.0, abs=1e-6)
    soft = minimum(1, ("cost", pull), ("soft", limit()))[0]
    cost = minimum(1, ("cost", pull), ("cost", limit(target=True)))[0]
    # The slack's slope w rho exceeds the pull, so the soft limit is exact; the cost gives way by the pull over w.
    assert soft == pytest.approx(1.0, abs=1e-6)
    assert 1.0 < cost < 1.001
    if kind == "linear":
        # With w rho below the pull: x - 2 + w (rho + x - 1) = 0 with the slack x - 1; without the slope for the cost.
        for use, w, rho in (("soft", 10.0, SOFT_SLOPE), ("cost", 10.0, 0.0), ("cost", 1e4, 0.0)):
            found = minimum(1, ("cost", pull), (use, limit(target=use == "cost", weight=w)))[0]
            assert found == pytest.approx((2 + w * (1 - rho)) / (1 + w), abs=1e-6)
    # A limit that is not active changes nothing, whatever the use.
    for use in ("hard", "soft") + (("cost",) if kind == "curved" else ()):
        assert minimum(1, ("cost", pull), (use, limit(upper=3.0)))[0] == pytest.approx(2.0, abs=1e-6)


def test_single_entries_become_bounds() -> None:
    """Hard rows of one unknown are bounds, scaled by a factor of either sign; the tightest counts."""
    matrix = np.array([[2.0, 0, 0], [0, -4.0, 0], [1.0, 0, 0], [1.0, 1.0, 0]])
    low, high = np.array([-2.0, -8.0, -np.inf, -1.0]), np.array([6.0, np.inf, 1.5, 1.0])
    nlp = transcribe(formulate(Variables(3, 1), [Used(linear(matrix, low, high, offset=1.0), "hard")]))
    np.testing.assert_allclose(nlp.lower, [-1.5, -np.inf, -np.inf])
    np.testing.assert_allclose(nlp.upper, [0.5, 2.25, np.inf])
    np.testing.assert_allclose([nlp.row_lower, nlp.row_upper], [[-2.0], [0.0]])
    soft = transcribe(formulate(Variables(3, 1), [Used(linear(matrix, low, high), "soft")]))
    assert np.isinf(soft.lower[:3]).all() and len(soft.row_lower) == 4  # a soft row needs its slack
    assert not soft.lower[3:].any() and np.isposinf(soft.upper[3:]).all()


def test_a_soft_row_has_a_slack_for_each_bound_that_starts_where_it_is_needed() -> None:
    matrix, low, high = np.eye(3) * 2, np.array([-1.0, 4.0, -np.inf]), np.array([3.0, 5.0, -7.0])
    nlp = transcribe(formulate(Variables(3, 1), [Used(linear(matrix, low, high, offset=1.0), "soft")]))
    assert sorted(nlp.initial[3:]) == [0.0, 0.0, 0.0, 3.0, 8.0]  # five finite bounds; r = 1 is off by 3 and by 8
    g = np.array(nlp.jacobian(nlp.initial, [])[0]).ravel()
    assert (nlp.row_lower - 1e-12 <= g).all() and (g <= nlp.row_upper + 1e-12).all()


@given(st.floats(1e-3, 1e4))
def test_the_size_of_a_linear_rows_coefficients_does_not_matter(size: float) -> None:
    """Rates in rad/s^2 and steps in rad are the same constraint; Ipopt sees rows whose largest coefficient is one."""
    rows = linear(
        size * np.array([[1.0, -1.0], [0.25, 0.5]]), size * np.array([-1.0, -2.0]), size * np.array([1.0, 2.0])
    )
    nlp = transcribe(formulate(Variables(2, 1), [Used(rows, "hard")]))
    np.testing.assert_allclose(np.array(ca.densify(nlp.jacobian([0, 0], [])[1])), [[1, -1], [0.5, 1]], rtol=1e-12)
    np.testing.assert_allclose([nlp.row_lower, nlp.row_upper], [[-1, -4], [1, 4]], rtol=1e-12)


def test_rotations_of_the_base_reach_everything_but_a_full_turn() -> None:
    lower, upper = Variables(4, 9).bounds()
    lower, upper = lower.reshape(4, 9), upper.reshape(4, 9)
    assert np.isinf(np.delete(lower, [3, 4, 5], axis=1)).all() and np.isinf(np.delete(upper, [3, 4, 5], axis=1)).all()
    np.testing.assert_array_equal(lower, -upper)
    assert (upper[:, 3:6] >= np.pi).all()  # every rotation has a vector of at most half a turn
    assert (np.linalg.norm(upper[:, 3:6], axis=1) < 2 * np.pi).all()


def test_rows_without_a_bound_are_not_there() -> None:
    free = linear(np.ones((2, 3)), np.array([-np.inf, 0.0]), np.array([np.inf, np.inf]))
    assert len(transcribe(formulate(Variables(3, 1), [Used(free, "hard")])).row_lower) == 1


def test_the_start_is_inside_the_bounds() -> None:
    nlp = transcribe(formulate(Variables(1, 1), [Used(linear(np.eye(1), np.array([3.0]), np.array([4.0])), "hard")]))
    assert nlp.initial == [3.0]


def test_held_unknowns_are_held_whatever_the_limits_say() -> None:
    """What is held may be a rounding error beyond a limit: bounds and rows about it alone are left out."""
    variables = Variables(4, 1)
    variables.hold(np.array([0, 1]))
    steps = np.array([[-1.0, 1, 0, 0], [0, -1, 1, 0], [0, 0, -1, 1]])
    used = [
        Used(linear(np.eye(4), np.full(4, 1e-9), np.full(4, 5.0)), "hard"),
        Used(linear(steps, np.full(3, 1.0), np.full(3, 2.0)), "hard"),
        Used(curved(0.5, 9.0, 1.0, frames=4), "hard"),
        Used(linear(np.eye(4), np.zeros(4), np.zeros(4)), "cost"),
    ]
    formulation = formulate(variables, used)
    nlp = transcribe(formulation)
    np.testing.assert_array_equal([nlp.lower[:2], nlp.upper[:2]], np.zeros((2, 2)))
    np.testing.assert_array_equal([nlp.lower[2:], nlp.upper[2:]], [[1e-9] * 2, [5.0] * 2])
    assert len(nlp.row_lower) == 2 + 2
    x = solve(formulation, (TIGHT,)).x
    np.testing.assert_allclose(x, [0, 0, 1, 2], atol=1e-6)


def test_uses_that_cannot_be() -> None:
    interval = linear(np.eye(1), np.zeros(1), np.ones(1))
    with pytest.raises(ProblemError, match="linear: an interval on a linear residual can be hard or soft"):
        transcribe(formulate(Variables(1, 1), [Used(interval, "cost")]))
    (tracking,), variables = residuals_of(Tracking(1.0, 1.0, 1.0), context_of(toy(), clip(standing(2))))
    with pytest.raises(ProblemError, match="tracking can only be a cost, not hard"):
        transcribe(formulate(variables, [Used(tracking, "hard")]))
    apart = [Used(linear(np.eye(1), np.array([v]), np.array([v])), "hard") for v in (0.0, 1.0)]
    with pytest.raises(ProblemError, match="no value to unknown 0: it must be at least 1 and at most 0"):
        transcribe(formulate(Variables(1, 1), apart))


@pytest.fixture(params=["toy", "g1"])
def program(request: pytest.FixtureRequest) -> tuple[Nlp, np.ndarray]:
    """The problem that ships, over six frames with every kind of term active, and a point to look at it."""
    if request.param == "toy":
        robot, qpos = toy(), standing(6)
        qpos[:, 0], qpos[:, 9], qpos[3, 7] = 0.01 * np.arange(6), -1.0, 0.5
        motion = clip(qpos)
    else:
        robot = request.getfixturevalue("g1")
        recorded = read_clip(EXAMPLE, robot).motion
        motion = recorded.with_qpos(recorded.qpos[20:26])
    variables, used = built_parts(robot, motion)
    nlp = transcribe(formulate(variables, used))
    at = nlp.initial + 0.02 * np.random.default_rng(5).normal(size=len(nlp.initial))
    return nlp, at


def test_the_program_has_every_kind_of_term(g1: Robot) -> None:
    recorded = read_clip(EXAMPLE, g1).motion
    _, used = built_parts(g1, recorded.with_qpos(recorded.qpos[20:26]))
    kinds = {item.residual.name.partition("/")[0] for item in used}
    assert kinds >= {"tracking", "posture", "acceleration", "jerk", "stance", "ground", "self_collision"}
    assert kinds >= {"joint_position", "joint_velocity", "joint_acceleration"}


def test_gradient_and_jacobian_by_finite_differences(program: tuple[Nlp, np.ndarray]) -> None:
    """Along random directions: a single wrong entry of either would show."""
    nlp, at = program
    objective = ca.Function("f", [nlp.problem["x"]], [nlp.problem["f"]])
    _, gradient = nlp.gradient(at, [])
    g, jacobian = nlp.jacobian(at, [])
    scale, step = max(1.0, float(ca.norm_inf(gradient))), 1e-6
    assert g.numel() == len(nlp.row_lower) > 0
    for direction in np.random.default_rng(6).normal(size=(6, len(at))):
        ahead, behind = at + step * direction, at - step * direction
        numeric = float(objective(ahead) - objective(behind)) / (2 * step)
        assert float(ca.dot(gradient, direction)) == pytest.approx(numeric, abs=1e-6 * scale * len(at))
        rows = np.array(nlp.jacobian(ahead, [])[0] - nlp.jacobian(behind, [])[0]).ravel() / (2 * step)
        np.testing.assert_allclose(np.array(jacobian @ direction).ravel(), rows, atol=1e-4 * (1 + np.abs(rows).max()))


def test_hessian_is_positive_semidefinite_and_scales(program: tuple[Nlp, np.ndarray]) -> None:
    nlp, at = program
    multipliers = np.random.default_rng(7).normal(size=len(nlp.row_lower))
    upper = nlp.hessian(at, [], 1.0, multipliers)
    hessian = np.array(ca.densify(upper))
    assert np.array_equal(hessian, np.triu(hessian))
    hessian = hessian + np.triu(hessian, 1).T
    eigenvalues = np.linalg.eigvalsh(hessian)
    assert eigenvalues.min() > -1e-8 * eigenvalues.max()
    # The curvature of constraints is left out, and the factor of the objective counts.
    half = np.array(ca.densify(nlp.hessian(at, [], 0.5, 0 * multipliers)))
    np.testing.assert_allclose(half, 0.5 * np.triu(hessian), rtol=1e-12)


def test_hessian_of_least_squares_is_the_derivative_of_the_gradient() -> None:
    """Costs with models of their own are left out; of the others the stance's alone is not linear, and vanishes."""
    variables, used = built_parts(toy(), clip(standing(6)))
    costs = [item for item in used if item.use == "cost" and item.residual.name not in ("tracking", "contact_wrench")]
    assert {"posture", "stance/left"} <= {item.residual.name for item in costs}
    nlp = transcribe(formulate(variables, costs))
    upper = np.array(ca.densify(nlp.hessian(nlp.initial, [], 1.0, [])))
    step, numeric = 1e-5, []
    for h in step * np.eye(len(nlp.initial)):
        ahead, behind = nlp.gradient(nlp.initial + h, [])[1], nlp.gradient(nlp.initial - h, [])[1]
        numeric.append(np.array(ca.densify(ahead - behind)).ravel() / (2 * step))
    np.testing.assert_allclose(upper + np.triu(upper, 1).T, np.array(numeric), atol=1e-5 * np.abs(numeric).max())


def test_functions_mapped_over_threads_give_the_same_to_the_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    x = ca.SX.sym("x", 3)
    function = ca.Function("f", [x], [ca.sin(x) * ca.sumsqr(x) / 3])
    values = np.random.default_rng(0).normal(size=(3, 1001))
    monkeypatch.setenv(VARIABLE, "2")
    two = np.array(assembly.mapped(function, 1001)(values))
    monkeypatch.setenv(VARIABLE, "1")
    np.testing.assert_array_equal(np.array(assembly.mapped(function, 1001)(values)), two)
