"""JSON objects with the line on which each element of one of their lists stands, for messages a person can act on."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from typing import Any

from gmr_traj.exceptions import ScheduleError

_SPACE = re.compile(r"[ \t\r\n]*")
_DECODER = json.JSONDecoder()


@dataclass(frozen=True)
class Element:
    """An element of the list and the line it starts on, counted from 1."""

    value: Any
    line: int


def parse_with_lines(text: str, key: str) -> tuple[dict[str, Any], list[Element]]:
    """The object in ``text`` and the elements of the list under ``key``, each with its line.

    Raises:
        ScheduleError: the text is not JSON, not an object, or has no such list; the message starts with the line.
    """
    try:
        document = json.loads(text)
    except json.JSONDecodeError as error:
        raise ScheduleError(f"line {error.lineno}: not JSON: {error.msg} (column {error.colno})") from error
    except RecursionError as error:
        raise ScheduleError("line 1: not a contact schedule: nested too deeply") from error
    except ValueError as error:  # an integer of thousands of digits
        raise ScheduleError(f"line 1: not a contact schedule: {error}") from error
    if not isinstance(document, dict) or not isinstance(document.get(key), list):
        raise ScheduleError(f"line 1: expected an object with a list {key!r}")
    return document, _elements(text, key)


def _elements(text: str, key: str) -> list[Element]:
    """Elements of the list, found by walking the object's own members; the text is known to be valid JSON.

    Of a repeated name the last counts, as in ``json.loads``.
    """
    found: list[Element] = []
    at = _skip(text, _skip(text, 0) + 1)
    while text[at] != "}":
        name, at = _DECODER.raw_decode(text, at)
        at = _skip(text, _skip(text, at) + 1)  # past the colon
        if name == key and text[at] == "[":
            found, at = _list(text, at)
        else:
            _, at = _DECODER.raw_decode(text, at)
        at = _skip(text, at)
        if text[at] == ",":
            at = _skip(text, at + 1)
    return found


def _list(text: str, at: int) -> tuple[list[Element], int]:
    found = []
    at = _skip(text, at + 1)
    while text[at] != "]":
        line = text.count("\n", 0, at) + 1
        value, at = _DECODER.raw_decode(text, at)
        found.append(Element(value, line))
        at = _skip(text, at)
        if text[at] == ",":
            at = _skip(text, at + 1)
    return found, at + 1


def _skip(text: str, at: int) -> int:
    match = _SPACE.match(text, at)
    assert match is not None  # the pattern matches the empty string
    return match.end()
