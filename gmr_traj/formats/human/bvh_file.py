"""The text of a BVH file: a tree of joints and a table of channel values, read token by token.

Line ends, indentation and the number of values on a line mean nothing; one frame may take many lines.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from gmr_traj.exceptions import ClipError

_CHANNEL = re.compile(r"[xyz](position|rotation)", re.IGNORECASE)
_HEAD = re.compile(r"\s*Frames\s*:\s*(?P<frames>\S+)\s+Frame\s+Time\s*:\s*(?P<time>\S+)(?!\S)", re.IGNORECASE)
_LARGEST = 1e7  # no coordinate is 10 km in millimetres, no angle 10^7 degrees: beyond it, the file is damaged


@dataclass
class BvhJoint:
    """A joint: where it is in its parent's frame, and which columns of the table move it.

    Attributes:
        name: as in the file.
        parent: index of the parent, -1 for the root.
        offset: OFFSET, in the file's unit.
        channels: CHANNELS, each an axis and a kind, e.g. ``Xposition``, in the file's order.
        column: place of the first of them in the table.
    """

    name: str
    parent: int
    offset: tuple[float, ...] | None = None
    channels: list[str] = field(default_factory=list)
    column: int = 0


@dataclass(frozen=True)
class BvhFile:
    """What a BVH file says.

    Attributes:
        joints: parents before children; End Sites are not joints.
        values: channel values, in the file's unit and in degrees.  # (T, C)
        frame_time: the text of Frame Time [s]; its digits say how exact it is.
    """

    joints: tuple[BvhJoint, ...]
    values: np.ndarray
    frame_time: str


def parse(data: bytes) -> BvhFile:
    """Read the text of a BVH file.

    Raises:
        ClipError: it is cut or not BVH; the message says where.
    """
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")  # names in an old code page; all else is ASCII
    motion = re.search(r"(?<!\S)MOTION(?!\S)", text)
    if motion is None:
        raise ClipError("the BVH file has no MOTION section: it is cut, or not BVH; export it again")
    joints = _hierarchy(re.sub(r"([{}])", r" \1 ", text[: motion.start()]).split())
    head = _HEAD.match(text, motion.end())
    if head is None:
        what = text[motion.end() : motion.end() + 60].split()
        raise ClipError(f"MOTION starts with {' '.join(what)!r}; expected 'Frames: <count> Frame Time: <seconds>'")
    frames = _count(head["frames"], "Frames")
    if frames == 0:
        raise ClipError("Frames is 0: the BVH file holds a skeleton and no motion")
    return BvhFile(tuple(joints), _values(text[head.end() :].split(), frames, joints), head["time"])


class _Tokens:
    """The tokens of the hierarchy, one after the other."""

    def __init__(self, tokens: Sequence[str]) -> None:
        self.tokens, self.at = tokens, 0

    def next(self, wanted: str) -> str:
        if self.at == len(self.tokens):
            raise ClipError(f"the BVH hierarchy ends where {wanted} should follow: a brace or the end is missing")
        self.at += 1
        return self.tokens[self.at - 1]

    def name(self, joint: str) -> str:
        """Everything up to the brace that opens a joint."""
        words = []
        while (word := self.next(f"'{{' after {joint}")) != "{":
            words.append(word)
        return " ".join(words)

    def number(self, what: str) -> float:
        word = self.next(what)
        try:
            value = float(word)
        except ValueError:
            raise ClipError(f"{what} is {word!r}; expected a number") from None
        if not abs(value) < _LARGEST:
            raise ClipError(f"{what} is {word}, which is no length")
        return value


def _hierarchy(words: Sequence[str]) -> list[BvhJoint]:
    tokens = _Tokens(words)
    for wanted in ("HIERARCHY", "ROOT"):
        if (word := tokens.next(wanted)).upper() != wanted:
            raise ClipError(f"the BVH file has {word!r} where {wanted} should be")
    joints = [BvhJoint(tokens.name("ROOT"), -1)]
    end_site = BvhJoint("End Site", -1)
    stack, columns = [0], 0
    while stack:
        joint = end_site if stack[-1] < 0 else joints[stack[-1]]
        word = tokens.next(f"'}}' of joint {joint.name!r}")
        match word.upper():
            case "OFFSET":
                joint.offset = tuple(tokens.number(f"OFFSET of {joint.name!r}") for _ in range(3))
            case "CHANNELS" if joint is not end_site:
                joint.channels, joint.column = _channels(tokens, joint), columns
                columns += len(joint.channels)
            case "JOINT" if joint is not end_site:
                joints.append(BvhJoint(tokens.name("JOINT"), stack[-1]))
                stack.append(len(joints) - 1)
            case "END" if joint is not end_site:
                tokens.name("End Site")
                stack.append(-1)
            case "}":
                if joint.offset is None:
                    raise ClipError(f"joint {joint.name!r} has no OFFSET")
                stack.pop()
            case _:
                raise ClipError(f"joint {joint.name!r} has {word!r}; expected OFFSET, CHANNELS, JOINT, End Site or }}")
    if tokens.at < len(words):
        if words[tokens.at].upper() == "ROOT":
            raise ClipError("the BVH file has a second ROOT; save each person in a file of their own")
        raise ClipError(f"the BVH hierarchy goes on with {words[tokens.at]!r} after the root's closing brace")
    names = [joint.name for joint in joints]
    for name in names:
        if not name or names.count(name) > 1:
            raise ClipError(f"joint {name!r} is named twice; rename one" if name else "a joint has no name")
    if not columns:
        raise ClipError("no joint has CHANNELS: nothing moves")
    return joints


def _channels(tokens: _Tokens, joint: BvhJoint) -> list[str]:
    if joint.channels:
        raise ClipError(f"joint {joint.name!r} has CHANNELS twice")
    count = _count(tokens.next("the number of channels"), f"CHANNELS of {joint.name!r}")
    if count > 6:
        raise ClipError(f"joint {joint.name!r} has {count} channels; at most 3 positions and 3 rotations are read")
    channels = []
    for _ in range(count):
        word = tokens.next(f"a channel of {joint.name!r}")
        if not _CHANNEL.fullmatch(word):
            raise ClipError(
                f"joint {joint.name!r} has a channel {word!r}; expected Xposition, Yposition, Zposition, Xrotation, "
                "Yrotation or Zrotation, as many as the number before them says"
            )
        channels.append(word.capitalize())
    moved = [c for c in channels if c.endswith("position")]
    turned = [c for c in channels if c.endswith("rotation")]
    if len(set(moved)) < len(moved) or len(turned) > 3 or any(a == b for a, b in pairwise(turned)):
        raise ClipError(f"joint {joint.name!r} repeats a channel: {' '.join(channels)}")
    return channels


def _count(word: str, what: str) -> int:
    if not re.fullmatch(r"[0-9]{1,9}", word):
        raise ClipError(f"{what} is {word!r}; expected a whole number")
    return int(word)


def _values(words: list[str], frames: int, joints: Sequence[BvhJoint]) -> np.ndarray:
    columns = [f"{channel} of {joint.name!r}" for joint in joints for channel in joint.channels]
    width = len(columns)
    if len(words) != frames * width:
        whole, rest = divmod(len(words), width)
        raise ClipError(
            f"MOTION has {len(words)} values; Frames: {frames} of {width} channels make {frames * width}. It is "
            f"{whole} frames{f' and {rest} values' if rest else ''}: the file is cut, or a count in it is wrong"
        )
    try:
        values = np.array(words, dtype=np.float64)
    except ValueError:
        values = np.array([_number(word) for word in words])
    bad = np.flatnonzero(~(np.abs(values) < _LARGEST))
    if bad.size:
        frame, column = divmod(int(bad[0]), width)
        raise ClipError(f"frame {frame}: {columns[column]} is {words[bad[0]]!r}; expected a number")
    return values.reshape(frames, width)


def _number(word: str) -> float:
    """The number, or not a number where it is none."""
    try:
        return float(word)
    except ValueError:
        return float("nan")
