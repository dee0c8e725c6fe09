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

# Below this angle [rad] the coefficients come from their series, which are exact to rounding there.
_SMALL = 0.05
# S(x) = [x], the matrix of the cross product, as a row vector times this: x @ _CROSS -> nine elements, row by row.
_CROSS = np.zeros((3, 9))
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    _CROSS[_i, 3 * _k + _j], _CROSS[_i, 3 * _j + _k] = 1.0, -1.0
_EYE = np.eye(3)


def cross_matrix(x: np.ndarray) -> np.ndarray:
    """``[x]`` with ``[x] y = x cross y``, ``(B, 3, 3)`` for vectors ``(B, 3)``."""
    return (x @ _CROSS).reshape(-1, 3, 3)


def rotation_vectors(body: np.ndarray, target: np.ndarray) -> np.ndarray:
    """``w = log(R' R_t)``, the shorter way round [rad].

    Args:
        body: orientations of the bodies, unit quaternions wxyz.  # (B, 4)
        target: orientations of the targets.  # (B, 4)

    Returns:
        Rotation vectors in the bodies' axes.  # (B, 3)
    """
    bw, bv, tw, tv = body[:, :1], body[:, 1:], target[:, :1], target[:, 1:]
    real = bw * tw + (bv * tv).sum(axis=1, keepdims=True)  # (B, 1)
    imaginary = bw * tv - tw * bv - np.matmul(cross_matrix(bv), tv[:, :, None])[:, :, 0]  # (B, 3)
    norm = np.sqrt((imaginary * imaginary).sum(axis=1, keepdims=True))
    angle = 2.0 * np.arctan2(norm, np.abs(real))
    # sin(x)/x is 1 to rounding below 1e-8, where the quotient would be 0/0.
    factor = np.where(norm > 1e-8, angle / np.maximum(norm, 1e-8), 2.0)
    return np.where(real < 0.0, -factor, factor) * imaginary


class Twists(NamedTuple):
    """Errors of some bodies, and what their derivatives are made of.

    Attributes:
        e: twists from body to target, linear part first.  # (B, 6)
        w: rotation vectors from body to target, in the body's axes [rad].  # (B, 3)
        d: positions of the targets in the bodies' frames [m].  # (B, 3)
        A: A(w).  # (B, 3, 3)
        c: coefficient of its last term.  # (B, 1, 1)
        slope: (dc/d|w|) / |w|.  # (B, 1, 1)
    """

    e: np.ndarray
    w: np.ndarray
    d: np.ndarray
    A: np.ndarray
    c: np.ndarray
    slope: np.ndarray


def twists(w: np.ndarray, d: np.ndarray) -> Twists:
    """The errors ``e = (A(w) d, w)``.

    Args:
        w: rotation vectors from body to target, in the bodies' axes [rad].  # (B, 3)
        d: positions of the targets in the bodies' frames [m].  # (B, 3)
    """
    square = (w * w).sum(axis=1)
    angle = np.sqrt(square)
    small = angle < _SMALL
    a = np.where(small, 1.0, angle)
    cot = 1.0 / np.tan(0.5 * a)
    inverse = 1.0 / a
    c = inverse * (inverse - 0.5 * cot)
    # dc/da = -2/a^3 + cot/(2 a^2) + 1/(4 a sin^2), with 1/sin^2 = 1 + cot^2
    slope = inverse * inverse * (inverse * (0.5 * cot - 2.0 * inverse) + 0.25 * (1.0 + cot * cot))
    if small.any():
        c = np.where(small, 1 / 12 + square * (1 / 720 + square / 30240), c)
        slope = np.where(small, 1 / 360 + square * (1 / 7560 + square / 201600), slope)
    c, slope = c[:, None, None], slope[:, None, None]
    cross = cross_matrix(w)
    A = _EYE - 0.5 * cross + c * np.matmul(cross, cross)
    e = np.empty((len(w), 6))
    e[:, :3] = np.matmul(A, d[:, :, None])[:, :, 0]
    e[:, 3:] = w
    return Twists(e, w, d, A, c, slope)


def derivatives(twists: Twists) -> np.ndarray:
    """How the errors change with the bodies' own twists: de/d(v, o).  # (B, 6, 6)"""
    _, w, d, A, c, slope = twists
    # A(w) d = d - w x d / 2 + c w x (w x d),  w x (w x d) = w (w.d) - d |w|^2
    along = (w * d).sum(axis=1)[:, None]
    twice = w * along - d * (w * w).sum(axis=1)[:, None]
    outer = w[:, :, None] * d[:, None, :] - 2.0 * d[:, :, None] * w[:, None, :]
    cross = cross_matrix(d)
    D = 0.5 * cross + c * (along[:, :, None] * _EYE + outer) + slope * twice[:, :, None] * w[:, None, :]
    out = np.zeros((len(w), 6, 6))
    out[:, :3, :3] = out[:, 3:, 3:] = -A
    out[:, :3, 3:] = np.matmul(A, cross) - np.matmul(D, A)
    return out
