"""Contact schedules as JSON text that a person can read, edit and hand back.

    {"frames": 120, "fps": 30.0, "height": 0.012, "stances": [
      {"sole": "left", "point": 0, "part": "toe", "start": 12, "stop": 40, "start_s": 0.4, "stop_s": 1.333},
      ...
    ]}

Frames decide; the seconds are there for reading and are ignored, and so is ``seen``, where it is: the share of the
stance's frames in which height and speed of the point show it.  In the others the load speaks for it, or what stands
next to a spoiled end: the lower the share, the less sure.  ``stop`` is the first frame after the stance.  In a file
written by hand ``point`` may be left out, which means every point of that ``part``, and ``part`` may be left out too,
which means the whole sole; stances written this way may touch or repeat each other and are joined.

Stances of hands, knees and whatever else the robot declares have ``support`` instead of ``sole``, and no ``part``:

    {"support": "left_hand", "point": 1, "start": 20, "stop": 55, "start_s": 0.667, "stop_s": 1.833}
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from gmr_traj.contacts.json_lines import Element, parse_with_lines
from gmr_traj.contacts.schedule import LIMB, ContactSchedule, Stance
from gmr_traj.exceptions import ScheduleError
from gmr_traj.robot import Robot

_KEYS = ("sole", "support", "point", "part", "start", "stop", "start_s", "stop_s", "seen")


def to_json(schedule: ContactSchedule, seen: ContactSchedule | None = None) -> str:
    """Text of a schedule, one stance a line, sorted; the same schedule gives the same text.

    Args:
        schedule: what to write.
        seen: the stances that heights and speeds show; with it every stance says how much of it that is.
    """
    head = {"frames": schedule.frames, "fps": schedule.fps, "height": schedule.height}
    lines = [
        json.dumps(
            {
                **({"support": s.sole} if s.part == LIMB else {"sole": s.sole}),
                "point": s.point,
                **({} if s.part == LIMB else {"part": s.part}),
                "start": s.start,
                "stop": s.stop,
                "start_s": round(s.start / schedule.fps, 3),
                "stop_s": round(s.stop / schedule.fps, 3),
                **({} if seen is None else {"seen": _share(s, seen)}),
            }
        )
        for s in sorted(schedule.stances)
    ]
    stances = "".join(f"\n  {line}," for line in lines).rstrip(",")
    return json.dumps(head)[:-1] + f', "stances": [{stances}\n]}}\n'


def _share(stance: Stance, seen: ContactSchedule) -> float:
    """Share of a stance's frames that stances of the same point have in another schedule."""
    same = [s for s in seen.stances if (s.sole, s.point) == (stance.sole, stance.point)]
    shared = sum(max(0, min(s.stop, stance.stop) - max(s.start, stance.start)) for s in same)
    return round(shared / (stance.stop - stance.start), 2)


def from_json(text: str, robot: Robot, *, frames: int, fps: float) -> ContactSchedule:
    """Schedule of a clip from text.

    Args:
        text: JSON as ``to_json`` writes it, or edited by hand.
        robot: the robot whose soles and other supports are meant.
        frames: number of frames of the clip the schedule is for.
        fps: frame rate of that clip [Hz], which the schedule takes over.

    Raises:
        ScheduleError: the text is not JSON, or a stance names an unknown sole, support, point or part, lies outside the
            clip or overlaps another of the same point; the message starts with the line.
    """
    document, elements = parse_with_lines(text, "stances")
    _refuse_unknown(document, ("frames", "fps", "height", "stances"), 1, "the schedule")
    claimed = _integer(document, "frames", 1)
    if claimed != frames:
        raise ScheduleError(f"the schedule is for {claimed} frames but the clip has {frames}; detect its contacts anew")
    height = _number(document, "height", 1) if "height" in document else 0.0
    entries = [entry for element in elements for entry in _entries(element, robot, frames)]
    return ContactSchedule(frames=frames, fps=float(fps), stances=_merge(entries), height=height)


@dataclass(frozen=True)
class _Entry:
    stance: Stance
    line: int
    joinable: bool  # written without a point, so that it may touch or repeat another


def _entries(element: Element, robot: Robot, frames: int) -> list[_Entry]:
    """The stances one element of the list means: one, or one for each point of a part, of a sole or of a support."""
    line, item = element.line, element.value
    if not isinstance(item, dict):
        raise ScheduleError(f'line {line}: expected a stance such as {{"sole": "left", "start": 12, "stop": 40}}')
    _refuse_unknown(item, _KEYS, line, "a stance")
    what, name, parts = _support(item, robot, line)
    start, stop = _integer(item, "start", line), _integer(item, "stop", line)
    if not 0 <= start < stop <= frames:
        raise ScheduleError(
            f"line {line}: frames {start} to {stop} are not a range of the clip; expected 0 <= start < stop <= {frames}"
        )
    part = item.get("part")
    if part is not None and what == "support":
        raise ScheduleError(f"line {line}: support {name!r} has no parts; leave out the part")
    if part is not None and part not in parts:
        known = ", ".join(sorted(set(parts)))
        raise ScheduleError(f"line {line}: sole {name!r} has no part {part!r}; it has {known}")
    if item.get("point") is None:
        points = [k for k, p in enumerate(parts) if part in (None, p)]
        return [_Entry(Stance(name, k, parts[k], start, stop), line, True) for k in points]
    point = _integer(item, "point", line)
    if not 0 <= point < len(parts):
        last = len(parts) - 1
        raise ScheduleError(f"line {line}: {what} {name!r} has no point {point}; it has points 0 to {last}")
    own = parts[point]
    if part is not None and part != own:
        raise ScheduleError(f"line {line}: point {point} of sole {name!r} belongs to the {own}, not the {part}")
    return [_Entry(Stance(name, point, own, start, stop), line, False)]


def _merge(entries: list[_Entry]) -> tuple[Stance, ...]:
    """Sorted stances; overlaps are joined where neither names its point, and refused otherwise."""
    merged: list[_Entry] = []
    for entry in sorted(entries, key=lambda e: (e.stance, e.line)):
        last = merged[-1] if merged else None
        same = last is not None and (last.stance.sole, last.stance.point) == (entry.stance.sole, entry.stance.point)
        if last is not None and same and last.joinable and entry.joinable and entry.stance.start <= last.stance.stop:
            stop = max(last.stance.stop, entry.stance.stop)
            stance = Stance(last.stance.sole, last.stance.point, last.stance.part, last.stance.start, stop)
            merged[-1] = _Entry(stance, last.line, True)
        else:
            merged.append(entry)
    for a, b in pairwise(merged):
        same = (a.stance.sole, a.stance.point) == (b.stance.sole, b.stance.point)
        if same and b.stance.start < a.stance.stop:
            first, second = sorted((a.line, b.line))
            raise ScheduleError(
                f"line {second}: the stance of point {b.stance.point} of {_kind(b.stance)} {b.stance.sole!r} overlaps "
                f"the one on line {first} in frames {b.stance.start} to {min(a.stance.stop, b.stance.stop)}"
            )
    return tuple(entry.stance for entry in merged)


def _support(item: dict[str, Any], robot: Robot, line: int) -> tuple[str, str, tuple[str, ...]]:
    """Whether a stance is of a sole or of another support, its name, and the part that each of its points is of."""
    what = "support" if "support" in item else "sole"
    if what == "support" and "sole" in item:
        raise ScheduleError(f"line {line}: a stance is of a sole or of a support; leave out one of them")
    parts = {sole.name: sole.parts for sole in robot.soles}
    if what == "support":
        parts = {support.name: (LIMB,) * len(support.points) for support in robot.supports}
    name = item.get(what)
    if isinstance(name, str) and name in parts:
        return what, name, parts[name]
    known = ", ".join(parts) or "none"
    raise ScheduleError(f"line {line}: robot {robot.name} has no {what} {name!r}; it has {known}")


def _kind(stance: Stance) -> str:
    return "support" if stance.part == LIMB else "sole"


def _refuse_unknown(item: dict[str, Any], known: tuple[str, ...], line: int, what: str) -> None:
    for key in item:
        if key not in known:
            raise ScheduleError(f"line {line}: {what} has no field {key!r}; it has {', '.join(known)}")


def _integer(item: dict[str, Any], key: str, line: int) -> int:
    value = item.get(key)
    if not isinstance(value, int) or isinstance(value, bool):
        raise ScheduleError(f"line {line}: {key!r} is {value!r}; expected a whole number")
    return value


def _number(item: dict[str, Any], key: str, line: int) -> float:
    value = item.get(key)
    if not isinstance(value, int | float) or isinstance(value, bool) or not abs(value) < 10.0:
        raise ScheduleError(f"line {line}: {key!r} is {value!r}; expected metres, less than 10")
    return float(value)
