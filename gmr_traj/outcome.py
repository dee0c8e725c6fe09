"""What came of a solve, by the names of the terms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
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
        iterations: on the whole clip (or on all windows).
        repairs: programs of parts of the clip around rows that turned out to have been missing,
        repair_iterations: and the iterations on these.
        seconds: wall-clock time in the engines.
        evaluation_seconds: the part of it spent in function evaluations.
        linear_seconds: the part of it spent on linear systems; of Ipopt, all that is not spent in function evaluations.
        passes: solves, the most of any window.
        objective: value at the solution (sum over windows).
        terms: every residual.
        message: what to know beyond that, in a sentence; empty if nothing.
        trace: Ipopt's objective and infeasibilities by iteration, of all passes one after the other, for plots.
    """

    status: str
    solver_status: str
    strategy: str
    iterations: int
    seconds: float
    evaluation_seconds: float
    linear_seconds: float
    passes: int
    objective: float
    terms: tuple[TermReport, ...]
    message: str
    repairs: int = 0
    repair_iterations: int = 0
    trace: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Plain containers, ready for ``json.dumps``, without the trace and the times: equal runs give equal bytes."""
        content = asdict(self)
        for key in ("seconds", "evaluation_seconds", "linear_seconds", "trace"):
            del content[key]
        return content
