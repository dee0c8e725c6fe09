"""The errors of bodies and their derivatives as CasADi functions, and calls of such functions without any overhead."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from gmr_traj.kinematics.casadi_kinematics import rotation_from_quaternion
from gmr_traj.retarget.frame_error import twist, way_between


class Call:
    """A CasADi function from and to arrays that stay where they are, without copies or checks in between.

    Args:
        function: all outputs dense.
        inputs: its arguments, contiguous, one a row for matrices of several columns.
        outputs: its results, likewise.
    """

    def __init__(self, function: ca.Function, inputs: Sequence[np.ndarray], outputs: Sequence[np.ndarray]) -> None:
        buffer: Any  # CasADi's stubs ask for a size that its binding takes from the array
        buffer, self._run = function.buffer()
        for k, array in enumerate(inputs):
            buffer.set_arg(k, array.data)
        for k, array in enumerate(outputs):
            buffer.set_res(k, array.data)
        self._kept = (buffer, inputs, outputs)  # the buffer holds addresses alone

    def __call__(self) -> None:
        """Evaluate."""
        self._run()


@lru_cache(maxsize=16)
def body_errors(with_point: bool, count: int) -> ca.Function:
    """Of each body: (position, quaternion, point, its target's position, quaternion) -> (e, (p, c, slope), squares).

    p is where the point is [m]; squares are those of the lengths of the linear [m^2] and the angular [rad^2] part.

    Args:
        with_point: whether the points count, which are the bodies' origins otherwise.
        count: of bodies; each is a column.
    """
    at, turned, point = ca.SX.sym("p", 3), ca.SX.sym("b", 4), ca.SX.sym("point", 3)
    position, quaternion = ca.SX.sym("p_t", 3), ca.SX.sym("t", 4)
    p = at + rotation_from_quaternion(turned) @ point if with_point else at
    found = twist(way_between(turned, quaternion), position - p)
    out = [ca.vertcat(found.linear, found.w), ca.vertcat(p, found.c, found.slope)]
    squares = ca.vertcat(ca.sumsqr(found.linear), ca.sumsqr(found.w))
    return ca.Function("errors", [at, turned, point, position, quaternion], [*out, squares]).map(count)
