"""Options of the engine; those that Ipopt has, too, mean the same there."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """When to stop, and where to start.

    Attributes:
        max_iter: iterations at most.
        tol: largest component of the Lagrangian's gradient, for ``converged``.
        constr_viol_tol: largest violation of a row; also what rows with equal bounds are relaxed by.
        compl_inf_tol: largest product of a multiplier and its distance from the bound.
        acceptable_obj_change_tol: change of the objective, relative, below which an iteration stands still, unless
            the bounds have cut its step short.
        acceptable_iter: iterations that stand still, one after the other, for ``acceptable``.
        acceptable_constr_viol_tol, acceptable_compl_inf_tol: as above, for ``acceptable``.
        bound_push: smallest distance of the start from a bound, at most this share of an interval's width.
        bound_mult_init_val: the multipliers at the start.
        mu_init: the products of multipliers and distances at the start, instead; 0 for none.
    """

    max_iter: int = 50
    tol: float = 0.1
    constr_viol_tol: float = 1e-4
    compl_inf_tol: float = 1e-3
    acceptable_obj_change_tol: float = 3e-4
    acceptable_iter: int = 2
    acceptable_constr_viol_tol: float = 1e-3
    acceptable_compl_inf_tol: float = 1.0
    bound_push: float = 0.01
    bound_mult_init_val: float = 1.0
    mu_init: float = 0.0
