"""Numbers for people."""

from __future__ import annotations


def number(value: float) -> str:
    """Three significant digits: 0.0123, 4.56, 78.9, 1235; rounding errors are 0."""
    if abs(value) < 1e-9:
        return "0"
    if float(value).is_integer() or abs(value) >= 100.0:
        return f"{value:.0f}"
    if abs(value) < 1e-4:
        return f"{value:.0e}"
    return f"{value:#.3g}".rstrip(".")
