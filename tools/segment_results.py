"""Results of `tools/segments_table.py`: a file of JSON lines that only grows, and the table made of them."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

Line = dict[str, Any]


def read_lines(path: Path) -> dict[str, Line]:
    """Lines of a file by their ``id``; a last line that was cut off while it was written is removed from the file.

    Raises:
        SystemExit: a line is not one of these results.
    """
    if not path.exists():
        return {}
    content = path.read_bytes()
    whole = content[: content.rfind(b"\n") + 1]
    if whole != content:
        with path.open("rb+") as stream:
            stream.truncate(len(whole))
    found: dict[str, Line] = {}
    for number, text in enumerate(whole.decode(errors="replace").splitlines(), 1):
        try:
            line = json.loads(text)
            found[line["id"]] = line
        except (ValueError, KeyError, TypeError):
            raise SystemExit(f"{path}, line {number}: this is no result of segments_table; name another file") from None
    return found


def append_line(path: Path, line: Line) -> None:
    """Add a line, on the disk when this returns."""
    with path.open("a") as stream:
        stream.write(json.dumps(line, allow_nan=False) + "\n")
        stream.flush()
        os.fsync(stream.fileno())


@dataclass(frozen=True)
class Row:
    """What is known of one clip, or of all of them together.

    Attributes:
        name: the clip.
        audits: of the whole clip, one for each variant.
        rollouts: for each segment that every variant has been rolled out on, one for each variant.
        planned: how many segments there are.
    """

    name: str
    audits: tuple[Line, ...]
    rollouts: tuple[tuple[Line, ...], ...]
    planned: int


def total(rows: Sequence[Row]) -> Row:
    """All clips together; the audit's figures are of all frames, whichever clip they are of."""
    kinds = zip(*(row.audits for row in rows), strict=True)
    keys = ("infeasible_share", "joint_torque_share", "residual_force_mean")
    audits = tuple(
        {key: float(np.average([a[key] for a in kind], weights=[a["frames"] for a in kind])) for key in keys}
        for kind in kinds
    )
    rollouts = tuple(segment for row in rows for segment in row.rollouts)
    return Row("all", audits, rollouts, sum(row.planned for row in rows))


def markdown(variants: Sequence[str], rows: Sequence[Row]) -> str:
    """The table: a line a clip and one for all; raw and the variants in every cell, in their order.

    Args:
        variants: their names, ``raw`` first.
        rows: one a clip.
    """
    every = " / ".join(variants)
    later = " / ".join(variants[1:])
    head = [
        "clip",
        "segments",
        f"infeasible [% of frames]: {every}",
        f"over a torque limit [% of frames]: {every}",
        f"residual force, mean [m g]: {every}",
        f"segments survived: {every}",
        f"followed [% of the time]: {every}",
        f"survived where raw falls: {later}",
        f"falls where raw survives: {later}",
        f"E_g where both survive, raw → variant [mm]: {later}",
    ]
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    for row in (*rows, *([total(rows)] if len(rows) > 1 else [])):
        lines.append("| " + " | ".join(_cells(row, len(variants))) + " |")
    return "\n".join(lines)


def _cells(row: Row, count: int) -> list[str]:
    good = np.array(
        [[line["success"] for line in segment] for segment in row.rollouts], dtype=bool
    )  # (segments, kinds)
    good = good.reshape(-1, count)
    raw, fallen = good[:, :1], ~good[:, :1]
    rescued, lost = (good & fallen).sum(axis=0), (~good & raw).sum(axis=0)
    done = len(good)
    empty = ["-"] * 5 if not done else None
    return [
        row.name,
        str(done) if done == row.planned else f"{done} of {row.planned}",
        _joined([100.0 * audit["infeasible_share"] for audit in row.audits], "{:.1f}"),
        _joined([100.0 * audit["joint_torque_share"] for audit in row.audits], "{:.1f}"),
        _joined([audit["residual_force_mean"] for audit in row.audits], "{:.3f}"),
        *(
            empty
            or [
                _joined(good.sum(axis=0)),
                _joined([_followed(row, k) for k in range(count)], "{:.0f}"),
                f"{_joined(rescued[1:])} of {fallen.sum()}" if count > 1 else "-",
                f"{_joined(lost[1:])} of {raw.sum()}" if count > 1 else "-",
                " / ".join(_errors(row, good, k) for k in range(1, count)) or "-",
            ]
        ),
    ]


def _followed(row: Row, kind: int) -> float:
    """Share of the time of all segments before a fall [%]."""
    own = [segment[kind] for segment in row.rollouts]
    return 100.0 * sum(line["alive"] for line in own) / sum(line["length"] for line in own)


def _errors(row: Row, good: np.ndarray, kind: int) -> str:
    both = [segment for segment, kept in zip(row.rollouts, good, strict=True) if kept[0] and kept[kind]]
    if not both:
        return "none"
    means = [np.mean([segment[k]["g_mpbpe"] for segment in both]) for k in (0, kind)]
    return f"{means[0]:.1f} → {means[1]:.1f} ({len(both)})"


def _joined(values: Sequence[float] | np.ndarray, form: str = "{}") -> str:
    text: Callable[[Any], str] = form.format
    return " / ".join(text(value) for value in values)
