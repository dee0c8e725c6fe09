"""Mehrotra's predictor-corrector method on the Gauss-Newton model of a program.

    min f(x)   s.t.  g(x) = s,   l <= w <= u   with  w = (x, s)

zl, zu >= 0 are the multipliers of the bounds; those of ``g(x) = s`` are ``zl_s - zu_s``.  A step solves

    (H + diag(Sigma_x) + J' diag(Sigma_s) J) dx = -r + tau_x + J' (tau_s - Sigma_s (g - s)),   ds = J dx + g - s,

    Sigma = zl / (w - l) + zu / (u - w),   r = grad f - J' (zl_s - zu_s) - zl_x + zu_x,
    tau = (sigma mu - e) / (w - l) - zl - (sigma mu + e') / (u - w) + zu,

first with sigma = e = e' = 0 (the predictor), whose outcome gives ``sigma = (mu_aff / mu)^3`` and the products of its
steps that the linearisation neglects, ``e = dw dzl`` and ``e' = dw dzu``.  Every step is taken, shortened to stay
inside the bounds, as in Ipopt's ``mehrotra_algorithm``, and where it raises the objective much once the rows are kept.
Where a row with one bound turns out to be farther inside than its slack s, the slack follows: that takes nothing from
the barrier and makes the row's residual zero, and one pair of capsules that swings around does not hold up the whole
clip.

Source: S. Mehrotra, On the implementation of a primal-dual interior point method, SIAM J. Optim. 2 (1992).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from gmr_traj.attempts import RANKING, STATUS, Attempt, Solution
from gmr_traj.band.bounds import Bounds
from gmr_traj.band.program import Program
from gmr_traj.band.settings import Settings

# Weight that keeps a held unknown where it is.
_HELD = 1e20

# Distances from bounds are taken for at least this, tried in turn: a row whose slack has gone to nothing while its
# multiplier is large weighs so much that the rest of the matrix is rounded away.
_LEAST = (0.0, 1e-11, 1e-9)

# Once the rows are kept, a step that raises the objective by more than this factor is halved, at most so many times:
# rows of the costs that were kept where the model was made, so that it knows nothing of them, may be in the way.
_RISE, _HALVINGS = 1.1, 4

# Share of a step from which on it counts for standing still.
_WHOLE = 0.3

_T = TypeVar("_T")


def solve(program: Program, attempt: Attempt, start: np.ndarray) -> Solution:
    """One attempt from a starting point.

    Raises:
        KeyboardInterrupt: passed on.
    """
    options: Any = attempt.options
    # What is no number is looked for in every iterate.
    with np.errstate(all="ignore"):
        return _solve(program, attempt.name, Settings(**options), start)


def _solve(program: Program, name: str, settings: Settings, start: np.ndarray) -> Solution:
    started = time.perf_counter()
    state = _State(program, settings, start)
    word = "Maximum_Iterations_Exceeded"
    iterations = 0
    while True:
        state.measure()
        if not state.finite:
            word = "Invalid_Number_Detected"
        elif state.converged:
            word = "Solve_Succeeded"
        elif state.acceptable:
            word = "Solved_To_Acceptable_Level"
        elif iterations < settings.max_iter:
            if state.advance():
                iterations += 1
                continue
            word = "Error_In_Step_Computation"
        break
    return Solution(
        x=state.best,
        status=STATUS.get(word, RANKING[-1]),
        solver_status=word,
        strategy=name,
        iterations=iterations,
        seconds=time.perf_counter() - started,
        evaluation_seconds=state.evaluating,
        linear_seconds=state.factoring,
        objective=state.value,
        trace={key: tuple(values) for key, values in state.trace.items()},
    )


class _State:
    """An iterate, with everything that is known of it."""

    def __init__(self, program: Program, settings: Settings, start: np.ndarray) -> None:
        self._program, self._settings = program, settings
        self.evaluating = self.factoring = 0.0
        self.trace: dict[str, list[float]] = {"obj": [], "inf_pr": [], "inf_du": [], "mu": []}
        self._held = np.flatnonzero(program.lower >= program.upper)
        lower, upper = program.lower.copy(), program.upper.copy()
        lower[self._held], upper[self._held] = -np.inf, np.inf
        # Rows that must be equal to something have no inside: they get as much as a row may be off by.
        slack = np.where(program.row_lower >= program.row_upper, 0.5 * settings.constr_viol_tol, 0.0)
        self._bounds = Bounds(
            np.concatenate([lower, program.row_lower - slack]), np.concatenate([upper, program.row_upper + slack])
        )
        inside = self._bounds.inside(np.concatenate([start, np.zeros(program.rows)]), settings.bound_push)
        self._evaluate(inside[: program.size])
        self._w = self._bounds.inside(np.concatenate([inside[: program.size], self._rows]), settings.bound_push)
        above, below = np.isfinite(program.row_lower), np.isfinite(program.row_upper)
        self._one_sided = np.flatnonzero(above & ~below), np.flatnonzero(below & ~above)
        self._zl, self._zu = self._bounds.multipliers(self._w, settings.bound_mult_init_val, settings.mu_init)
        self.best = start
        self._still = 0

    def _evaluate(self, x: np.ndarray) -> None:
        started = time.perf_counter()
        self.value, self._gradient, self._rows = self._program.at(x)
        self.evaluating += time.perf_counter() - started

    def _linear(self, action: Callable[..., _T], *given: np.ndarray) -> _T:
        """A part of solving linear systems, whose time is counted."""
        started = time.perf_counter()
        result = action(*given)
        self.factoring += time.perf_counter() - started
        return result

    def measure(self) -> None:
        """Violations, multipliers' residual and complementarity of the iterate."""
        n, bounds = self._program.size, self._bounds
        self._below, self._above = bounds.distances(self._w)
        force = bounds.spread(self._zl, -self._zu)
        self._residual = self._gradient - self._program.jacobian.T @ force[n:] - force[:n]
        self._residual[self._held] = 0.0
        self._gap = self._rows - self._w[n:]
        products = np.concatenate([self._zl * self._below, self._zu * self._above])
        self._mu = float(products.mean()) if products.size else 0.0
        self._largest = float(products.max(initial=0.0))
        self._violation = float(np.abs(self._gap).max(initial=0.0))
        self._dual = float(np.abs(self._residual).max(initial=0.0))
        self.finite = bool(np.isfinite(self.value + self._violation + self._dual))
        if self.finite:
            self.best = self._w[:n]
        for key, value in zip(self.trace, (self.value, self._violation, self._dual, self._mu), strict=True):
            self.trace[key].append(value)

    @property
    def converged(self) -> bool:
        s = self._settings
        return self._dual <= s.tol and self._violation <= s.constr_viol_tol and self._largest <= s.compl_inf_tol

    @property
    def acceptable(self) -> bool:
        s = self._settings
        off = self._violation > s.acceptable_constr_viol_tol or self._largest > s.acceptable_compl_inf_tol
        return self._still >= s.acceptable_iter and not off

    def advance(self) -> bool:
        """One step; False where the matrix was not positive definite."""
        n, bounds = self._program.size, self._bounds
        lower, upper = -self._zl, -self._zu
        for least in _LEAST:
            self._below, self._above = np.maximum(self._below, least), np.maximum(self._above, least)
            weight = bounds.spread(self._zl / self._below, self._zu / self._above)
            diagonal = weight[:n].copy()
            diagonal[self._held] += _HELD
            if self._linear(self._program.condense, diagonal, weight[n:], self._right(weight, lower, upper)):
                break
        else:
            return False
        dw, dzl, dzu = self._step(lower, upper, self._linear(self._program.factor.finish))
        primal = min(1.0, bounds.longest(self._below, self._above, dw))
        dual = min(_longest(self._zl, dzl), _longest(self._zu, dzu))
        change_below, change_above = bounds.of(dw)
        ahead = float((self._zl + dual * dzl) @ (self._below + primal * change_below))
        ahead += float((self._zu + dual * dzu) @ (self._above - primal * change_above))
        count = len(self._zl) + len(self._zu)
        centring = min(1.0, (ahead / count / self._mu) ** 3) if count and self._mu > 0.0 else 0.0
        lower += (centring * self._mu - change_below * dzl) / self._below
        upper += (centring * self._mu + change_above * dzu) / self._above
        dx = self._linear(self._program.factor.solve, self._right(weight, lower, upper))
        dw, dzl, dzu = self._step(lower, upper, dx)
        keep = min(max(0.99, 1.0 - self._mu), 1.0 - 1e-9)
        primal = min(1.0, keep * bounds.longest(self._below, self._above, dw))
        dual = min(1.0, keep * min(_longest(self._zl, dzl, np.inf), _longest(self._zu, dzu, np.inf)))
        here, before = self._w, self.value
        self._w = here + primal * dw
        self._zl, self._zu = self._zl + dual * dzl, self._zu + dual * dzu
        self._evaluate(self._w[:n])
        if self._violation <= self._settings.acceptable_constr_viol_tol:
            for _ in range(_HALVINGS):
                if self.value <= _RISE * before:
                    break
                primal *= 0.5
                self._w = here + primal * dw
                self._evaluate(self._w[:n])
        self._follow()
        still = abs(self.value - before) <= self._settings.acceptable_obj_change_tol * max(1.0, abs(self.value))
        # A step that the bounds cut short says nothing about how far the optimum is.
        self._still = self._still + 1 if still and min(primal, dual) >= _WHOLE else 0
        return True

    def _follow(self) -> None:
        """Move the slacks of rows that are farther inside their only bound than these."""
        slacks = self._w[self._program.size :]
        for where, farther in zip(self._one_sided, (np.maximum, np.minimum), strict=True):
            slacks[where] = farther(slacks[where], self._rows[where])

    def _right(self, weight: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
        """The right-hand side of a step with tau from its shares of lower and of upper bounds.  # (nx,)"""
        n = self._program.size
        tau = self._bounds.spread(lower, -upper)
        right = tau[:n] - self._residual + self._program.jacobian.T @ (tau[n:] - weight[n:] * self._gap)
        right[self._held] = 0.0
        return right

    def _step(self, lower: np.ndarray, upper: np.ndarray, dx: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Steps of w, zl and zu from that of x."""
        dx[self._held] = 0.0
        dw = np.concatenate([dx, self._program.jacobian @ dx + self._gap])
        change_below, change_above = self._bounds.of(dw)
        return dw, lower - self._zl * change_below / self._below, upper + self._zu * change_above / self._above


def _longest(value: np.ndarray, change: np.ndarray, most: float = 1.0) -> float:
    """The largest step, up to ``most``, that keeps positive values positive."""
    falling = change < 0
    return float(np.min(-value[falling] / change[falling], initial=most))
