"""Tables of the report."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

from gmr_traj.metrics import Artefact, Certificate, Change, Figures
from gmr_traj.text import number

#: Figures that tell clips apart: attribute, name, unit, attribute of the place.
FIGURES = (
    ("speed_ratio", "largest joint speed", "of the limit", "speed_joint"),
    ("over_frames", "steps above a velocity limit", "", ""),
    ("limit_frames", "frames outside a joint's range", "", "limit_joint"),
    ("acceleration_max", "largest joint acceleration", "rad/s\u00b2", "acceleration_joint"),
    ("jerk_rms", "joint jerk (rms, at 50 Hz)", "rad/s\u00b3", ""),
    ("drift_p95", "drift of feet in stance (95 %)", "mm", ""),
    ("drift_max", "drift of feet in stance (worst)", "mm", "drift_sole"),
    ("slide_mean", "slide of feet in stance (mean)", "mm/s", ""),
    ("float_p95", "height of feet in stance (95 %)", "mm", ""),
    ("sole_lowest", "lowest point of the soles", "mm", "sole_name"),
    ("floor_lowest", "lowest point of the body", "mm", "floor_body"),
    ("self_depth", "deepest self-collision", "mm", "self_pair"),
    ("self_share", "frames with self-collision over 1 mm", "share", ""),
)


def certificate(measured: Certificate) -> str:
    """Every promise with both figures, the bar, and whether it holds."""
    rows = []
    for p in measured.promises:
        verdict = '<td class="held">held</td>' if p.held else '<td class="broken">BROKEN</td>'
        before = "" if p.before is None else number(p.before)
        rows.append(
            _row(p.sentence, before, number(p.value), number(p.bar), p.unit, verdict, p.where, numbers=(1, 2, 3))
        )
    return _table(("promise", "input", "refined", "at most", "unit", "", "where"), rows)


def figures(columns: Sequence[tuple[str, Figures]]) -> str:
    """Figures of the clips, one column each, with the place of the last one's."""
    rows = []
    for attribute, name, unit, place in FIGURES:
        cells = [number(getattr(own, attribute)) for _, own in columns]
        places = [getattr(own, place) for _, own in columns] if place else [""]
        rows.append(_row(name, *cells, unit, places[0], numbers=tuple(range(1, len(cells) + 1))))
    return _table(("figure", *(name for name, _ in columns), "unit", f"where in {columns[0][0]}"), rows)


def artefacts(found: Sequence[Artefact], top: int) -> str:
    """The worst artefacts, the worst first."""
    rows = [
        _row(
            f"{a.begin:.2f}\u2013{a.end:.2f}",
            f"{a.start}\u2013{a.stop - 1}",
            a.kind.replace("_", " "),
            a.where,
            number(a.value),
            a.unit,
            f"{a.score:.2f}",
            numbers=(0, 1, 4, 6),
        )
        for a in found[:top]
    ]
    return _table(("seconds", "frames", "artefact", "where", "value", "unit", "severity"), rows)


def change(moved: Change) -> str:
    """How far each key body moved and turned."""
    rows = [
        _row(
            b.body,
            number(b.position_mean),
            number(b.position_max),
            number(b.orientation_mean),
            number(b.orientation_max),
            numbers=(1, 2, 3, 4),
        )
        for b in moved.bodies
    ]
    return _table(("body", "mean [mm]", "largest [mm]", "mean [\u00b0]", "largest [\u00b0]"), rows)


def _table(head: Sequence[str], rows: Iterable[str]) -> str:
    cells = "".join(f"<th>{escape(name)}</th>" for name in head)
    return f'<div class="wide"><table><thead><tr>{cells}</tr></thead><tbody>{"".join(rows)}</tbody></table></div>'


def _row(*cells: str, numbers: tuple[int, ...] = ()) -> str:
    """A row; cells that are table cells already stay as they are."""
    made = []
    for place, cell in enumerate(cells):
        if cell.startswith("<td"):
            made.append(cell)
        else:
            made.append(f"<td{' class=number' if place in numbers else ''}>{escape(cell)}</td>")
    return f"<tr>{''.join(made)}</tr>"
