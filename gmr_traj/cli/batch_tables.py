"""What a batch came to, for people."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from gmr_traj.batch.records import Record
from gmr_traj.batch.summary import Shortfall, ranked, totals
from gmr_traj.cli.tables import plain_table
from gmr_traj.text import number

# Figures of the totals, as they are called in the table.
_FIGURES = (
    ("steps of a joint over 0.3 rad", "jumps", ""),
    ("steps over a velocity limit", "over_frames", ""),
    ("drift of a foot in stance, 95 %, median clip", "drift_p95_median", "mm"),
    ("drift of a foot in stance, 95 %, worst clip", "drift_p95_max", "mm"),
    ("deepest in the floor, worst clip", "floor_lowest_min", "mm"),
    ("deepest in itself, worst clip", "self_depth_max", "mm"),
)


def show(screen: Console, records: Mapping[str, Record], top: int) -> None:
    """Print the totals, and the clips that fall short most."""
    found = totals(records.values())
    rows = ranked(records)
    if rows and top:
        screen.print(ranking(rows, top))
        if len(rows) > top:
            screen.print(f"... and {len(rows) - top} better ones (--top {len(rows)} lists all)", style="dim")
    if "before" in found:
        screen.print()
        screen.print(_before_and_after(found))
    screen.print()
    screen.print(_sentence(found), markup=False)


def ranking(rows: list[tuple[str, Record, Shortfall]], top: int) -> Table:
    """One line a clip, what falls short most first."""
    table = plain_table("clip", "", ">broken", "nearest to its bar", ">before", ">after", ">at most", "unit", "where")
    for name, record, short in rows[:top]:
        before, after, bar = ("" if x is None else number(x) for x in (short.before, short.value, short.bar))
        cells = (short.sentence, before, after, bar, short.unit, short.where)
        table.add_row(escape(name), _state(record, short), str(short.broken or ""), *(escape(cell) for cell in cells))
    return table


def _state(record: Record, short: Shortfall) -> str:
    if short.failed:
        return "[bold red]FAILED[/bold red]"
    if short.broken:
        return "[bold red]BROKEN[/bold red]"
    return "[green]held[/green]" if "certificate" in record or "verify" in record else "done"


def _before_and_after(found: Mapping[str, Any]) -> Table:
    table = plain_table("all clips", ">before", ">after", "unit")
    for label, name, unit in _FIGURES:
        table.add_row(label, number(found["before"][name]), number(found["after"][name]), unit)
    return table


def _sentence(found: Mapping[str, Any]) -> str:
    parts = [f"{found['clips']} clips ({found['seconds_of_motion']:.0f} s of motion): {found['done']} done"]
    if found["failed"]:
        parts.append(f"{found['failed']} failed")
    if found["held"] + found["broken"]:
        parts.append(f"{found['held']} hold every promise")
    if found["broken"]:
        parts.append(f"{found['broken']} break one")
    if found["followed"] + found["not_followed"]:
        parts.append(f"{found['followed']} can be followed")
    if found["not_followed"]:
        parts.append(f"{found['not_followed']} cannot")
    return ", ".join(parts)
