"""A plot as inline SVG: curves over time, a bar that must not be passed, shaded stretches.

An own hundred lines rather than matplotlib: the page needs one kind of plot, which stays sharp and small as SVG in a
page and whose text is text, and the package needs no further dependency.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from gmr_traj.colours import FAULT, LIMIT, RGB, hexadecimal
from gmr_traj.text import number

WIDTH, HEIGHT = 900, 190
LEFT, RIGHT, TOP, BOTTOM = 58, 14, 10, 26
TICKS_Y = 4  # at most about so many
PER_TICK = 90  # pixels from one to the next along the time axis, at least about


@dataclass(frozen=True)
class Curve:
    """Values over time, NaN where there are none."""

    name: str
    colour: RGB
    seconds: np.ndarray
    values: np.ndarray


@dataclass(frozen=True)
class Stretch:
    """A shaded stretch of time [s], with what is said when one points at it."""

    begin: float
    end: float
    text: str


def plot(
    title: str,
    curves: Sequence[Curve],
    stretches: Sequence[Stretch] = (),
    bar: float | None = None,
    span: tuple[float, float] | None = None,
    size: tuple[int, int] = (WIDTH, HEIGHT),
) -> str:
    """Draw a plot.

    Args:
        title: for those who cannot see it.
        curves: what is drawn, the last one on top.
        stretches: what is shaded.
        bar: a value to mark by a line.
        span: the time that is shown [s]; all of the curves otherwise.
        size: width and height [pixels].
    """
    begin, end = span or (0.0, max(float(curve.seconds[-1]) for curve in curves))
    if end <= begin:
        end = begin + 1.0  # a single frame
    low, high = _limits(curves, bar, begin, end)
    width, height = size

    def x(seconds: np.ndarray | float) -> np.ndarray:
        return LEFT + (np.asarray(seconds) - begin) / (end - begin) * (width - LEFT - RIGHT)

    def y(values: np.ndarray | float) -> np.ndarray:
        return TOP + (high - np.asarray(values)) / (high - low) * (height - TOP - BOTTOM)

    parts = [f'<svg viewBox="0 0 {width} {height}" role="img" aria-label="{escape(title)}">']
    for tick in ticks(low, high, TICKS_Y):
        at = float(y(tick))
        parts.append(f'<path class="grid" d="M{LEFT} {at:.1f}H{width - RIGHT}"/>')
        parts.append(f'<text class="y" x="{LEFT - 7}" y="{at + 4:.1f}">{number(tick)}</text>')
    for tick in ticks(begin, end, width // PER_TICK):
        at = float(x(tick))
        parts.append(f'<path class="grid" d="M{at:.1f} {TOP}V{height - BOTTOM}"/>')
        parts.append(f'<text class="x" x="{at:.1f}" y="{height - 9}">{tick:g} s</text>')
    for stretch in stretches:
        first, last = max(begin, stretch.begin), min(end, stretch.end)
        if first > last:
            continue
        thick = max(1.5, float(x(last) - x(first)))
        parts.append(
            f'<rect class="fault" x="{float(x(first)):.1f}" y="{TOP}" width="{thick:.1f}" '
            f'height="{height - TOP - BOTTOM}" fill="{hexadecimal(FAULT)}"><title>{escape(stretch.text)}</title></rect>'
        )
    if bar is not None:
        at = float(y(bar))
        parts.append(f'<path class="bar" d="M{LEFT} {at:.1f}H{width - RIGHT}" stroke="{hexadecimal(LIMIT)}"/>')
    for curve in curves:
        shown = (curve.seconds >= begin - 1e-9) & (curve.seconds <= end + 1e-9)
        line = _line(x(curve.seconds[shown]), y(curve.values[shown]))
        parts.append(f'<path class="curve" d="{line}" stroke="{hexadecimal(curve.colour)}"/>')
    parts.append("</svg>")
    return "".join(parts)


def ticks(low: float, high: float, most: int) -> list[float]:
    """Round numbers from ``low`` to ``high``, at most about ``most``: multiples of 1, 2 or 5 times a power of ten."""
    rough = (high - low) / most
    power = 10.0 ** math.floor(math.log10(rough))
    step = power * next(factor for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= rough * (1.0 - 1e-9))
    first = math.ceil(low / step - 1e-9)
    return [round(k * step, 12) for k in range(first, math.floor(high / step + 1e-9) + 1)]


def _limits(curves: Sequence[Curve], bar: float | None, begin: float, end: float) -> tuple[float, float]:
    """Least and largest value that the plot has room for: those of the curves, and the bar where it is not far off."""
    shown = [c.values[(c.seconds >= begin) & (c.seconds <= end) & np.isfinite(c.values)] for c in curves]
    values = np.concatenate(shown) if shown else np.zeros(0)
    low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 1.0)
    if bar is not None:
        low, high = min(low, bar), max(high, bar)
    room = 0.06 * (high - low) or 0.5 * abs(high) or 0.5
    return low - room, high + room


def _line(x: np.ndarray, y: np.ndarray) -> str:
    """Path through points in pixels; where there are many in one column of pixels, through its extremes."""
    parts = []
    finite = np.isfinite(y)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], finite, [False]]).astype(int)))
    for start, stop in edges.reshape(-1, 2).tolist():
        px, py = _thinned(x[start:stop], y[start:stop])
        points = " ".join(f"{a:.1f} {b:.1f}" for a, b in zip(px, py, strict=True))
        # A single point is a line of no length, which round caps show.
        parts.append(f"M{points}" if len(px) > 1 else f"M{points}h0")
    return "".join(parts)


def _thinned(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The first, last, least and largest point of every column of pixels, in order."""
    if len(x) < 3:
        return x, y
    column = np.floor(x).astype(int)
    starts = np.flatnonzero(np.diff(column, prepend=column[0] - 1))
    stops = np.append(starts[1:], len(x))
    kept = {
        index
        for start, stop in zip(starts.tolist(), stops.tolist(), strict=True)
        for index in (start, stop - 1, start + int(y[start:stop].argmin()), start + int(y[start:stop].argmax()))
    }
    order = np.array(sorted(kept))
    return x[order], y[order]
