"""One formulation, several engines: Ipopt, and an interior-point method for programs that are banded in time."""

from __future__ import annotations

from functools import cache

import numpy as np
from threadpoolctl import ThreadpoolController

from gmr_traj import solver
from gmr_traj.attempts import Attempt, Solution, in_turn
from gmr_traj.band import interior_point
from gmr_traj.band.program import Program
from gmr_traj.formulation import Formulation
from gmr_traj.transcription import Nlp, transcribe


@cache
def _libraries() -> ThreadpoolController:
    """The linear algebra libraries of this process; their threads spin on blocks as small as the band's."""
    return ThreadpoolController()


#: Names of the engines in a problem file.
ENGINES = ("ipopt", "band")


def solve(formulation: Formulation, attempts: tuple[Attempt, ...]) -> Solution:
    """Try the attempts in turn, each with its own engine, from where the last one stopped.

    Raises:
        SolverError: an engine could not be run with its options.
        KeyboardInterrupt: passed on.
    """

    @cache
    def symbolic() -> Nlp:
        return transcribe(formulation)

    @cache
    def numeric() -> Program:
        return Program(formulation)

    def run(attempt: Attempt, start: np.ndarray) -> Solution:
        if attempt.engine == "band":
            with _libraries().limit(limits=1):
                return interior_point.solve(numeric(), attempt, start)
        return solver.solve(symbolic(), attempt, start)

    return in_turn(attempts, formulation.initial, run)
