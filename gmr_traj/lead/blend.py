"""Quintic blends: at rest where they begin, with the clip's velocity and acceleration where they end.

    x(t) = x_0 + m(s) (x_1 - x_0) + D h_v(s_D) v + D^2 h_a(s_D) a,    s = 1 + t / A,  s_D = 1 + t / D

t is the time to the end (0 there, negative before), A the length of the blend, D <= A how long before the end the
velocity v and the acceleration a are taken up, and

    m = 10 s^3 - 15 s^4 + 6 s^5,    h_v = -4 s^3 + 7 s^4 - 3 s^5,    h_a = (s^3 - 2 s^4 + s^5) / 2.

m is the minimum-jerk curve between points of rest; h_v and h_a are 0 at both ends but for ``h_v'(1) = h_a''(1) = 1``.
One quintic over all of A has the same ends, but swings back by 0.19 A v first: up to a radian for an arm in motion.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

# How long before the end the velocity and acceleration there are taken up [s].
TAKE_UP = 0.4


def minimum_jerk(s: np.ndarray) -> np.ndarray:
    """m(s), with s cut to 0 .. 1."""
    s = np.clip(s, 0.0, 1.0)
    return np.asarray(s**3 * (10.0 + s * (-15.0 + 6.0 * s)))


def bump(s: np.ndarray) -> np.ndarray:
    """``64 s^3 (1 - s)^3``: 1 in the middle, and at both ends 0 with its first two derivatives."""
    s = np.clip(s, 0.0, 1.0)
    return np.asarray(64.0 * s**3 * (1.0 - s) ** 3)


def take_up(times: np.ndarray, duration: float, velocity: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """``D h_v v + D^2 h_a a``.  # (T, ...)

    Args:
        times: t [s].  # (T,)
        duration: D [s].
        velocity: v at t = 0.  # (...)
        acceleration: a at t = 0.  # (...)
    """
    s = np.clip(1.0 + times / duration, 0.0, 1.0)
    speed = duration * s**3 * (-4.0 + s * (7.0 - 3.0 * s))
    force = 0.5 * duration**2 * s**3 * (1.0 - s) ** 2
    return np.multiply.outer(speed, velocity) + np.multiply.outer(force, acceleration)


def blend(
    times: np.ndarray,
    duration: float,
    start: np.ndarray,
    end: np.ndarray,
    velocity: np.ndarray,
    acceleration: np.ndarray,
) -> np.ndarray:
    """x(t) with A = ``duration``.  # (T, ...)"""
    share = minimum_jerk(1.0 + times / duration)
    return start + np.multiply.outer(share, end - start) + take_up(times, _short(duration), velocity, acceleration)


def blend_rotation(
    times: np.ndarray,
    duration: float,
    start: Rotation,
    end: Rotation,
    velocity: np.ndarray,
    acceleration: np.ndarray,
) -> Rotation:
    """The same on rotations: ``exp(take_up) R_0 exp(m log(R_0' R_1))``, velocities in world axes.

    Args:
        times: t [s].  # (T,)
        duration: A [s].
        start: R_0.
        end: R_1.
        velocity: angular velocity at t = 0 [rad/s].  # (3,)
        acceleration: its rate [rad/s^2].  # (3,)
    """
    turn = (start.inv() * end).as_rotvec()
    slow = start * Rotation.from_rotvec(np.multiply.outer(minimum_jerk(1.0 + times / duration), turn))
    return Rotation.from_rotvec(take_up(times, _short(duration), velocity, acceleration)) * slow


def _short(duration: float) -> float:
    return min(TAKE_UP, duration)
