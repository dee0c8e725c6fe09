"""Reading robot.toml: the figures of a robot that its model file does not hold, checked field by field."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gmr_traj.exceptions import RobotError
from gmr_traj.robot import Capsule, Sole


@dataclass(frozen=True)
class JointFigures:
    """Limits and gains shared by the joints whose names match one of ``patterns`` (``*`` and ``?`` allowed)."""

    patterns: tuple[str, ...]
    velocity: float
    acceleration: float
    effort: float
    stiffness: float
    damping: float


@dataclass(frozen=True)
class KeyBodyFigures:
    """Tracking weights shared by the bodies whose names match one of ``patterns``."""

    patterns: tuple[str, ...]
    position_weight: float
    orientation_weight: float


@dataclass(frozen=True)
class IgnoredPair:
    """Two bodies whose shapes may overlap, and why that is right."""

    bodies: tuple[str, str]
    reason: str


@dataclass(frozen=True)
class RobotFile:
    """The content of one robot.toml, before it is held against the model."""

    path: Path
    name: str
    model: Path
    mesh_folder: Path | None
    ignore_missing_meshes: bool
    anchor_body: str
    joints: tuple[JointFigures, ...]
    nominal: dict[str, float]
    key_bodies: tuple[KeyBodyFigures, ...]
    soles: tuple[Sole, ...]
    capsules: tuple[Capsule, ...]
    ignore_within_joints: int
    ignored_pairs: tuple[IgnoredPair, ...]


class Table:
    """One TOML table with typed getters; every complaint names the file and the field."""

    def __init__(self, path: Path, where: str, values: Any) -> None:
        self.path, self.where = path, where
        if not isinstance(values, dict):
            raise self.error(f"is {values!r}; expected a table")
        self.values: dict[str, Any] = values
        self._seen: set[str] = set()

    def error(self, text: str) -> RobotError:
        """The error to raise about this table."""
        return RobotError(f"{self.path}: {self.where} {text}" if self.where else f"{self.path}: {text}")

    def get(self, key: str, default: Any = None, required: bool = True) -> Any:
        """The raw value of a field."""
        self._seen.add(key)
        if key not in self.values:
            if required:
                raise self.error(f"has no {key!r}" if self.where else f"has no {key!r}; every robot.toml needs one")
            return default
        return self.values[key]

    def text(self, key: str, default: str | None = None) -> str:
        """A string that is not empty."""
        value = self.get(key, default, required=default is None)
        if not isinstance(value, str) or (not value and default is None):
            raise self.error(f"{key} is {value!r}; expected a name")
        return value

    def texts(self, key: str) -> tuple[str, ...]:
        """A list of strings, at least one."""
        value = self.get(key)
        if not isinstance(value, list) or not value or not all(isinstance(v, str) and v for v in value):
            raise self.error(f"{key} is {value!r}; expected a list of names")
        return tuple(value)

    def number(self, key: str, default: float | None = None, lowest: float = 0.0, open_end: bool = True) -> float:
        """A finite number above ``lowest`` (or equal to it where not ``open_end``)."""
        value = self.get(key, default, required=default is None)
        ok = isinstance(value, (int, float)) and not isinstance(value, bool) and np.isfinite(value)
        if not ok or value < lowest or (open_end and value == lowest):
            raise self.error(f"{key} is {value!r}; expected a number {'above' if open_end else 'of at least'} {lowest:g}")
        return float(value)

    def flag(self, key: str, default: bool) -> bool:
        """True or false."""
        value = self.get(key, default, required=False)
        if not isinstance(value, bool):
            raise self.error(f"{key} is {value!r}; expected true or false")
        return value

    def points(self, key: str, required: bool = True) -> np.ndarray:
        """A list of points [m].  # (K, 3)"""
        value = self.get(key, [], required)
        try:
            array = np.array(value, dtype=float).reshape(-1, 3) if value == [] else np.array(value, dtype=float)
        except (TypeError, ValueError):
            array = np.empty(0)
        if array.ndim != 2 or array.shape[1] != 3 or not np.isfinite(array).all() or (required and len(array) == 0):
            raise self.error(f"{key} is {value!r}; expected a list of points [x, y, z] in metres")
        return array

    def point(self, key: str) -> np.ndarray:
        """One point [m].  # (3,)"""
        return Table(self.path, self.where, {key: [self.get(key)]}).points(key)[0]

    def tables(self, key: str, required: bool = True) -> list[Table]:
        """An array of tables."""
        value = self.get(key, [], required)
        if not isinstance(value, list) or (required and not value):
            raise self.error(f"{key} is {value!r}; expected [[{key}]] entries")
        return [Table(self.path, f"[[{key}]] entry {i + 1}:", v) for i, v in enumerate(value)]

    def done(self) -> None:
        """Complain about fields that mean nothing: most likely a typing mistake."""
        unknown = sorted(set(self.values) - self._seen)
        if unknown:
            raise self.error(f"has the unknown field {unknown[0]!r}; the fields are {', '.join(sorted(self._seen))}")


def read_robot_toml(path: Path) -> RobotFile:
    """Read a robot.toml.

    Raises:
        RobotError: the file cannot be read, is not TOML, or has a field that is missing, unknown or of the wrong kind.
    """
    try:
        values = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise RobotError(f"{path}: cannot be read ({error.strerror})") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise RobotError(f"{path}: is not valid TOML: {error}") from error
    top = Table(path, "", values)
    nominal = Table(path, "[nominal]", top.get("nominal"))
    collision = Table(path, "[collision]", top.get("collision", {}, required=False))
    mesh_folder = top.text("mesh_folder", "")
    within = collision.number("ignore_within_joints", 2.0, open_end=False)
    file = RobotFile(
        path=path,
        name=top.text("name"),
        model=path.parent / top.text("model"),
        mesh_folder=path.parent / mesh_folder if mesh_folder else None,
        ignore_missing_meshes=top.flag("ignore_missing_meshes", False),
        anchor_body=top.text("anchor_body"),
        joints=tuple(_joint(t) for t in top.tables("joints")),
        nominal={key: nominal.number(key, lowest=-np.inf) for key in nominal.values},
        key_bodies=tuple(_key_body(t) for t in top.tables("key_bodies")),
        soles=tuple(_sole(t) for t in top.tables("soles")),
        capsules=tuple(_capsule(t) for t in top.tables("capsules", required=False)),
        ignore_within_joints=int(within),
        ignored_pairs=tuple(_ignored(t) for t in collision.tables("ignore", required=False)),
    )
    collision.done()
    top.done()
    return file


def _joint(table: Table) -> JointFigures:
    figures = JointFigures(
        table.texts("names"),
        *(table.number(key) for key in ("velocity", "acceleration", "effort")),
        *(table.number(key, open_end=False) for key in ("stiffness", "damping")),
    )
    table.done()
    return figures


def _key_body(table: Table) -> KeyBodyFigures:
    weights = [table.number(key, 1.0, open_end=False) for key in ("position_weight", "orientation_weight")]
    figures = KeyBodyFigures(table.texts("bodies"), *weights)
    table.done()
    return figures


def _sole(table: Table) -> Sole:
    toe, heel = table.points("toe"), table.points("heel")
    points = np.vstack([toe, heel])
    plane = np.linalg.svd(points - points.mean(axis=0))[1]
    if len(points) > 3 and plane[2] > 1e-6:
        raise table.error("toe and heel points are not in one plane")
    sole = Sole(
        name=table.text("name"),
        body=table.text("body"),
        points=_frozen(points),
        parts=("toe",) * len(toe) + ("heel",) * len(heel),
        outline=_frozen(table.points("outline", required=False)),
    )
    table.done()
    return sole


def _capsule(table: Table) -> Capsule:
    start = table.point("start")
    end = table.point("end") if "end" in table.values else start
    capsule = Capsule(table.text("name"), table.text("body"), _frozen(start), _frozen(end), table.number("radius"))
    table.done()
    return capsule


def _ignored(table: Table) -> IgnoredPair:
    bodies = table.texts("bodies")
    if len(bodies) != 2:
        raise table.error(f"bodies is {list(bodies)}; expected two names")
    pair = IgnoredPair((bodies[0], bodies[1]), table.text("reason"))
    table.done()
    return pair


def _frozen(array: np.ndarray) -> np.ndarray:
    array = np.array(array, dtype=float)
    array.setflags(write=False)
    return array
