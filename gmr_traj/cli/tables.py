"""Tables for people: certificates, artefacts, rankings."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rich.console import JustifyMethod
from rich.markup import escape
from rich.table import Table

from gmr_traj.metrics import Artefact, Certificate, Change, Figures
from gmr_traj.text import number
from gmr_traj.verify.physics_change import PhysicsChange

_HELD = {True: "[green]held[/green]", False: "[bold red]BROKEN[/bold red]"}


def certificate(measured: Certificate) -> Table:
    """Every promise with the input's figure, the refined clip's, the bar and whether it holds."""
    table = plain_table("promise", ">input", ">refined", ">at most", "unit", "", "where")
    for promise in measured.promises:
        table.add_row(
            escape(promise.sentence),
            "" if promise.before is None else number(promise.before),
            number(promise.value),
            number(promise.bar),
            escape(promise.unit),
            _HELD[promise.held],
            escape(promise.where),
        )
    return table


def physics(measured: PhysicsChange) -> Table:
    """The audit's figures of the input and of the refined clip."""
    table = plain_table("physics", ">input", ">refined", "unit", "")
    for figure in measured.figures:
        mark = "[bold yellow]worse[/bold yellow]" if figure.worse else ""
        table.add_row(escape(figure.name), number(figure.before), number(figure.after), escape(figure.unit), mark)
    return table


def change(moved: Change) -> Table:
    """How far each key body moved and turned against the levelled input."""
    table = plain_table("body", ">mean [mm]", ">max [mm]", ">mean [deg]", ">max [deg]")
    for body in moved.bodies:
        figures = (body.position_mean, body.position_max, body.orientation_mean, body.orientation_max)
        table.add_row(escape(body.body), *(number(figure) for figure in figures))
    table.add_row("all (mean)", number(moved.position), "", number(moved.orientation), "", style="bold")
    return table


def kinds(found: Sequence[Artefact], seconds: float) -> Table:
    """One line a kind of artefact: how many, how much of the clip, and the worst of them.

    Args:
        found: artefacts of one clip, worst first.
        seconds: length of the clip [s].
    """
    table = plain_table("artefact", ">count", ">of clip", ">worst", "unit", "where", ">seconds")
    by_kind: dict[str, list[Artefact]] = {}
    for artefact in found:
        by_kind.setdefault(artefact.kind, []).append(artefact)
    for kind, own in by_kind.items():
        worst, share = own[0], f"{100.0 * _covered(own) / seconds:.0f} %"
        cells = (kind.replace("_", " "), str(len(own)), share, number(worst.value), worst.unit, worst.where)
        table.add_row(*(escape(cell) for cell in cells), _span(worst))
    return table


def artefacts(found: Sequence[Artefact], top: int) -> Table:
    """The ``top`` worst artefacts of a clip, one a line."""
    table = plain_table("artefact", "where", ">seconds", ">frames", ">value", "unit", ">severity")
    for artefact in found[:top]:
        table.add_row(
            artefact.kind.replace("_", " "),
            escape(artefact.where),
            _span(artefact),
            f"{artefact.start}-{artefact.stop - 1}",
            number(artefact.value),
            escape(artefact.unit),
            f"{artefact.score:.2f}",
        )
    return table


def ranking(clips: Iterable[tuple[str, float, Figures, Sequence[Artefact]]]) -> Table:
    """One line a clip: its score, length, and the figures that tell clips apart, in the order given."""
    table = plain_table("clip", ">score", ">s", ">jumps", ">rad/s", ">drift mm", ">sole mm", ">self mm", "worst")
    for name, score, figures, found in clips:
        table.add_row(
            escape(name),
            f"{score:.2f}",
            f"{figures.seconds:.1f}",
            str(sum(a.kind in ("jump", "transient") for a in found)),
            number(figures.speed_max),
            number(figures.drift_max),
            number(figures.sole_lowest),
            number(figures.self_depth),
            escape(f"{found[0].kind.replace('_', ' ')}: {found[0].where}") if found else "",
        )
    return table


def plain_table(*columns: str) -> Table:
    """A table without rules; the columns whose name begins with ``>`` are numbers, on the right."""
    table = Table(box=None, pad_edge=False, show_edge=False, header_style="bold")
    for name in columns:
        right = name.startswith(">")
        side: JustifyMethod = "right" if right else "left"
        table.add_column(escape(name.removeprefix(">")), justify=side, no_wrap=right, overflow="fold")
    return table


def _span(artefact: Artefact) -> str:
    return f"{artefact.begin:.2f}-{artefact.end:.2f}"


def _covered(found: Iterable[Artefact]) -> float:
    """Length of the union of the artefacts' stretches [s]."""
    total, reached = 0.0, float("-inf")
    for artefact in sorted(found, key=lambda a: a.begin):
        total += max(0.0, artefact.end - max(artefact.begin, reached))
        reached = max(reached, artefact.end)
    return total
