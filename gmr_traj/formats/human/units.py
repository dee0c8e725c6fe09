"""The unit of length of a human motion: by how tall it makes the person."""

from __future__ import annotations

from collections.abc import Mapping

from gmr_traj.exceptions import ClipError

#: Metres in one unit, by the names ``--unit`` takes.
UNITS: Mapping[str, float] = {
    "m": 1.0,
    "cm": 0.01,
    "mm": 0.001,
    "in": 0.0254,
    "cmu": 0.0254 / 0.45,  # CMU's files: 0.45 units to the inch
}
_TALL = (1.1, 2.2)  # what people measure [m]; no two units put one skeleton in it
_ANY = (0.4, 3.0)  # where a unit was given, only what no person measures is refused [m]
_CLOSE = 0.25  # where the height was given: how far the skeleton's may be from it


def metres(unit: str) -> float:
    """Metres in a unit.

    Raises:
        ClipError: there is no such unit.
    """
    if unit not in UNITS:
        raise ClipError(f"there is no unit {unit!r}; --unit takes {', '.join(UNITS)}")
    return UNITS[unit]


def check_unit(unit: str, stature: float) -> None:
    """Refuse a unit that makes the person a giant or a dwarf.

    Args:
        unit: the unit that was given, or that the format fixes.
        stature: how tall the person is in the file's unit.

    Raises:
        ClipError: with the stature in metres.
    """
    tall = stature * metres(unit)
    if not _ANY[0] <= tall <= _ANY[1]:
        raise ClipError(f"with unit {unit} the person would be {tall:.3g} m tall; set --unit to {_list()}")


def decide_unit(stature: float | None, rig: str, height: float | None) -> tuple[str, str]:
    """The unit that makes the person as tall as people are.

    Args:
        stature: how tall the person is in the file's unit; None where the joints do not tell.
        rig: CMU's unit is taken for CMU's rig only.
        height: how tall the person is [m], where that is known.

    Returns:
        The unit, and a sentence that says why.

    Raises:
        ClipError: no unit does, or the joints do not tell; names ``--unit``.
    """
    if stature is None:
        raise ClipError(f"no joints are known to be head and feet, so the unit is open; set --unit to {_list()}")
    low, high = _TALL if height is None else (height * (1 - _CLOSE), height * (1 + _CLOSE))
    fitting = [u for u in UNITS if (u != "cmu" or rig == "cmu") and low <= stature * UNITS[u] <= high]
    if len(fitting) != 1:
        raise ClipError(
            f"the skeleton is {stature:.4g} units tall, which {' and '.join(fitting) or 'no unit'} would make a height "
            f"of {low:.2f} to {high:.2f} m; set --unit to {_list()}"
        )
    return fitting[0], f"unit {fitting[0]}: it makes the person {stature * UNITS[fitting[0]]:.2f} m tall"


def _list() -> str:
    return f"{', '.join(list(UNITS)[:-1])} or {list(UNITS)[-1]}"
