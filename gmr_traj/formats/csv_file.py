"""Tables of numbers as comma-separated text, with or without a line of column names."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np

from gmr_traj.exceptions import ClipError


@dataclass(frozen=True)
class Table:
    """Rows of numbers and, where the first line is not numbers, its column names."""

    rows: np.ndarray  # (T, columns)
    header: tuple[str, ...] | None


def load(data: bytes) -> Table:
    """Read csv text.

    Raises:
        ClipError: it is not text, or not a table of numbers with as many columns in every line.
    """
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ClipError(f"neither npz, pickle nor text (byte {error.start}); expected a motion clip") from error
    lines = [line for line in text.splitlines() if line.strip()]
    if not lines:
        raise ClipError("the file is empty")
    separator = next((s for s in (",", ";", "\t") if s in lines[0]), None)
    if separator is not None and all(line.rstrip().endswith(separator) for line in lines):
        lines = [line.rstrip()[:-1] for line in lines]  # some recorders end every line with one
    first = [cell.strip().strip('"') for cell in lines[0].split(separator)]
    header = None if all(_is_number(cell) for cell in first) else tuple(first)
    body = lines if header is None else lines[1:]
    if not body:
        raise ClipError("the file has a header and no frames")
    try:
        rows = np.loadtxt(io.StringIO("\n".join(body)), delimiter=separator, ndmin=2, comments=None, dtype=np.float64)
    except ValueError as error:
        raise ClipError(f"not a table of numbers: {error}") from error
    if header is not None and len(header) != rows.shape[1]:
        raise ClipError(f"the header names {len(header)} columns, the rows have {rows.shape[1]}")
    return Table(rows, header)


def save(stream: BinaryIO, table: Table) -> None:
    """Write csv text; every number with the fewest digits that read back as the same float64.

    Args:
        stream: where to write.
        table: rows and, if it has one, the header.
    """
    lines = [] if table.header is None else [",".join(table.header)]
    lines += [",".join(map(_digits, row)) for row in table.rows.tolist()]
    stream.write(("\n".join(lines) + "\n").encode())


def _digits(value: float) -> str:
    return str(int(value)) if value.is_integer() and abs(value) < 1e6 else repr(value)


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
