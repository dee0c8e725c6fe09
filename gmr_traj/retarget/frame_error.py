"""How far a body is from its target: the twist between two placements, and how it changes with the body.

A body is at ``T_b = (R, p)``, its target at ``T_t``.  The error is the twist that leads from one to the other, in the
axes of the world,

    e = R log(T_b^-1 T_t) = (A(w) d, w),    w = log(R_t R'),    d = p_t - p,
    A(w) = I - [w]/2 + c [w]^2,             c = 1/|w|^2 - cot(|w|/2) / (2 |w|),

linear part first: mink's FrameTask and Pinocchio's log6 have the same in the axes of the body.  A is the inverse of
the left Jacobian of SO(3).  While the body moves with the velocity v of its point and the angular velocity o, the error
changes, as seen from the body, by

    (-A v + C o, -A o),    C = A [d] - D A,    D = d(A(w) d)/dw with d held,

and with the linear part r = A(w) d the coupling C is (found by writing D out; the terms in d - r cancel)

    C = [r]/2 - c (w r' + r w') + (w.r) ((c' |w| + 2 c) I - c'/|w| w w'),    c' = dc/d|w|.

Everything here is a CasADi expression of one body; see ``inverse_kinematics`` for many.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

# Where |w| is smaller, the coefficients c and dc/d|w| are taken at this angle [rad].  They are constant there to 1e-9,
# and rounding, which grows towards zero, is still small after the powers of w that they are multiplied with.
_LEAST = 1e-4


@dataclass(frozen=True)
class Twist:
    """The error of a body, and what its derivatives are made of.

    Attributes:
        linear: r, the linear part [m].  # (3, 1)
        w: the angular part, a rotation vector [rad].  # (3, 1)
        c: coefficient of the last term of A.
        slope: (dc/d|w|) / |w|.
    """

    linear: Any
    w: Any
    c: Any
    slope: Any

    @property
    def inverse_jacobian(self) -> Any:
        """A, which turns velocities of the body into those of the error.  # (3, 3)"""
        w = self.w
        return ca.SX.eye(3) * (1.0 - self.c * ca.sumsqr(w)) - 0.5 * ca.skew(w) + self.c * (w @ w.T)


def twist(way: Any, d: Any) -> Twist:
    """The error of a body, the shorter way round.

    Args:
        way: the turn from the body's orientation to its target's, in the world's axes, a unit quaternion wxyz.
        d: way from the body's point to the target [m].  # (3, 1)
    """
    real, imaginary = way[0], way[1:]
    sine = ca.sqrt(ca.sumsqr(imaginary))
    angle = 2.0 * ca.atan2(sine, ca.fabs(real))
    # Below 1e-8 angle / sine is 2 to rounding, and the quotient would come to 0/0.
    stretch = ca.if_else(sine > 1e-8, angle / ca.fmax(sine, 1e-8), 2.0)
    w = imaginary * ca.if_else(real < 0.0, -stretch, stretch)
    inverse = 1.0 / ca.fmax(angle, _LEAST)
    cot = 1.0 / ca.tan(0.5 / inverse)
    c = inverse * (inverse - 0.5 * cot)
    # dc/da = -2/a^3 + cot/(2 a^2) + 1/(4 a sin^2), with 1/sin^2 = 1 + cot^2
    slope = inverse * inverse * (inverse * (0.5 * cot - 2.0 * inverse) + 0.25 * (1.0 + cot * cot))
    linear = d - 0.5 * ca.cross(w, d) + c * (w * ca.dot(w, d) - d * ca.sumsqr(w))
    return Twist(linear, w, c, slope)


def coupling(twist: Twist) -> Any:
    """C, how the linear part of the error changes with the body's turning about its point.  # (3, 3)"""
    r, w, c, slope = twist.linear, twist.w, twist.c, twist.slope
    along = ca.dot(w, r)
    # The terms that are symmetric are w y' + y w' and a multiple of I.
    products = w @ (-c * r - (0.5 * slope * along) * w).T
    return 0.5 * ca.skew(r) + (products + products.T) + along * (slope * ca.sumsqr(w) + 2.0 * c) * ca.SX.eye(3)


def way_between(body: Any, target: Any) -> Any:
    """The turn ``t b*`` from a body's orientation b to its target's t, unit quaternions wxyz.  # (4, 1)"""
    w, v, u, x = body[0], body[1:], target[0], target[1:]
    return ca.vertcat(u * w + ca.dot(x, v), w * x - u * v - ca.cross(x, v))
