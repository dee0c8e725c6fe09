"""A problem whose engine is chosen, for measuring one engine against another."""

from __future__ import annotations

from dataclasses import replace

from gmr_traj.exceptions import BenchError
from gmr_traj.problem import Problem


def engines(problem: Problem) -> tuple[str, ...]:
    """Engines that the problem can be solved with alone, in the order in which it names them."""
    again = {attempt.engine for attempt in problem.again}
    return tuple(dict.fromkeys(attempt.engine for attempt in problem.first if attempt.engine in again))


def with_engine(problem: Problem, engine: str) -> Problem:
    """The same problem without the attempts of other engines.

    Raises:
        BenchError: no attempt is left.
    """
    kept = {
        name: tuple(attempt for attempt in attempts if attempt.engine == engine)
        for name, attempts in (("first", problem.first), ("again", problem.again))
    }
    for name, attempts in kept.items():
        if not attempts:
            has = ", ".join(dict.fromkeys(attempt.engine for attempt in getattr(problem, name)))
            raise BenchError(f"{problem.path}: no [[solver.{name}]] has engine {engine!r}; they have {has}")
    return replace(problem, first=kept["first"], again=kept["again"])
