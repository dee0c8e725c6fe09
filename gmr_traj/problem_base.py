"""Problem files that say only where they differ from another one.

    base = "refine"                  # a problem that ships with gmr-traj, or a path beside this file
    without = ["contact_wrench"]     # terms of the base to leave out

Fields given here replace the base's; its ``otherwise`` is not taken over.  A term of a type that the base has takes the
fields that are not given from there; one of another type comes after the base's.  Tables of ``[solver]`` are replaced
whole, but for its options.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gmr_traj import resources
from gmr_traj.exceptions import ProblemError
from gmr_traj.toml_table import Table, read_toml


def problem_files(path: Path) -> tuple[Path, ...]:
    """A problem file and the bases it rests on.

    Raises:
        ResourceError: there is no such base.
        ProblemError: a file cannot be read, is not TOML, or is its own base.
    """
    found: list[Path] = []
    while True:
        table = read_toml(path, ProblemError)
        if path.resolve() in (known.resolve() for known in found):
            raise table.error("base: this problem is its own base; a base must be another problem")
        found.append(path)
        if "base" not in table.values:
            return tuple(found)
        beside = path.parent / table.text("base")
        path = beside if beside.suffix and beside.is_file() else resources.find("problems", table.text("base"))


def files_that_count(path: Path) -> tuple[Path, ...]:
    """A problem file, its bases, and those of the problem that may be solved instead.

    Raises:
        ResourceError: there is no such base, or no such other problem.
        ProblemError: as :func:`problem_files`.
    """
    own = problem_files(path)
    instead = read_toml(path, ProblemError).values.get("otherwise")
    others = problem_files(resources.find("problems", instead)) if isinstance(instead, str) and instead else ()
    return tuple(dict.fromkeys((*own, *others)))


def problem_values(path: Path) -> dict[str, Any]:
    """The values of a problem file, its bases' filled in.

    Raises:
        ResourceError: there is no such base.
        ProblemError: a file cannot be read, is not TOML, is its own base, or leaves out a term that its base has not.
    """
    *derived, root = problem_files(path)
    values = read_toml(root, ProblemError).values
    for file in reversed(derived):
        values = _changed(values, read_toml(file, ProblemError))
    return values


def _changed(values: dict[str, Any], table: Table) -> dict[str, Any]:
    """The values of a base with a file's own put over them."""
    own, name = table.values, table.text("base")
    left_out = table.texts("without") if "without" in own else ()
    inherited = list(values.get("terms", []))
    types = [term.get("type") for term in inherited]
    for kind in left_out:
        if kind not in types:
            raise table.error(f"without has {kind!r}; the terms of its base {name} are {', '.join(map(str, types))}")
    terms = [dict(term) for term in inherited if term.get("type") not in left_out]
    for entry in table.tables("terms", required=False):
        _put(terms, entry)
    solver = {**values.get("solver", {}), **table.table("solver", required=False).values}
    solver["options"] = {**values.get("solver", {}).get("options", {}), **solver.get("options", {})}
    # What to solve instead of the base may well be this very problem.
    kept = {key: value for key, value in values.items() if key != "otherwise"}
    changed = {key: value for key, value in own.items() if key not in ("base", "without", "terms", "solver")}
    return {**kept, **changed, "terms": terms, "solver": solver}


def _put(terms: list[dict[str, Any]], entry: Table) -> None:
    """Add a term, or change the one of its type; ``terms`` is changed in place."""
    kind = entry.text("type")
    alike = [term for term in terms if term.get("type") == kind]
    if len(alike) > 1:
        raise entry.error(f"({kind}) does not say which: its base has {len(alike)} of that type; leave them out first")
    if alike:
        alike[0].update(entry.values)
    else:
        terms.append(dict(entry.values))
