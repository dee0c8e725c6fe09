"""An optimisation problem as data: which terms, used as what, with which scales, solved how."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import Any

from gmr_traj import resources
from gmr_traj.attempts import Attempt
from gmr_traj.band.settings import Settings
from gmr_traj.engines import ENGINES
from gmr_traj.exceptions import ProblemError
from gmr_traj.problem_base import problem_values
from gmr_traj.solver import refused_options
from gmr_traj.terms import CONSTRAINTS, TERMS
from gmr_traj.terms.term import Term
from gmr_traj.toml_table import Table

# Fields that may be zero or negative; all others must be positive.
_ANY_SIGN = ("clearance", "margin", "rise", "free", "limb")


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
        otherwise: name or path of the problem to solve instead where a promise of the certificate is broken; None for
            none.
    """

    name: str
    path: Path
    terms: tuple[UsedTerm, ...]
    passes: int
    first: tuple[Attempt, ...]
    again: tuple[Attempt, ...]
    otherwise: str | None = None


def load_problem(name_or_path: str | Path = "refine") -> Problem:
    """Read ``problems/<name>.toml`` or a file of the user's own, what it takes from its ``base`` filled in.

    Raises:
        ResourceError: there is no such problem, or none of the name of its base or of the one to solve otherwise.
        ProblemError: the file or its base is not TOML, names an unknown term, use or field, a value out of range, no
            strategy, or an option that Ipopt does not take.
    """
    path = resources.find("problems", str(name_or_path))
    table = Table(path, "", problem_values(path), ProblemError)
    name = table.text("name")
    table.text("description", "")
    otherwise = table.text("otherwise", "") or None
    if otherwise is not None:  # said now, and not after the first problem was solved
        resources.find("problems", otherwise)
    passes = table.get("passes", 3, required=False)
    if not isinstance(passes, int) or isinstance(passes, bool) or not 1 <= passes <= 20:
        raise table.error(f"passes is {passes!r}; expected a whole number from 1 to 20")
    terms = tuple(_term(entry) for entry in table.tables("terms"))
    solver = table.table("solver")
    options = solver.table("options", required=False).values
    first, again = (tuple(_strategy(entry, options) for entry in solver.tables(key)) for key in ("first", "again"))
    solver.done()
    table.done()
    return Problem(name, path, terms, passes, first, again, otherwise)


def _term(table: Table) -> UsedTerm:
    name, use = table.text("type"), table.text("use")
    if name not in TERMS:
        raise table.error(f"has type {name!r}; there are {', '.join(sorted(TERMS))}")
    kind = TERMS[name]
    table.where += f" ({name})"
    if use not in kind.uses:
        raise table.error(f"has use {use!r}; it can be {', '.join(kind.uses)}")
    if use != "cost":
        kind = CONSTRAINTS.get(name, kind)
    given = [field.name for field in fields(kind) if field.default is MISSING or field.name in table.values]
    values = {name: _number(table, name) for name in given}
    table.done()
    term = kind(**values)
    if complaint := term.complaint():
        raise table.error(complaint)
    return UsedTerm(name, term, use)


def _number(table: Table, key: str) -> float:
    value = table.get(key)
    # A whole number in TOML may be too large for a float; comparing them is exact.
    good = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max
    if not good or (value <= 0 and key not in _ANY_SIGN):
        raise table.error(f"{key} is {value!r}; expected a {'' if key in _ANY_SIGN else 'positive '}number")
    return float(value)


def _strategy(table: Table, common: Mapping[str, Any]) -> Attempt:
    name, engine = table.text("name"), table.text("engine", "ipopt")
    if engine not in ENGINES:
        raise table.error(f"({name}) has engine {engine!r}; there are {', '.join(ENGINES)}")
    own = {option: value for option, value in table.values.items() if option not in ("name", "engine")}
    if engine == "band":
        return Attempt(name, _band_options(table, common, own), engine)
    refused = refused_options({**common, **own})
    if refused:
        option, value = next(iter(refused.items()))
        raise table.error(f"({name}): Ipopt does not take {option} = {value!r}; see Ipopt's list of options")
    return Attempt(name, {**common, **own})


def _band_options(table: Table, common: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """The engine's own options, and of the common ones those that it shares with Ipopt."""
    known = {field.name: type(field.default) for field in fields(Settings)}
    for option, value in own.items():
        if option not in known:
            raise table.error(f"has the unknown option {option!r} of engine band; there are {', '.join(known)}")
        whole = known[option] is int
        if isinstance(value, bool) or not isinstance(value, int if whole else int | float) or not 0 < value < math.inf:
            raise table.error(f"{option} is {value!r}; expected a positive {'whole ' if whole else ''}number")
    shared = {option: value for option, value in common.items() if option in known}
    return {**shared, **own}
