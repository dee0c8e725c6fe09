"""A formulation in CasADi's symbols, with all derivatives: the sparse nonlinear program that Ipopt takes.

The curvature of constraints is left out, so the Hessian is that of the objective's Gauss-Newton model: positive
semidefinite by construction, it never needs to be convexified.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from gmr_traj.formulation import Formulation


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


def transcribe(formulation: Formulation) -> Nlp:
    """Write the program down."""
    rows = formulation.constraints
    x, p = ca.MX.sym("x", formulation.variables.size), ca.MX.sym("p", 0)
    value, gradient, hessian = formulation.objective.expressions(x)
    g, jacobian = rows.expressions(x)
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", g.numel())
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
        initial=formulation.initial,
        lower=formulation.lower,
        upper=formulation.upper,
        row_lower=rows.lower,
        row_upper=rows.upper,
    )
