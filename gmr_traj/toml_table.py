"""Typed getters for a TOML table whose every complaint names the file and the field."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from gmr_traj.exceptions import GmrTrajError


class Table:
    """One TOML table, read field by field.

    Args:
        path: the file, named in messages.
        where: the table's place in the file, named in messages (empty for the top).
        values: what the TOML parser returned.
        error_type: class of the errors raised.

    Raises:
        GmrTrajError: (``error_type``, here and by every method) a field is missing or of the wrong kind.
    """

    def __init__(self, path: Path, where: str, values: Any, error_type: type[GmrTrajError]) -> None:
        self.path, self.where, self.error_type = path, where, error_type
        if not isinstance(values, dict):
            raise self.error(f"is {values!r}; expected a table")
        self.values: dict[str, Any] = values
        self._seen: set[str] = set()

    def error(self, text: str) -> GmrTrajError:
        """The error to raise about this table."""
        return self.error_type(f"{self.path}: {self.where} {text}" if self.where else f"{self.path}: {text}")

    def get(self, key: str, default: Any = None, required: bool = True) -> Any:
        """The raw value of a field."""
        self._seen.add(key)
        if key not in self.values:
            if required:
                raise self.error(f"has no {key!r}")
            return default
        return self.values[key]

    def text(self, key: str, default: str | None = None) -> str:
        """A string, not empty unless that is the default."""
        value = self.get(key, default, required=default is None)
        if not isinstance(value, str) or (not value and default is None):
            raise self.error(f"{key} is {value!r}; expected a text")
        return value

    def texts(self, key: str) -> tuple[str, ...]:
        """A list of strings, at least one."""
        value = self.get(key)
        if not isinstance(value, list) or not value or not all(isinstance(v, str) and v for v in value):
            raise self.error(f"{key} is {value!r}; expected a list of names")
        return tuple(value)

    def number(self, key: str, default: float | None = None, above: float | None = None) -> float:
        """A finite number, above ``above`` where that is given."""
        value = self.get(key, default, required=default is None)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not np.isfinite(value):
            raise self.error(f"{key} is {value!r}; expected a number")
        if above is not None and not value > above:
            raise self.error(f"{key} is {value!r}; expected a number above {above:g}")
        return float(value)

    def weight(self, key: str, default: float | None = None) -> float:
        """A number of zero or more."""
        value = self.number(key, default)
        if value < 0:
            raise self.error(f"{key} is {value!r}; expected a number of zero or more")
        return value

    def count(self, key: str, default: int) -> int:
        """A whole number of zero or more."""
        value = self.get(key, default, required=False)
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            raise self.error(f"{key} is {value!r}; expected a whole number of zero or more")
        return value

    def flag(self, key: str, default: bool) -> bool:
        """True or false."""
        value = self.get(key, default, required=False)
        if not isinstance(value, bool):
            raise self.error(f"{key} is {value!r}; expected true or false")
        return value

    def points(self, key: str, required: bool = True) -> np.ndarray:
        """A list of points, ``(K, 3)`` [m]; empty where it is absent and not required."""
        value = self.get(key, [], required)
        good = isinstance(value, list) and all(isinstance(p, list) and len(p) == 3 for p in value)
        if not good or not all(_is_number(x) for p in value for x in p) or (required and not value):
            raise self.error(f"{key} is {value!r}; expected a list of points [x, y, z]")
        return np.array(value, dtype=float).reshape(-1, 3)

    def point(self, key: str) -> np.ndarray:
        """One point, ``(3,)`` [m]."""
        value = self.get(key)
        if not isinstance(value, list) or len(value) != 3 or not all(_is_number(x) for x in value):
            raise self.error(f"{key} is {value!r}; expected a point [x, y, z]")
        return np.array(value, dtype=float)

    def table(self, key: str, required: bool = True) -> Table:
        """A table within this one; empty where it is absent and not required."""
        return Table(self.path, f"[{self._inner(key)}]", self.get(key, {}, required), self.error_type)

    def tables(self, key: str, required: bool = True) -> list[Table]:
        """An array of tables; empty where it is absent and not required."""
        value, inner = self.get(key, [], required), self._inner(key)
        if not isinstance(value, list) or (required and not value):
            raise self.error(f"{key} is {value!r}; expected [[{inner}]] entries")
        return [Table(self.path, f"[[{inner}]] entry {i + 1}", v, self.error_type) for i, v in enumerate(value)]

    def done(self) -> None:
        """Complain about fields that nothing has asked for: most likely a typing mistake."""
        unknown = sorted(set(self.values) - self._seen)
        if unknown:
            fields = ", ".join(sorted(self._seen))
            raise self.error(f"has the unknown field {unknown[0]!r}; the fields are {fields}")

    def _inner(self, key: str) -> str:
        return f"{self.where.strip('[]')}.{key}" if self.where else key


def read_toml(path: Path, error_type: type[GmrTrajError]) -> Table:
    """The top table of a TOML file.

    Raises:
        GmrTrajError: (``error_type``) the file cannot be read or is not TOML.
    """
    try:
        values = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise error_type(f"{path}: cannot be read: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise error_type(f"{path}: is not valid TOML: {error}") from error
    return Table(path, "", values, error_type)


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and bool(np.isfinite(value))
