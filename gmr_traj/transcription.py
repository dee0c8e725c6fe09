"""From residuals and the uses made of them to one sparse nonlinear program.

    min  f(x) = 1/2 x'Qx + c'x + c0 + sum_k phi_k(x[cols_k])    s.t.  l <= g(x) <= u,  lx <= x <= ux

The curvature of constraints is left out, so the Hessian is that of the objective's Gauss-Newton model: positive
semidefinite by construction, it never needs to be convexified.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from gmr_traj.constraints import Constraints
from gmr_traj.exceptions import ProblemError
from gmr_traj.objective import Objective
from gmr_traj.residuals import Used
from gmr_traj.variables import Variables


@dataclass(frozen=True)
class Nlp:
    """A nonlinear program in the form Ipopt wants, all derivatives given.

    Attributes:
        problem: ``x``, ``p`` (empty), ``f`` and ``g`` as CasADi expressions.
        gradient: (x, p) -> (NaN, grad f); CasADi wants two outputs, the first is never used.
        jacobian: (x, p) -> (g, dg/dx).
        hessian: (x, p, lam_f, lam_g) -> upper triangle of lam_f times the Gauss-Newton Hessian.
        initial, lower, upper: starting values and bounds of x.  # (nx,)
        row_lower, row_upper: bounds of g.  # (m,)
    """

    problem: dict[str, ca.MX]
    gradient: ca.Function
    jacobian: ca.Function
    hessian: ca.Function
    initial: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    row_lower: np.ndarray
    row_upper: np.ndarray


def transcribe(variables: Variables, used: Sequence[Used]) -> Nlp:
    """Assemble the program.

    Unknowns that are held stay where they are held, whatever bounds the constraints ask of them, and constraint rows
    about nothing but held unknowns are left out: no solution could change them, and a rounding error in what is held
    would leave the program without one.

    Raises:
        ProblemError: on a use a residual cannot have.
    """
    rows = Constraints(variables, used)
    costs = Objective(variables.size, used, rows.slack_linear, rows.slack_quadratic)
    x, p = ca.MX.sym("x", variables.size), ca.MX.sym("p", 0)
    value, gradient, hessian = costs.expressions(x)
    g, jacobian = rows.expressions(x)
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", g.numel())
    lower, upper = variables.bounds()
    np.maximum.at(lower, rows.bound_index, rows.bound_lower)
    np.minimum.at(upper, rows.bound_index, rows.bound_upper)
    crossed = np.flatnonzero(lower > upper)
    if crossed.size:
        raise ProblemError(
            f"hard constraints leave no value to unknown {crossed[0]}: it must be at least {lower[crossed[0]]:g} and "
            f"at most {upper[crossed[0]]:g} ({crossed.size} such unknowns)"
        )
    return Nlp(
        problem={"x": x, "p": p, "f": value, "g": g},
        # Ipopt asks for the value by itself; NaN would stop it at once if that ever changed.
        gradient=ca.Function("grad_f", [x, p], [ca.MX(np.nan), gradient], ["x", "p"], ["f", "grad_f_x"]),
        jacobian=ca.Function("jac_g", [x, p], [g, jacobian], ["x", "p"], ["g", "jac_g_x"]),
        hessian=ca.Function(
            "hess_lag",
            [x, p, lam_f, lam_g],
            [lam_f * hessian],
            ["x", "p", "lam_f", "lam_g"],
            ["triu_hess_gamma_x_x"],
        ),
        initial=np.clip(variables.initial(), lower, upper),
        lower=lower,
        upper=upper,
        row_lower=rows.lower,
        row_upper=rows.upper,
    )
