"""An optimisation problem as data: which terms, used as what, with which scales, solved how."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from gmr_traj import resources
from gmr_traj.exceptions import ProblemError
from gmr_traj.solver import Attempt
from gmr_traj.terms import TERMS
from gmr_traj.terms.term import Term
from gmr_traj.toml_table import Table

# Fields that may be zero; all others must be positive.
_MAY_BE_ZERO = ("clearance", "margin")


@dataclass(frozen=True)
class UsedTerm:
    """A term and what it is used as: ``cost``, ``hard`` or ``soft``."""

    name: str
    term: Term
    use: str


@dataclass(frozen=True)
class Problem:
    """A problem file, read and checked.

    Attributes:
        name: of the problem.
        path: where it was read from.
        terms: in the order of the file.
        passes: how often at most the problem is solved again about its own solution, for constraints that turn out
            to matter where they were not built.
        first: strategies for the first solve, each tried from where the last one stopped.
        again: strategies for a solve that starts near the solution.
    """

    name: str
    path: Path
    terms: tuple[UsedTerm, ...]
    passes: int
    first: tuple[Attempt, ...]
    again: tuple[Attempt, ...]


def load_problem(name_or_path: str | Path = "refine") -> Problem:
    """Read ``problems/<name>.toml`` or a file of the user's own.

    Raises:
        ResourceError: there is no such problem; the message lists those that exist.
        ProblemError: the file is not TOML, or names an unknown term, use, field or strategy.
    """
    path = resources.find("problems", str(name_or_path))
    try:
        content = tomllib.loads(path.read_text())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ProblemError(f"{path}: this is not TOML: {error}") from None
    table = Table(path, "", content, ProblemError)
    name = table.text("name")
    passes = table.get("passes", 3, required=False)
    if not isinstance(passes, int) or isinstance(passes, bool) or not 1 <= passes <= 20:
        raise table.error(f"passes is {passes!r}; expected a whole number from 1 to 20")
    entries = table.get("terms")
    if not isinstance(entries, list) or not entries:
        raise table.error("has no [[terms]]; expected at least one")
    terms = tuple(_term(Table(path, f"terms[{k}]", entry, ProblemError)) for k, entry in enumerate(entries))
    solver = Table(path, "solver", table.get("solver"), ProblemError)
    known = {"name", "description", "passes", "terms", "solver"}
    for key in content:
        if key not in known:
            raise table.error(f"has an unknown field {key!r}; known are {', '.join(sorted(known))}")
    return Problem(name, path, terms, passes, _strategies(solver, "first"), _strategies(solver, "again"))


def _term(table: Table) -> UsedTerm:
    name, use = table.text("type"), table.text("use")
    if name not in TERMS:
        raise table.error(f"has type {name!r}; there are {', '.join(sorted(TERMS))}")
    kind = TERMS[name]
    if use not in kind.uses:
        raise table.error(f"uses {name} as {use!r}; it can be {', '.join(kind.uses)}")
    wanted = [field.name for field in fields(kind)]
    for key in table.values:
        if key not in (*wanted, "type", "use"):
            raise table.error(f"({name}) has an unknown field {key!r}; known are {', '.join(wanted)}")
    return UsedTerm(name, kind(**{key: _number(table, key) for key in wanted}), use)


def _number(table: Table, key: str) -> float:
    value = table.get(key)
    lowest = 0.0 if key in _MAY_BE_ZERO else None
    good = isinstance(value, int | float) and not isinstance(value, bool) and abs(float(value)) < float("inf")
    if not good or (value < 0 if lowest == 0.0 else value <= 0):
        raise table.error(f"{key} is {value!r}; expected a {'non-negative' if lowest == 0.0 else 'positive'} number")
    return float(value)


def _strategies(solver: Table, key: str) -> tuple[Attempt, ...]:
    entries = solver.get(key)
    if not isinstance(entries, list) or not entries:
        raise solver.error(f"{key} is {entries!r}; expected at least one strategy, [[solver.{key}]]")
    out = []
    common: Mapping[str, Any] = solver.get("options", {}, required=False)
    for k, entry in enumerate(entries):
        table = Table(solver.path, f"solver.{key}[{k}]", entry, ProblemError)
        options = {**common, **{option: value for option, value in table.values.items() if option != "name"}}
        out.append(Attempt(table.text("name"), options))
    return tuple(out)
