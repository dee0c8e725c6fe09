"""What was measured, as tables for the terminal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rich.markup import escape
from rich.table import Table

from gmr_traj.bench.figures import Figures
from gmr_traj.cli.tables import plain_table
from gmr_traj.text import number

_COLUMNS = (">frames", ">iter.", ">frames/s", ">ms/frame", ">ms/frame/iter.", ">eval.", ">linear")
_MORE_COLUMNS = (">first s", ">start-up s", ">peak MB", ">status")
BUSY = 0.9  # share of its time that a process which never waits has a processor for, on an idle machine more
EXPLAINED = (
    "frames/s are of the second time in a process; what the first took more (it writes the robot's functions down) is "
    "start-up, with all loading before it",
    "iter.: iterations of the solver, or inverse kinematics steps a frame; an iteration is function evaluation, linear "
    "systems (for Ipopt: all that is not evaluation), and the rest of refine",
)


def lines(
    title: str, repeats: int, sides: Sequence[Figures], growth: Sequence[Figures], skipped: dict[str, str]
) -> Iterator[str | Table]:
    """Everything to print, one thing after the other."""
    times = "once" if repeats == 1 else f"medians of {repeats} processes"
    yield f"{title}, {times}"
    if sides:
        yield side_by_side(sides)
    found = {one.name: one for one in sides}
    if {"end-to-end", "gmr-loop"} <= set(found):
        wall, cpu = (_ratio(found["end-to-end"], found["gmr-loop"], clock) for clock in ("seconds", "cpu_seconds"))
        yield f"end to end: {wall:.2f} times the frames/s of gmr-loop (by processor time: {cpu:.2f})"
    if growth:
        yield "\nrefine, other lengths"
        yield growing(growth)
    for name, why in skipped.items():
        yield f"not measured: {name}: {why}"
    yield from EXPLAINED
    share = min((one.median("cpu_seconds") / one.median("seconds") for one in (*sides, *growth)), default=1.0)
    if share < BUSY:
        yield f"the machine was busy: a measurement had a processor for {share:.0%} of its time; quieter, it is faster"


def side_by_side(figures: Sequence[Figures]) -> Table:
    """A line a measurement."""
    table = plain_table("", *_COLUMNS, *_MORE_COLUMNS)
    for one in figures:
        table.add_row(escape(one.name), *_cells(one))
    return table


def growing(figures: Sequence[Figures]) -> Table:
    """A line a length, with the time a frame relative to that of the engine's shortest."""
    table = plain_table("", *_COLUMNS, *_MORE_COLUMNS, ">relative")
    shortest: dict[str, float] = {}
    for one in figures:
        relative = one.milliseconds_per_frame / shortest.setdefault(one.name, one.milliseconds_per_frame)
        table.add_row(escape(one.name), *_cells(one), f"{relative:.2f}")
    return table


def _cells(one: Figures) -> tuple[str, ...]:
    split = (one.milliseconds(field) for field in ("seconds", "evaluation_seconds", "linear_seconds"))
    return (
        str(one.frames),
        number(one.median("iterations")),
        f"{one.frames_per_second:.0f}",
        number(one.milliseconds_per_frame),
        *("" if value is None else number(value) for value in split),
        f"{one.median('first_seconds'):.2f}",
        f"{one.median('startup_seconds'):.2f}",
        f"{one.median('peak_megabytes'):.0f}",
        one.status,
    )


def _ratio(one: Figures, other: Figures, clock: str) -> float:
    """Frames a second of one as a share of the other's, by one of the runs' clocks."""
    return (one.frames / one.median(clock)) / (other.frames / other.median(clock))
