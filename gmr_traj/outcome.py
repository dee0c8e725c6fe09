"""What came of a solve, by the names of the terms."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class TermReport:
    """One residual at the solution.

    Attributes:
        name: of the residual, e.g. ``ground/left sole``.
        use: ``cost``, ``hard`` or ``soft``.
        rows: how many were built.
        value: its share of the objective; 0 for constraints.
        violation: largest distance of a row from its bounds [unit]; for costs, the largest deviation.
        unit: of the rows.
        where: the row and frame of that largest value.
    """

    name: str
    use: str
    rows: int
    value: float
    violation: float
    unit: str
    where: str


@dataclass(frozen=True)
class SolveReport:
    """How the whole problem was solved.

    Attributes:
        status: ``converged``, ``acceptable`` or ``not converged``; the worst of all windows.
        solver_status: Ipopt's own word for it.
        strategy: the strategies that gave the result.
        iterations: of all passes and windows.
        seconds: wall-clock time in Ipopt.
        evaluation_seconds: the part of it spent in function evaluations.
        passes: solves, the most of any window.
        objective: value at the solution (sum over windows).
        terms: every residual.
        message: what to know beyond that, in a sentence; empty if nothing.
    """

    status: str
    solver_status: str
    strategy: str
    iterations: int
    seconds: float
    evaluation_seconds: float
    passes: int
    objective: float
    terms: tuple[TermReport, ...]
    message: str

    def to_json(self) -> dict[str, Any]:
        """Plain containers, ready for ``json.dumps``; times are left out, so that equal runs give equal bytes."""
        content = asdict(self)
        del content["seconds"], content["evaluation_seconds"]
        return content
