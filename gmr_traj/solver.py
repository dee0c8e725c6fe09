"""Ipopt, and nothing about robots: solves a transcribed program and says how that went."""

from __future__ import annotations

import contextlib
import io
import time
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from gmr_traj.attempts import RANKING, STATUS, Attempt, Solution
from gmr_traj.exceptions import SolverError
from gmr_traj.transcription import Nlp

INTERRUPTED = ("User_Requested_Stop",)
_UNUSABLE = ("Invalid_Option", "Invalid_Problem_Definition", "Internal_Error", "Insufficient_Memory")
_SILENT = {"print_level": 0, "sb": "yes"}


@lru_cache(maxsize=256)
def _taken(option: str, value: object) -> bool:
    """Whether Ipopt takes an option with this value, tried on a problem of one variable."""
    x = ca.MX.sym("x")
    problem: Any = {"x": x, "f": x**2}
    options: Any = {"ipopt": {**_SILENT, option: value}, "print_time": False, "error_on_fail": False}
    with contextlib.redirect_stdout(io.StringIO()):  # Ipopt explains a refusal in many lines
        try:
            solver = ca.nlpsol("option", "ipopt", problem, options)
            solver(x0=0.0)
        except RuntimeError:
            return False
    return str(solver.stats()["return_status"]) not in _UNUSABLE


def refused_options(options: Mapping[str, Any]) -> dict[str, Any]:
    """Those of Ipopt's options that it does not know, or not with this value."""
    return {
        option: value
        for option, value in options.items()
        if not isinstance(value, int | float | str) or not _taken(option, value)
    }


def solve(nlp: Nlp, attempt: Attempt, start: np.ndarray) -> Solution:
    """One attempt from a starting point.

    Raises:
        SolverError: Ipopt could not be run with these options.
        KeyboardInterrupt: passed on.
    """
    solver = _solver(nlp, attempt)
    started = time.perf_counter()
    result = solver(x0=start, lbx=nlp.lower, ubx=nlp.upper, lbg=nlp.row_lower, ubg=nlp.row_upper)
    stats = solver.stats()
    word = str(stats["return_status"])
    if word in _UNUSABLE:
        raise SolverError(f"Ipopt stopped with {word} (strategy {attempt.name})")
    if word in INTERRUPTED:
        raise KeyboardInterrupt
    seconds = time.perf_counter() - started
    evaluation = sum(
        float(value) for key, value in stats.items() if key.startswith("t_wall_nlp_") and key != "t_wall_nlp_total"
    )
    x = np.array(result["x"]).ravel()
    status = STATUS.get(word, RANKING[-1])
    if not np.isfinite(x).all():
        x, status = start, "not converged"
    trace = {key: tuple(map(float, values)) for key, values in stats.get("iterations", {}).items()}
    iterations = int(stats["iter_count"])
    return Solution(
        x,
        status,
        word,
        attempt.name,
        iterations,
        seconds,
        evaluation,
        seconds - evaluation,
        float(result["f"]),
        trace,
    )


def _solver(nlp: Nlp, attempt: Attempt) -> ca.Function:
    ipopt = {**_SILENT, "nlp_scaling_method": "none", **attempt.options}
    # Any: CasADi 3.8 has type stubs, older versions have none.
    problem: Any = nlp.problem
    options: Any = {
        "ipopt": ipopt,
        "print_time": False,
        "record_time": True,
        "calc_lam_p": False,
        "calc_multipliers": False,
        "error_on_fail": False,
        "grad_f": nlp.gradient,
        "jac_g": nlp.jacobian,
        "hess_lag": nlp.hessian,
    }
    try:
        return ca.nlpsol("refine", "ipopt", problem, options)
    except RuntimeError as error:
        reason = str(error).strip().splitlines()[-1]
        raise SolverError(f"Ipopt refused the options of strategy {attempt.name}: {reason}") from error
