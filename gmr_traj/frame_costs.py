"""A residual used as a cost: value, gradient and Gauss-Newton Hessian from its value and Jacobian."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from gmr_traj.residuals import FrameResidual, GaussNewton


def gauss_newton(residual: FrameResidual) -> tuple[GaussNewton, np.ndarray]:
    """Functions of (z, parameters) for ``1/2 sum_i w_i e_i^2``, and the parameters they take, ``(np', K)``.

    ``e`` is the distance of the residual from its interval; with ``a_i = 1`` where it is outside and 0 within,

        gradient = J' (w a e),   Hessian = J' diag(w a) J.
    """
    if residual.gauss_newton is not None:
        return residual.gauss_newton, residual.parameters
    assert residual.jacobian is not None
    # A missing bound is far away: an infinity would turn into NaN where the symbolic distance multiplies it by zero.
    far = 1e9
    parameters = np.vstack(
        [
            residual.parameters,
            residual.weights,
            np.maximum(residual.lower, -far),
            np.minimum(residual.upper, far),
        ]
    )
    return _functions(residual.value, residual.jacobian), parameters


@lru_cache(maxsize=512)
def _functions(value: ca.Function, jacobian: ca.Function) -> GaussNewton:
    """The functions; kept, because a term of the same robot comes back in every window and pass."""
    z = ca.SX.sym("z", value.size1_in(0))
    own = ca.SX.sym("own", value.size1_in(1))
    m = value.size1_out(0)
    weights, lower, upper = ca.SX.sym("w", m), ca.SX.sym("lower", m), ca.SX.sym("upper", m)
    p = ca.vertcat(own, weights, lower, upper)
    r, j = value(z, own), jacobian(z, own)
    below, above = ca.fmax(0, lower - r), ca.fmax(0, r - upper)
    # Equal bounds are a target: outside on one side or the other everywhere.
    outside = ca.logic_or(ca.logic_or(r < lower, r > upper), lower == upper)
    error = above - below
    cost = 0.5 * ca.sum1(weights * error**2)
    hessian = ca.triu(j.T @ (ca.repmat(weights * outside, 1, j.shape[1]) * j))
    return GaussNewton(z, p, cost, j.T @ (weights * error), ca.sparsify(hessian))
