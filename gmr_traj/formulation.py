"""Residuals and the uses made of them, as one program: what every solver engine starts from.

min  f(x) = 1/2 x'Qx + c'x + c0 + sum_k phi_k(x[cols_k])    s.t.  l <= g(x) <= u,  lx <= x <= ux
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gmr_traj.constraints import Constraints
from gmr_traj.exceptions import ProblemError
from gmr_traj.objective import Objective
from gmr_traj.residuals import Used
from gmr_traj.variables import Variables


@dataclass(frozen=True)
class Formulation:
    """The program's parts.

    Attributes:
        variables: the unknowns, slacks of soft rows included.
        constraints: g, with the bounds l and u of its rows.
        objective: f.
        initial, lower, upper: starting values and bounds of x.  # (nx,)
    """

    variables: Variables
    constraints: Constraints
    objective: Objective
    initial: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


def formulate(variables: Variables, used: Sequence[Used]) -> Formulation:
    """Put the program together.

    Unknowns that are held stay where they are held, whatever bounds the constraints ask of them, and constraint rows
    about nothing but held unknowns are left out: no solution could change them, and a rounding error in what is held
    would leave the program without one.

    Args:
        variables: the unknowns; slacks are appended.
        used: residuals.

    Raises:
        ProblemError: on a use a residual cannot have, or hard bounds that leave an unknown no value.
    """
    rows = Constraints(variables, used)
    costs = Objective(variables.size, used, rows.slack_linear, rows.slack_quadratic)
    lower, upper = variables.bounds()
    np.maximum.at(lower, rows.bound_index, rows.bound_lower)
    np.minimum.at(upper, rows.bound_index, rows.bound_upper)
    crossed = np.flatnonzero(lower > upper)
    if crossed.size:
        raise ProblemError(
            f"hard constraints leave no value to unknown {crossed[0]}: it must be at least {lower[crossed[0]]:g} and "
            f"at most {upper[crossed[0]]:g} ({crossed.size} such unknowns)"
        )
    return Formulation(variables, rows, costs, np.clip(variables.initial(), lower, upper), lower, upper)
