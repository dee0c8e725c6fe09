"""Contact schedules as text: there and back, shorthand, and messages that name the line."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gmr_traj.contacts.schedule import LIMB, ContactSchedule, Stance
from gmr_traj.contacts.schedule_json import from_json, to_json
from gmr_traj.exceptions import ScheduleError
from gmr_traj.robot import Robot
from gmr_traj.robot_loading import load_robot

FRAMES = 60
G1 = load_robot("unitree_g1")


@st.composite
def schedules(draw: st.DrawFn) -> ContactSchedule:
    stances = []
    for sole in G1.soles:
        for point, part in enumerate(sole.parts):
            edges = sorted(draw(st.sets(st.integers(0, FRAMES), max_size=8)))
            pairs = zip(edges[::2], edges[1::2], strict=False)
            stances += [Stance(sole.name, point, part, start, stop) for start, stop in pairs]
    height = draw(st.floats(-0.5, 0.5))
    return ContactSchedule(FRAMES, draw(st.floats(10.0, 120.0)), tuple(sorted(stances)), height)


@given(schedules())
def test_there_and_back(schedule: ContactSchedule) -> None:
    text = to_json(schedule)
    assert from_json(text, G1, frames=FRAMES, fps=schedule.fps) == schedule
    assert to_json(from_json(text, G1, frames=FRAMES, fps=schedule.fps)) == text
    assert text.count("\n") == len(schedule.stances) + 2  # one line each
    assert isinstance(json.loads(text), dict)


@given(schedules(), schedules())
def test_how_much_of_a_stance_is_seen(schedule: ContactSchedule, seen: ContactSchedule) -> None:
    text = to_json(schedule, seen)
    assert from_json(text, G1, frames=FRAMES, fps=schedule.fps) == schedule
    assert all(entry["seen"] == 1.0 for entry in json.loads(to_json(schedule, schedule))["stances"])
    for entry, own in zip(json.loads(text)["stances"], sorted(schedule.stances), strict=True):
        frames = set(range(own.start, own.stop))
        others = [s for s in seen.stances if (s.sole, s.point) == (own.sole, own.point)]
        shared = frames.intersection(*[set().union(*(range(s.start, s.stop) for s in others))])
        assert entry["seen"] == pytest.approx(len(shared) / len(frames), abs=0.006)


def read(*stances: dict[str, Any], frames: int = FRAMES, **head: Any) -> ContactSchedule:
    """From text with one stance a line, the first on line 2."""
    lines = ",\n".join(json.dumps(stance) for stance in stances)
    start = json.dumps({"frames": FRAMES, **head})[:-1]
    return from_json(f'{start}, "stances": [\n{lines}\n]}}', G1, frames=frames, fps=30.0)


def stance(**fields: Any) -> dict[str, Any]:
    return {"sole": "left", "point": 0, "start": 3, "stop": 9, **fields}


def hand(**fields: Any) -> dict[str, Any]:
    return {"support": "left_hand", "point": 1, "start": 3, "stop": 9, **fields}


def test_supports_that_are_no_soles() -> None:
    """They are named as such, have no parts, and come back the same; without a point every point is meant."""
    schedule = read(hand(), stance())
    assert Stance("left_hand", 1, LIMB, 3, 9) in schedule.stances and len(schedule.stances) == 2
    text = to_json(schedule)
    assert from_json(text, G1, frames=60, fps=30.0) == schedule
    line = next(line for line in text.splitlines() if "left_hand" in line)
    assert line.startswith('  {"support": "left_hand", "point": 1, "start": 3') and "part" not in line
    whole = read({"support": "left_hand", "start": 3, "stop": 9}).stances
    assert len(whole) == len(next(s for s in G1.supports if s.name == "left_hand").points)


def test_shorthand() -> None:
    """Without a point every point of the part, without a part the whole sole; what touches is joined."""
    sole = next(sole for sole in G1.soles if sole.name == "left")
    schedule = read({"sole": "left", "start": 3, "stop": 9}, {"sole": "left", "part": "heel", "start": 9, "stop": 12})
    assert len(schedule.stances) == len(sole.points)
    for found in schedule.stances:
        assert found.part == sole.parts[found.point]
        assert (found.start, found.stop) == (3, 12 if found.part == "heel" else 9)


def test_seconds_are_only_for_reading() -> None:
    assert read(stance(start_s=99.0, stop_s=-1.0)).stances[0].start == 3


def test_the_frame_rate_is_the_clips() -> None:
    assert read(stance(), fps=12.0).fps == 30.0


@pytest.mark.parametrize(
    ("stances", "message"),
    [
        ([stance(), stance(sole="tail", start=20, stop=30)], "line 3: .*has no sole 'tail'; it has left, right"),
        ([stance(point=9)], "line 2: .*no point 9; it has points 0 to 3"),
        ([stance(part="knee")], "line 2: .*no part 'knee'; it has heel, toe"),
        ([stance(point=0, part="heel"), stance(point=3, part="toe")], r"line \d: point \d .* belongs to the"),
        ([stance(start=9, stop=9)], "line 2: frames 9 to 9 are not a range"),
        ([stance(stop=61)], r"line 2: frames 3 to 61 .* stop <= 60"),
        ([stance(start=-1)], "line 2: frames -1"),
        ([stance(start=3.0)], "line 2: 'start' is 3.0; expected a whole number"),
        ([stance(start=True)], "line 2: 'start' is True"),
        ([stance(begin=3)], "line 2: a stance has no field 'begin'; it has sole, support, point"),
        (
            [stance(), stance(start=20, stop=30), stance(start=8, stop=12)],
            "line 4: .*overlaps the one on line 2 in frames 8 to 9",
        ),
        ([stance(), {"sole": "left", "start": 5, "stop": 7}], "line 3: .*overlaps the one on line 2 in frames 5 to 7"),
        (["left"], "line 2: expected a stance such as"),
        ([{"support": "tail", "start": 3, "stop": 9}], "line 2: .*has no support 'tail'; it has left_hand"),
        ([hand(point=9)], r"line 2: support 'left_hand' has no point 9; it has points 0 to \d"),
        ([hand(part="toe")], "line 2: support 'left_hand' has no parts"),
        ([hand(sole="left")], "line 2: a stance is of a sole or of a support"),
        ([stance(sole="left_hand")], "line 2: .*has no sole 'left_hand'"),
        ([hand(), hand(start=5)], "line 3: .*support 'left_hand' overlaps the one on line 2"),
    ],
)
def test_mistakes_name_their_line(stances: list[Any], message: str) -> None:
    with pytest.raises(ScheduleError, match=message):
        read(*stances)


def test_a_long_stance_overlaps_later_ones() -> None:
    with pytest.raises(ScheduleError, match=r"line 4: .*overlaps the one on line 2"):
        read(stance(start=0, stop=50), stance(point=1), stance(start=20, stop=30))


def test_heads() -> None:
    with pytest.raises(ScheduleError, match="for 60 frames but the clip has 61"):
        read(stance(), frames=61)
    with pytest.raises(ScheduleError, match="'height' is 'high'"):
        read(stance(), height="high")
    with pytest.raises(ScheduleError, match="has no field 'hieght'"):
        read(stance(), hieght=0.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"frames": 60,\n "stances": [\n {"sole": "left" "start": 1}]}', "line 3: not JSON: .*column 18"),
        ("[]", "expected an object with a list 'stances'"),
        ('{"frames": 60}', "expected an object with a list 'stances'"),
        ("", "line 1: not JSON"),
        ("[" * 5000, "line 1:"),
        ('{"frames": ' + "9" * 5000 + "}", "line 1:"),
    ],
)
def test_what_is_no_schedule(text: str, message: str) -> None:
    with pytest.raises(ScheduleError, match=message):
        from_json(text, G1, frames=60, fps=30.0)


def test_lines_are_counted_past_lists_of_the_same_name() -> None:
    """Only the object's own member counts, wherever else the word stands, and of two the last."""
    text = '{"height": 0, "stances": [\n[]], "frames": 60, "stances": [\n\n{"sole": "left", "start": 1, "stop": 99}]}'
    with pytest.raises(ScheduleError, match="line 4: frames 1 to 99"):
        from_json(text, G1, frames=60, fps=30.0)


def test_robots_of_the_tests_have_heels_and_toes(g1: Robot) -> None:
    assert {part for sole in g1.soles for part in sole.parts} == {"heel", "toe"}
