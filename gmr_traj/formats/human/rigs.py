"""Rigs: what the names of a person's joints mean, and which joints are head, ankles and toes."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from gmr_traj import resources
from gmr_traj.exceptions import ClipError, ResourceError
from gmr_traj.toml_table import Table

UNKNOWN = "unknown"
_AWAY = np.cos(np.radians(20.0))  # a bone farther than this from its direction is of another rig
_BEYOND = 0.11  # of a rig that is not known; see configs/human_rigs.toml


@dataclass(frozen=True)
class Landmarks:
    """The joints that height, posture and contacts are read from.

    Attributes:
        head: head joint.
        ankles: left and right.
        toes: left and right ball of the foot; None where the rig has none.
        beyond: share of the stature above the head joint and below the ankle joint.
    """

    head: str
    ankles: tuple[str, str]
    toes: tuple[str, str] | None = None
    beyond: float = _BEYOND


@dataclass(frozen=True)
class Rig:
    """One entry of ``configs/human_rigs.toml``.

    Attributes:
        name: e.g. ``lafan1``.
        joints: names that motions of this rig come out with.
        landmarks: head, ankles and toes.
        spellings: other names for the same joints, in the same order.
        directions: unit vector from a joint's parent to the joint, in the parent's frame, at zero rotation.
    """

    name: str
    joints: tuple[str, ...]
    landmarks: Landmarks
    spellings: tuple[tuple[str, ...], ...] = ()
    directions: Mapping[str, np.ndarray] = field(default_factory=dict)


@dataclass(frozen=True)
class Recognised:
    """Which rig a set of names is, the names it gives them, and what is to be said about it."""

    rig: str
    names: tuple[str, ...]
    notes: tuple[str, ...] = ()


@cache
def rigs() -> Mapping[str, Rig]:
    """The rigs by name.

    Raises:
        ResourceError: the file is missing or has a wrong field.
    """
    path = resources.find("configs", "human_rigs")
    top = Table(path, "", tomllib.loads(path.read_text(encoding="utf-8")), ResourceError)
    found = {}
    for table in top.tables("rig"):
        joints, ankles = table.texts("joints"), table.texts("ankles")
        toes = table.texts("toes") if "toes" in table.values else None
        directions = table.table("directions", required=False)
        rig = Rig(
            name=table.text("name"),
            joints=joints,
            landmarks=Landmarks(
                table.text("head"),
                (ankles[0], ankles[-1]),
                None if toes is None else (toes[0], toes[-1]),
                table.number("beyond", above=0.0),
            ),
            spellings=tuple(tuple(map(str, names)) for names in table.get("spellings", [], required=False)),
            directions={joint: directions.point(joint) for joint in directions.values},
        )
        marks = (rig.landmarks.head, *ankles, *(toes or ()), *rig.directions)
        strange = [name for name in marks if name not in joints]
        if strange or any(len(names) != len(joints) for names in rig.spellings):
            raise table.error(
                f"names {strange[0]!r}, no joint of it" if strange else "has a spelling of another length"
            )
        table.done()
        found[rig.name] = rig
    top.done()
    return found


def recognise(names: Sequence[str], offsets: np.ndarray | None) -> Recognised:
    """The rig whose joints these are.

    Args:
        names: names of the joints.
        offsets: where each joint is in its parent's frame at zero rotation; None where that is not known.  # (J, 3)

    Returns:
        The rig's name and names, or ``unknown`` and the names as they are.
    """
    plain = [_plain(name) for name in names]
    for rig in rigs().values():
        for spelling in (rig.joints, *rig.spellings):
            if sorted(plain) != sorted(map(_plain, spelling)):
                continue
            canonical = dict(zip(map(_plain, spelling), rig.joints, strict=True))
            renamed = tuple(canonical[name] for name in plain)
            wrong = None if offsets is None else _misdirected(rig, renamed, offsets)
            if wrong is not None:
                why = f"the bone to {names[renamed.index(wrong)]} points another way at zero rotation"
                note = (
                    f"the joints have the names of rig {rig.name}, but other frames: {why}; it needs a map of its own"
                )
                return Recognised(UNKNOWN, tuple(names), (note,))
            if renamed == tuple(names):
                return Recognised(rig.name, renamed, (f"rig {rig.name}, by the names of its joints",))
            k = next(k for k in range(len(names)) if names[k] != renamed[k])
            note = f"rig {rig.name} in another spelling; joints renamed, e.g. {names[k]} is {renamed[k]}"
            return Recognised(rig.name, renamed, (note,))
    known = ", ".join(rigs())
    return Recognised(UNKNOWN, tuple(names), (f"rig unknown: its joints are those of none of {known}",))


def landmarks(rig: str, names: Sequence[str]) -> Landmarks | None:
    """Head, ankles and toes of a rig, or of any rig whose names say which they are; None where they do not.

    Raises:
        ClipError: the rig is known, but one of these joints is missing.
    """
    if rig in rigs():
        marks = rigs()[rig].landmarks
        for joint in (marks.head, *marks.ankles, *(marks.toes or ())):
            if joint not in names:
                raise ClipError(f"rig {rig} has a joint {joint!r}, this motion has not; name the right --rig, or none")
        return marks
    plain = {name: _plain(name) for name in names}
    head = next((name for name, text in plain.items() if text.endswith("head")), None)
    ankles = _pair(plain, ("ankle", "foot"))
    if head is None or ankles is None:
        return None
    toes = _pair(plain, ("toebase", "toe", "toes"))
    return Landmarks(head, ankles, toes)


def _plain(name: str) -> str:
    """A name without what differs between exporters: prefix, case, spaces, underscores."""
    return re.sub(r"[^0-9a-z]", "", name.rpartition(":")[2].lower())


def _pair(plain: Mapping[str, str], words: Sequence[str]) -> tuple[str, str] | None:
    """Left and right joint whose name ends in the first of the words that both sides have."""
    for word in words:
        sides: dict[str, str] = {}
        for name, text in plain.items():
            rest = text.removesuffix(word)
            for side in ("left", "right"):
                if text.endswith(word) and (side in rest or rest.endswith(side[0])):
                    sides.setdefault(side, name)
        if len(sides) == 2:
            return sides["left"], sides["right"]
    return None


def _misdirected(rig: Rig, names: Sequence[str], offsets: np.ndarray) -> str | None:
    """The first joint whose bone is not where the rig has it."""
    for joint, direction in rig.directions.items():
        bone = offsets[names.index(joint)]
        if bone @ direction < _AWAY * np.linalg.norm(bone) * np.linalg.norm(direction):
            return joint
    return None
