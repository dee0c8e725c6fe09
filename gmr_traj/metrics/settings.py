"""The numbers behind the artefact report and the certificate, read from ``configs/*.toml``."""

from __future__ import annotations

import tomllib
from pathlib import Path

from gmr_traj import resources
from gmr_traj.exceptions import ResourceError


class Settings:
    """A TOML file of tables of positive numbers; asking for one that is missing is an error that names it.

    Args:
        path: the file.

    Raises:
        ResourceError: where the file is not TOML, or holds anything but tables of finite numbers above 0.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            content = tomllib.loads(path.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise ResourceError(f"{path}: cannot be read as TOML: {error}") from error
        self._values: dict[tuple[str, str], float] = {}
        for table, entries in content.items():
            if not isinstance(entries, dict):
                raise ResourceError(f"{path}: {table} stands outside any table; write it under one, as [{table}]")
            for key, value in entries.items():
                number = isinstance(value, int | float) and not isinstance(value, bool)
                if not number or not 0.0 < value < float("inf"):
                    raise ResourceError(f"{path}: [{table}] {key} is {value!r}; it must be a number above 0")
                self._values[table, key] = float(value)

    def __call__(self, table: str, key: str) -> float:
        """One number."""
        try:
            return self._values[table, key]
        except KeyError:
            raise ResourceError(f"{self.path}: [{table}] {key} is missing") from None


def shipped(name: str) -> Settings:
    """The settings that ship as ``configs/<name>.toml``."""
    return Settings(resources.folder("configs") / f"{name}.toml")
