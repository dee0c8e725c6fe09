"""Residuals at a point: their values, shares of the objective and violations, by name."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gmr_traj.frame_costs import gauss_newton
from gmr_traj.frames import evaluated
from gmr_traj.outcome import TermReport
from gmr_traj.residuals import FrameResidual, LinearResidual, Residual, Used, exceedance

Row = tuple[str, int, int]


@dataclass(frozen=True)
class Values:
    """A residual's rows with a bound, at one point.

    Attributes:
        rows: index of each row's name in ``residual.rows``.
        frames: the frame of each row.
        off: distance from the interval [unit].
    """

    residual: Residual
    rows: np.ndarray
    frames: np.ndarray
    off: np.ndarray

    def keys(self, where: np.ndarray) -> set[Row]:
        """Names of some of the rows, comparable between problems about different centres."""
        pairs = zip(self.rows[where].tolist(), self.frames[where].tolist(), strict=True)
        return {(self.residual.name, row, frame) for row, frame in pairs}

    def place(self, index: int) -> str:
        """A row in words."""
        return f"{self.residual.rows[self.rows[index]]}, frame {self.frames[index]}"


def evaluate(residual: Residual, x: np.ndarray) -> Values:
    """Distance of every bounded row from its interval."""
    if isinstance(residual, LinearResidual):
        wide = residual.matrix @ x[: residual.matrix.shape[1]] + residual.offset
        off = exceedance(wide, residual.lower, residual.upper)
        return Values(residual, residual.subjects, residual.frames, off)
    if residual.gauss_newton is not None:
        nothing = np.zeros(0, int)
        return Values(residual, nothing, nothing, np.zeros(0))
    values = evaluated(residual.value, residual.columns, residual.parameters, x)
    off = exceedance(values, residual.lower, residual.upper)
    row, column = _bounded(residual)
    return Values(residual, row, residual.frames[column], off[row, column])


def bounded_rows(residual: Residual) -> set[Row]:
    """Names of all rows with a bound."""
    if isinstance(residual, LinearResidual):
        rows, frames = residual.subjects, residual.frames
    else:
        rows, column = _bounded(residual)
        frames = residual.frames[column]
    return {(residual.name, row, frame) for row, frame in zip(rows.tolist(), frames.tolist(), strict=True)}


def _bounded(residual: FrameResidual) -> tuple[np.ndarray, np.ndarray]:
    """Row and column of every entry that has a bound."""
    rows, columns = np.nonzero((np.isfinite(residual.lower) | np.isfinite(residual.upper)) & (residual.weights > 0))
    return rows, columns


def report(item: Used, x: np.ndarray) -> TermReport:
    """The line of one residual in the solve's report."""
    residual = item.residual
    values = evaluate(residual, x)
    worst = int(values.off.argmax()) if values.off.size else -1
    return TermReport(
        name=residual.name,
        use=item.use,
        rows=values.off.size,
        value=_cost(residual, x) if item.use == "cost" else 0.0,
        violation=float(values.off[worst]) if worst >= 0 else 0.0,
        unit=residual.unit,
        where=values.place(worst) if worst >= 0 else "",
    )


def _cost(residual: Residual, x: np.ndarray) -> float:
    """Share of the objective."""
    if isinstance(residual, LinearResidual):
        error = residual.matrix @ x[: residual.matrix.shape[1]] + residual.offset - residual.lower
        return 0.5 * float(residual.weights @ error**2)
    assert isinstance(residual, FrameResidual)
    functions, parameters = gauss_newton(residual)
    return float(evaluated(functions.value, residual.columns, parameters, x).sum())
