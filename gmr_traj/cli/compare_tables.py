"""A comparison as a table for the terminal and as Markdown."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby

from rich.markup import escape
from rich.table import Table

from gmr_traj.cli.tables import plain_table
from gmr_traj.comparison import Comparison, Measure
from gmr_traj.comparison.compare import Row
from gmr_traj.text import number

NOTHING = "-"  # a metric that a clip has no value of


def as_table(compared: Comparison) -> Table:
    """One line a metric, one column a clip, the best of each line starred."""
    table = plain_table("", "unit", *(f">{name}" for name in compared.names))
    for group, rows in _groups(compared):
        table.add_row(escape(group), style="bold")
        for row in rows:
            cells = [
                f"[bold green]{text}[/bold green]*" if best else f"{text} "
                for text, best in zip(_texts(row), row.best, strict=True)
            ]
            table.add_row(f"  {escape(row.metric.title)}", escape(row.metric.unit), *cells)
    return table


def where_table(compared: Comparison) -> Table:
    """Where the extreme values of the table were found: the joint, sole, body or pair of shapes."""
    table = plain_table("worst", *compared.names)
    for row in _with_places(compared):
        table.add_row(_full_title(row), *(escape(measure.where) for measure in row.measures))
    return table


def as_markdown(compared: Comparison) -> str:
    """The same table in Markdown, the best of each line bold, and below it what it rests on."""
    lines = [
        _line("", "unit", *compared.names),
        "|---|---|" + "---:|" * len(compared.names),
    ]
    for group, rows in _groups(compared):
        lines.append(_line(f"**{group}**", "", *("" for _ in compared.names)))
        for row in rows:
            cells = [f"**{text}**" if best else text for text, best in zip(_texts(row), row.best, strict=True)]
            lines.append(_line(row.metric.title, row.metric.unit, *cells))
    lines += ["", _line("worst", *compared.names), "|---|" + "---|" * len(compared.names)]
    lines += [_line(_full_title(row), *(measure.where for measure in row.measures)) for row in _with_places(compared)]
    notes = (f"{compared.seconds:.2f} s compared; the best of each row is bold", compared.stance_rule, *compared.notes)
    return "\n".join([*lines, "", *(f"- {note}" for note in notes), ""])


def _groups(compared: Comparison) -> Iterator[tuple[str, list[Row]]]:
    """The rows by group, those left out of which no clip has a value."""
    known = [row for row in compared.rows if any(measure.value is not None for measure in row.measures)]
    for group, rows in groupby(known, key=lambda row: row.group):
        yield group, list(rows)


def _with_places(compared: Comparison) -> list[Row]:
    return [row for row in compared.rows if any(measure.where for measure in row.measures)]


def _full_title(row: Row) -> str:
    return f"{row.group}: {row.metric.title}"


def _line(*cells: str) -> str:
    return "| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |"


def _texts(row: Row) -> list[str]:
    return [_text(measure) for measure in row.measures]


def _text(measure: Measure) -> str:
    return NOTHING if measure.value is None else number(measure.value)
