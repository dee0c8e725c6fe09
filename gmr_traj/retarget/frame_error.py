"""How far bodies are from their targets: the twist between two placements, and how it changes with the body.

A body is at ``T_b = (R, p)``, its target at ``T_t``.  The error is the body twist that leads from one to the other,

    e = log(T_b^-1 T_t) = (A(w) d, w),    w = log(R' R_t),    d = R' (p_t - p),
    A(w) = I - [w]/2 + c [w]^2,           c = 1/|w|^2 - cot(|w|/2) / (2 |w|),

linear part first, as mink's FrameTask and Pinocchio's log6 have it; A is the inverse of the left Jacobian of SO(3).
A body that moves with the body twist (v, o), linear and angular velocity in its own axes, has

    w_dot = -A o,    d_dot = -v + [d] o,
    e_dot = (-A v + (A [d] - D A) o, -A o),    D = d(A(w) d)/dw with d held.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

# Where |w| is smaller, the coefficients c and dc/d|w| are taken at this angle [rad].  They are constant there to 1e-9,
# and rounding, which grows towards zero, is still small after the powers of w that they are multiplied with.
_LEAST = 1e-4
# S(x) = [x], the matrix of the cross product, as a row vector times this: x @ _CROSS -> nine elements, row by row.
_CROSS = np.zeros((3, 9))
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    _CROSS[_i, 3 * _k + _j], _CROSS[_i, 3 * _j + _k] = 1.0, -1.0
_EYE = np.eye(3)


class Twists(NamedTuple):
    """Errors of some bodies, and what their derivatives are made of.

    Attributes:
        e: twists from body to target, linear part first.  # (B, 6)
        w: rotation vectors from body to target, in the body's axes [rad].  # (B, 3)
        d: positions of the targets in the bodies' frames [m].  # (B, 3)
        A: A(w).  # (B, 3, 3)
        c: coefficient of its last term.  # (B, 1)
        slope: (dc/d|w|) / |w|.  # (B, 1)
    """

    e: np.ndarray
    w: np.ndarray
    d: np.ndarray
    A: np.ndarray
    c: np.ndarray
    slope: np.ndarray


def cross_matrix(x: np.ndarray) -> np.ndarray:
    """``[x]`` with ``[x] y = x cross y``, ``(B, 3, 3)`` for vectors ``(B, 3)``."""
    return (x @ _CROSS).reshape(-1, 3, 3)


def relative_to(quaternions: np.ndarray) -> np.ndarray:
    """Matrices L of target orientations t, wxyz, that turn a body's orientation b into the way there: ``L b = b* t``.

    Args:
        quaternions: orientations t, of unit length.  # (..., 4)

    Returns:
        L.  # (..., 4, 4)
    """
    w, x, y, z = np.moveaxis(np.asarray(quaternions), -1, 0)
    rows = [[w, x, y, z], [x, -w, -z, y], [y, z, -w, -x], [z, -y, x, -w]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def twists(way: np.ndarray, d: np.ndarray) -> Twists:
    """The errors ``e = (A(w) d, w)``, the shorter way round.

    Args:
        way: orientations of the targets in the bodies' axes, unit quaternions wxyz.  # (B, 4)
        d: positions of the targets in the bodies' frames [m].  # (B, 3)
    """
    real, imaginary = way[:, :1], way[:, 1:]
    sine = np.sqrt((imaginary * imaginary).sum(axis=1, keepdims=True))
    angle = 2.0 * np.arctan2(sine, np.abs(real))
    # Below 1e-8 angle / sine is 2 to rounding, and the quotient would come to 0/0.
    w = imaginary * np.copysign(np.where(sine > 1e-8, angle / np.maximum(sine, 1e-8), 2.0), real)
    inverse = 1.0 / np.maximum(angle, _LEAST)
    cot = 1.0 / np.tan(0.5 / inverse)
    c = inverse * (inverse - 0.5 * cot)
    # dc/da = -2/a^3 + cot/(2 a^2) + 1/(4 a sin^2), with 1/sin^2 = 1 + cot^2
    slope = inverse * inverse * (inverse * (0.5 * cot - 2.0 * inverse) + 0.25 * (1.0 + cot * cot))
    cross = cross_matrix(w)
    A = _EYE - 0.5 * cross + c[:, :, None] * np.matmul(cross, cross)
    e = np.empty((len(w), 6))
    e[:, :3] = np.matmul(A, d[:, :, None])[:, :, 0]
    e[:, 3:] = w
    return Twists(e, w, d, A, c, slope)


def turning_slopes(twists: Twists) -> np.ndarray:
    """D, how the linear part of the errors changes with w while d is held.  # (B, 3, 3)

    From ``A(w) d = d - w x d / 2 + c (w (w.d) - d |w|^2)``.
    """
    _, w, d, _, c, slope = twists
    along = (w * d).sum(axis=1, keepdims=True)
    cw = c * w
    slopes = cross_matrix(0.5 * d)
    slopes += cw[:, :, None] * d[:, None, :]
    # Two terms are columns times w': (slope (w (w.d) - d |w|^2) - 2 c d) w'
    column = (slope * along) * w - (slope * (w * w).sum(axis=1, keepdims=True) + 2.0 * c) * d
    slopes += column[:, :, None] * w[:, None, :]
    slopes += (c * along)[:, :, None] * _EYE
    return slopes
