"""From what a file holds to a human motion: rig, unit, vertical axis, height and contacts, and what was decided."""

from __future__ import annotations

from gmr_traj.contacts.human_contacts import human_contacts
from gmr_traj.exceptions import ClipError
from gmr_traj.formats.human import rigs
from gmr_traj.formats.human.frame_rate import check_rate
from gmr_traj.formats.human.raw import RawHuman
from gmr_traj.formats.human.stature import standing_length
from gmr_traj.formats.human.units import check_unit, decide_unit, metres
from gmr_traj.formats.human.up_axis import check_up, decide_up, to_z_up
from gmr_traj.formats.units import continuous
from gmr_traj.human_motion import HumanMotion

_PEOPLE = (0.3, 3.0)  # heights [m]


def decide(
    raw: RawHuman,
    *,
    fps: float | None = None,
    height: float | None = None,
    up: str | None = None,
    unit: str | None = None,
    rig: str | None = None,
) -> HumanMotion:
    """A human motion in metres with Z up.

    Args:
        raw: what the file holds.
        fps: frame rate [Hz] that the user gives; it holds whatever the file has, as do the others.
        height: how tall the person is [m].
        up: vertical axis of the file.
        unit: unit of length of the file.
        rig: name of the rig.

    Raises:
        ClipError: a question stays open, or an answer does not fit the motion; names the option to set.
    """
    for given in (height, raw.height):
        if given is not None and not _PEOPLE[0] <= given <= _PEOPLE[1]:
            raise ClipError(f"a height of {given:g} m; set --height to what the person measures, in metres")
    notes = list(raw.notes)
    rig, names = _rig(raw, rig, notes)
    marks = rigs.landmarks(rig, names)
    length = None if marks is None else standing_length(names, raw.parents, raw.positions, marks)
    stature = length / (1.0 - marks.beyond) if marks is not None and length else None
    unit = _unit(raw, unit, stature, rig, height, notes)
    if up is None and raw.up is None:
        # The rigs that are known by their joint frames come from programs that put Y up.
        usual = raw.usual_up or ("y" if rig != rigs.UNKNOWN and raw.offsets is not None else None)
        up, note = decide_up(names, raw.positions, marks, usual)
        notes.append(note)
    up = up or raw.up or ""
    check_up(up)
    positions, quaternions = raw.positions * metres(unit), raw.quaternions
    if up == "y":
        positions, quaternions = to_z_up(positions, quaternions)
    height = _height(raw, height, None if stature is None else stature * metres(unit), notes)
    rate = raw.fps if fps is None else fps
    if rate is None:
        raise ClipError("the file has no frame rate; set --fps")
    check_rate(rate)
    if raw.fps is not None and rate != raw.fps:
        notes.append(f"{rate:g} frames/s, as given; the file says {raw.fps:g}")
    contacts = raw.contacts
    if not contacts and marks is not None:
        contacts = human_contacts(names, positions, rate, (marks.ankles, *((marks.toes,) if marks.toes else ())))
        notes.append(f"contacts detected from height and speed: {', '.join(contacts)}")
    return HumanMotion(
        rig=rig,
        names=names,
        parents=raw.parents,
        positions=positions,
        quaternions=continuous(quaternions),
        fps=float(rate),
        height=height,
        contacts=contacts,
        notes=tuple(notes),
    )


def _rig(raw: RawHuman, rig: str | None, notes: list[str]) -> tuple[str, tuple[str, ...]]:
    if rig is None and raw.rig is not None:
        return raw.rig, raw.names
    names = _without_prefix(raw.names, notes)
    found = rigs.recognise(names, raw.offsets if rig is None else None)
    if rig not in (None, found.rig):
        return rig or rigs.UNKNOWN, names
    notes += found.notes
    return found.rig, found.names


def _without_prefix(names: tuple[str, ...], notes: list[str]) -> tuple[str, ...]:
    """Names without a prefix that all of them have (``mixamorig:Hips``)."""
    prefix = names[0].rpartition(":")[0]
    if prefix and all(name.rpartition(":")[0] == prefix and name.rpartition(":")[2] for name in names):
        notes.append(f"the prefix {prefix}: was taken off the joints' names")
        return tuple(name.rpartition(":")[2] for name in names)
    return names


def _unit(
    raw: RawHuman, unit: str | None, stature: float | None, rig: str, height: float | None, notes: list[str]
) -> str:
    unit = unit or raw.unit
    if unit is None:
        unit, note = decide_unit(stature, rig, height)
        notes.append(note)
    elif stature is not None:
        check_unit(unit, stature)
    metres(unit)
    return unit


def _height(raw: RawHuman, height: float | None, stature: float | None, notes: list[str]) -> float:
    if height is not None:
        return height
    if raw.height is not None:
        return raw.height
    if stature is None:
        raise ClipError("no joints are known to be head and feet, so the person's height is open; set --height")
    notes.append(f"the person is {stature:.3f} m tall, by the bones from ankle to head")
    return stature
