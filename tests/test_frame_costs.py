"""A residual as a cost: value, gradient and Gauss-Newton Hessian against their definitions."""

from __future__ import annotations

import casadi as ca
import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from optimiser_setup import derivative, values

from gmr_traj.frame_costs import gauss_newton
from gmr_traj.residuals import FrameResidual, exceedance

BOUND = st.one_of(st.floats(-2, 2), st.just(np.inf), st.just(-np.inf))


def residual(lower: np.ndarray, upper: np.ndarray, weights: np.ndarray) -> FrameResidual:
    """Two rows of three unknowns and a parameter, curved, in two frames."""
    z, p = ca.SX.sym("z", 3), ca.SX.sym("p")
    rows = ca.vertcat(ca.sin(z[0]) + p * z[1] ** 2, z[2] * z[0] - p)
    return FrameResidual(
        name="curved",
        unit="1",
        rows=["a", "b"],
        frames=np.array([0, 1]),
        columns=np.array([[0, 1, 2], [2, 3, 4]]),
        parameters=np.array([[0.5, -1.5]]),
        value=ca.Function("r", [z, p], [rows], ["z", "p"], ["r"]),
        jacobian=ca.Function("J", [z, p], [ca.jacobian(rows, z)], ["z", "p"], ["J"]),
        lower=lower,
        upper=upper,
        weights=weights,
    )


def total(function: ca.Function, item: FrameResidual, parameters: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Results of a function of (z, p) for every frame, added up where the frames' unknowns are."""
    pairs = zip(item.columns, parameters.T, strict=True)
    out = [np.array(ca.densify(function(x[z], p))) for z, p in pairs]
    if out[0].size == 1:
        return np.sum(out, axis=0).ravel()
    sums = np.zeros((5,) * (1 if out[0].shape[1] == 1 else 2))
    for z, part in zip(item.columns, out, strict=True):
        if sums.ndim == 1:
            sums[z] += part.ravel()
        else:
            sums[np.ix_(z, z)] += np.triu(part) + np.triu(part, 1).T
    return sums


@given(st.tuples(*[BOUND] * 4), st.tuples(*[BOUND] * 4), st.tuples(*[st.floats(-2, 2)] * 5), st.integers(0, 9))
def test_cost_of_leaving_an_interval(
    one: tuple[float, ...], other: tuple[float, ...], x: tuple[float, ...], seed: int
) -> None:
    ends = np.sort(np.array([one, other]), axis=0).reshape(2, 2, 2)
    lower = np.where(np.isposinf(ends[0]), -np.inf, ends[0])
    upper = np.where(np.isneginf(ends[1]), np.inf, ends[1])
    item = residual(lower, upper, np.random.default_rng(seed).uniform(0.1, 3, (2, 2)))
    functions, parameters = gauss_newton(item)
    at = np.array(x)
    r = values(item, at)
    e = exceedance(r, lower, upper)
    expected = 0.5 * (item.weights * e**2).sum()
    np.testing.assert_allclose(total(functions.value, item, parameters, at), expected, atol=1e-9)
    hessian = total(functions.hessian, item, parameters, at)
    assert np.linalg.eigvalsh(hessian).min() > -1e-9
    kinks = np.minimum(np.abs(r - lower), np.abs(r - upper))
    if kinks.min() > 1e-4:
        numeric = derivative(lambda y: total(functions.value, item, parameters, y), at)[0]
        np.testing.assert_allclose(total(functions.gradient, item, parameters, at), numeric, atol=1e-6)
        jacobian = derivative(lambda y: values(item, y).ravel(), at)
        outside = ((r < lower) | (r > upper) | (lower == upper)).ravel() * item.weights.ravel()
        np.testing.assert_allclose(hessian, jacobian.T @ (outside[:, None] * jacobian), atol=1e-6)


def test_a_target_is_least_squares_on_both_sides() -> None:
    """Equal bounds: the Hessian does not vanish where the residual happens to meet its target."""
    at = np.array([0.3, -0.2, 0.5, 0.1, 0.4])
    goal = values(residual(np.zeros((2, 2)), np.zeros((2, 2)), np.ones((2, 2))), at)
    item = residual(goal, goal, np.ones((2, 2)))
    functions, parameters = gauss_newton(item)
    jacobian = derivative(lambda y: values(item, y).ravel(), at)
    assert total(functions.value, item, parameters, at) == 0.0
    np.testing.assert_allclose(total(functions.hessian, item, parameters, at), jacobian.T @ jacobian, atol=1e-7)


def test_functions_are_built_once() -> None:
    """A window or pass that brings the same residual back does not differentiate it again."""
    item = residual(np.zeros((2, 2)), np.ones((2, 2)), np.ones((2, 2)))
    again = FrameResidual(**{**item.__dict__, "lower": -np.ones((2, 2))})
    assert gauss_newton(item)[0] is gauss_newton(again)[0]
