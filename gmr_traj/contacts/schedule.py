"""When which part of which sole, or which other support of the body, rests on the floor."""

from __future__ import annotations

from dataclasses import dataclass

#: Part of the stances of supports that are not soles: hands, knees, elbows, hips.
LIMB = "limb"


@dataclass(frozen=True, order=True)
class Stance:
    """One point of a sole, or of another support, at rest from frame ``start`` up to, not including, frame ``stop``.

    Attributes:
        sole: name of the sole (``left``), or of the support (``left_hand``).
        point: index into the sole's contact points, or into the support's balls.
        part: part of the sole the point belongs to (``heel`` or ``toe``), ``LIMB`` for a support.
        start, stop: frames, half open.
    """

    sole: str
    point: int
    part: str
    start: int
    stop: int


@dataclass(frozen=True)
class ContactSchedule:
    """All stances of one clip.

    Attributes:
        frames: number of frames of the clip.
        fps: its frame rate [Hz].
        stances: sorted by sole, point and start; stances of one point never overlap.
        height: how far the clip was raised to stand on the floor [m], once for the whole clip.
    """

    frames: int
    fps: float
    stances: tuple[Stance, ...]
    height: float = 0.0
