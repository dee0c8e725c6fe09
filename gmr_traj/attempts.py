"""Strategies for one program, tried in turn, and what came of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gmr_traj.exceptions import SolverError

#: What words of the engines, which are Ipopt's, say of a solution; all others say that it is not converged.
STATUS = {"Solve_Succeeded": "converged", "Solved_To_Acceptable_Level": "acceptable"}

#: What a solution can be, the best first.
RANKING = ("converged", "acceptable", "not converged")


@dataclass(frozen=True)
class Attempt:
    """One strategy: a name, the engine that runs it and the engine's options."""

    name: str
    options: Mapping[str, object]
    engine: str = "ipopt"


@dataclass(frozen=True)
class Solution:
    """What an engine returned.

    Attributes:
        x: the unknowns.  # (nx,)
        status: ``converged``, ``acceptable`` or ``not converged``.
        solver_status: the engine's own word, one of Ipopt's.
        strategy: name of the attempt that gave this.
        iterations: of all attempts.
        seconds: wall-clock time of all attempts.
        evaluation_seconds: the part spent in function evaluations.
        linear_seconds: the part spent on linear systems; of Ipopt, all that is not spent in function evaluations.
        objective: f(x).
        trace: objective and infeasibilities by iteration, for plots.
    """

    x: np.ndarray
    status: str
    solver_status: str
    strategy: str
    iterations: int
    seconds: float
    evaluation_seconds: float
    linear_seconds: float
    objective: float
    trace: Mapping[str, tuple[float, ...]] = field(default_factory=dict)


def in_turn(attempts: Sequence[Attempt], start: np.ndarray, run: Callable[[Attempt, np.ndarray], Solution]) -> Solution:
    """Run the attempts, each from where the last one stopped, until one converges or is acceptable.

    Raises:
        SolverError: there is none.
    """
    if not attempts:
        raise SolverError("the problem names no solver strategy")
    solution: Solution | None = None
    for attempt in attempts:
        latest = run(attempt, start if solution is None else solution.x)
        if solution is not None:
            latest = replace(
                latest,
                iterations=solution.iterations + latest.iterations,
                seconds=solution.seconds + latest.seconds,
                evaluation_seconds=solution.evaluation_seconds + latest.evaluation_seconds,
                linear_seconds=solution.linear_seconds + latest.linear_seconds,
            )
        solution = latest
        if solution.status != "not converged":
            break
    assert solution is not None
    return solution
