"""Frame rates from frame times that were printed with a few digits."""

from __future__ import annotations

import math
import re

from gmr_traj.exceptions import ClipError

# Rates that cameras and motion capture systems have, and the film and television rates next to whole ones.
_RATES: tuple[float, ...] = (
    *(10, 12, 15, 20, 24, 25, 30, 48, 50, 60, 72, 75, 80, 90, 96, 100, 120, 125, 144, 150, 180, 200, 240, 250, 300),
    *(360, 400, 480, 500, 600, 960, 1000),
)
_TELEVISION = (24000 / 1001, 30000 / 1001, 60000 / 1001, 120000 / 1001)
_DECIMAL = re.compile(r"[+]?[0-9]*\.?(?P<digits>[0-9]*)(?:[eE](?P<exponent>[+-]?[0-9]{1,3}))?")
_SLOWEST, _FASTEST = 0.01, 1e4  # [Hz]


def check_rate(rate: float) -> None:
    """Refuse what is no frame rate.

    Raises:
        ClipError: it is not finite, not positive, or out of all proportion.
    """
    if not _SLOWEST <= rate <= _FASTEST:
        raise ClipError(f"a frame rate of {rate:g} frames/s; set --fps to {_SLOWEST:g} to {_FASTEST:g}")


def frame_rate(text: str) -> tuple[float, str]:
    """Frames per second of a frame time, exact where its digits allow one sensible rate only.

    A time that is printed as 0.033333 stands for anything within one unit of its last digit.  Where ``1 / time`` is a
    whole number it is that; else the one usual rate within those bounds; else ``1 / time`` as it is.

    Args:
        text: the frame time as the file has it [s].

    Returns:
        The rate [Hz], and a sentence that says what was decided.

    Raises:
        ClipError: it is not a positive number.
    """
    match = _DECIMAL.fullmatch(text)
    time = float(text) if match and text.strip("+.") else math.nan
    if match is None or not 1e-6 < time < 1e3:
        raise ClipError(f"Frame Time is {text!r}; expected the seconds between two frames, e.g. 0.033333")
    exact = 1.0 / time
    if abs(exact - round(exact)) < 1e-9 * exact:
        return float(round(exact)), f"Frame Time {text} s is {round(exact)} frames/s"
    unit = 10.0 ** (int(match["exponent"] or 0) - len(match["digits"]))
    low, high = 1.0 / (time + unit), 1.0 / (time - unit) if time > unit else math.inf
    for rates in (_RATES, _TELEVISION):
        within = [rate for rate in rates if low <= rate <= high]
        if len(within) == 1:
            return float(within[0]), f"Frame Time {text} s taken for {within[0]:.6g} frames/s"
        if within:
            some = f"{', '.join(f'{r:g}' for r in within[:-1])} or {within[-1]:g}"
            return exact, f"Frame Time {text} s could be {some} frames/s; taken as {exact:.6g}, set --fps"
    return exact, f"Frame Time {text} s is {exact:.6g} frames/s"
