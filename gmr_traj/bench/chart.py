"""Measurements as a picture: bars of frames a second, and lines of the time a frame against the clip's length."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from gmr_traj.bench.figures import Figures
from gmr_traj.colours import RGB, ROLES
from gmr_traj.render.sheet import INK, PAPER, to_png
from gmr_traj.report.plot import ticks
from gmr_traj.text import number

WIDTH, LETTERS = 1000, 17
_LEFT, _RIGHT, _GAP = 190, 90, 16
_BAR, _PLOT = 30, 300  # heights [pixels]
_LINE, _SOFT = (227, 230, 234), (106, 113, 124)
_COLOURS = tuple(ROLES.values())


def chart(title: str, sides: Sequence[Figures], growth: Sequence[Figures]) -> bytes:
    """Draw what was measured; a PNG.

    Args:
        title: above all.
        sides: a bar each.
        growth: the same at several lengths: a line for each name.
    """
    heading = 3 * LETTERS
    bars_at = heading + 2 * LETTERS
    lines_at = bars_at + len(sides) * _BAR + 3 * LETTERS if sides else bars_at
    height = lines_at + _PLOT + 4 * LETTERS if growth else lines_at
    page = Image.new("RGB", (WIDTH, height), PAPER)
    pen = ImageDraw.Draw(page)
    font = ImageFont.load_default(LETTERS)
    pen.text((_GAP, LETTERS), title, fill=INK, font=font)
    colours = _colours(sides, growth)
    if sides:
        pen.text((_GAP, heading), "frames/s", fill=_SOFT, font=font)
        _bars(pen, bars_at, sides, colours, font)
    if growth:
        pen.text((_GAP, lines_at - 2 * LETTERS), "ms/frame, against the number of frames", fill=_SOFT, font=font)
        _lines(pen, lines_at, growth, colours, font)
    return to_png(page)


_Font = ImageFont.ImageFont | ImageFont.FreeTypeFont


def _colours(sides: Sequence[Figures], growth: Sequence[Figures]) -> dict[str, RGB]:
    """One for each name, the same in both."""
    names = dict.fromkeys(one.name for one in (*sides, *growth))
    return {name: _COLOURS[k % len(_COLOURS)] for k, name in enumerate(names)}


def _bars(pen: ImageDraw.ImageDraw, top: int, sides: Sequence[Figures], colours: dict[str, RGB], font: _Font) -> None:
    longest = max(one.frames_per_second for one in sides)
    for k, one in enumerate(sides):
        y = top + k * _BAR
        right = _LEFT + (WIDTH - _LEFT - _RIGHT) * one.frames_per_second / longest
        pen.text((_LEFT - _GAP, y + _BAR / 2), one.name, fill=INK, font=font, anchor="rm")
        pen.rectangle((_LEFT, y + 4, max(right, _LEFT + 1), y + _BAR - 4), fill=colours[one.name])
        pen.text((right + 8, y + _BAR / 2), f"{one.frames_per_second:.0f}", fill=INK, font=font, anchor="lm")


def _lines(pen: ImageDraw.ImageDraw, top: int, growth: Sequence[Figures], colours: dict[str, RGB], font: _Font) -> None:
    """Lengths on a logarithmic scale, times from zero."""
    lengths = sorted({one.frames for one in growth})
    low, high = np.log(lengths[0]), np.log(lengths[-1])
    most = 1.05 * max(one.milliseconds_per_frame for one in growth)

    def x(frames: int) -> float:
        share = (np.log(frames) - low) / (high - low) if high > low else 0.5
        return float(_LEFT + share * (WIDTH - _LEFT - _RIGHT - 120))

    def y(milliseconds: float) -> float:
        return top + _PLOT * (1.0 - milliseconds / most)

    for tick in ticks(0.0, most, 5):
        pen.line((_LEFT, y(tick), WIDTH - _RIGHT, y(tick)), fill=_LINE)
        pen.text((_LEFT - _GAP, y(tick)), number(tick), fill=_SOFT, font=font, anchor="rm")
    for frames in lengths:
        pen.text((x(frames), top + _PLOT + LETTERS), str(frames), fill=_SOFT, font=font, anchor="mm")
    for name in dict.fromkeys(one.name for one in growth):
        points = sorted((x(one.frames), y(one.milliseconds_per_frame)) for one in growth if one.name == name)
        pen.line(points, fill=colours[name], width=3)
        for px, py in points:
            pen.ellipse((px - 4, py - 4, px + 4, py + 4), fill=colours[name])
        pen.text((points[-1][0] + 10, points[-1][1]), name, fill=colours[name], font=font, anchor="lm")
