"""The wrench that a motion needs is one that the floor can give, and the leg that passes it on.

With F, M the force and the moment about a point of the floor that frames t-1, t, t+1 need, over m g
(:mod:`~gmr_traj.terms.centroidal`), and the convex hull of the points that can bear a load at t, with inward normals
n_e and offsets d_e, the rows are

    F_z >= 0,    mu F_z - |F_x| - |F_y| >= 0,    n_ey M_x - n_ex M_y - (d_e + margin) F_z >= 0,

the last one for every edge: the zero-moment point is inside the hull.  Where no point can bear a load the robot flies:
``F = 0, M = 0``.  For contacts on one plane these are all the conditions there are, but for the moment about the
vertical.  No force is an unknown: a wrench that keeps the rows can be made up of forces at the points.  Where one foot
bears it all, a joint of its leg, of axis a through c, has the torque ``w - a . (M - c x F)`` with w what the leg's own
weight asks of it (its inertia is left out), and

    |w - a . (M - c x F)| <= effort * limit.

A frame in which the stances do not say what carries the robot (it lies on its back, say) has no rows.

Hands, knees, elbows and hips in stance are points of the hull like any other.

The hull goes with the feet; the legs' axes are those of the centre motion.  A row that is off by e scales costs
``robust^2 (sqrt(1 + e^2 / robust^2) - 1)``: where the schedule is wrong a row cannot be kept, and must not win.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import casadi as ca
import numpy as np

from gmr_traj.constants import GRAVITY
from gmr_traj.contacts.support import edges, thinned
from gmr_traj.kinematics.casadi_kinematics import CasadiKinematics
from gmr_traj.residuals import FrameResidual, GaussNewton, Residual
from gmr_traj.robot import Robot
from gmr_traj.terms import vertical_moment
from gmr_traj.terms.centroidal import FOOT, arguments, around, symbols, wrench
from gmr_traj.terms.context import Context
from gmr_traj.terms.stance_support import LEG, hinges, leg, support, unexplained, weight_torques
from gmr_traj.terms.term import Term
from gmr_traj.variables import Variables

#: A missing bound is far away: an infinity would turn into NaN where it is multiplied by zero.
FAR = 1e9
#: Rows of the force: pressing, and the four sides of the pyramid of friction.
CONE = 5
# Half the width of what a line of points can bear [m].
_WIDTH = 0.01
# A step moves the wrench where it moves the mean of the masses, or of their moments, by more than this [m, m^2].
_FELT = 0.004


@dataclass(frozen=True)
class ContactWrench(Term):
    """Scales of what is missing, and what the floor and the legs are taken to give.

    Fields: ``force`` [m g], ``moment`` [m g m] and ``torque`` [m g m], scales; ``robust``, in scales, see above;
    ``friction`` [-]; ``margin``, how far inside the hull the zero-moment point is to be [m]; ``effort``, share of the
    joints' effort limits; ``vertical``, scale of the moment about the vertical where one foot bears it all [m g m],
    which is not bounded where none is given (see :mod:`~gmr_traj.terms.vertical_moment`).
    """

    force: float
    moment: float
    torque: float
    robust: float
    friction: float
    margin: float
    effort: float
    vertical: float = math.inf

    dynamic: ClassVar[bool] = True

    def residuals(self, context: Context, variables: Variables) -> list[Residual]:
        """One residual, over all frames but the first and the last."""
        if context.frames < 3:
            return []
        frames = np.arange(1, context.frames - 1)
        qpos = context.centre.qpos
        origins = qpos[:, :3] * [1.0, 1.0, 0.0]
        maps, lower, upper, feet = self._rows(context, origins)
        counts = [CONE, most_edges(context.robot), LEG, maps.shape[1] - CONE - most_edges(context.robot) - LEG]
        scale = np.repeat([self.force, self.moment, self.torque, self.vertical], counts)
        # In flight the first six rows are the wrench itself.
        flight = (lower[:, 0] == 0.0) & (upper[:, 0] == 0.0)
        scales = np.tile(scale, (context.frames, 1))
        scales[flight, :6] = np.repeat([self.force, self.moment], 3)
        parameters = np.hstack(
            [
                *arguments(qpos, context.dt, frames, origins, feet),
                maps[frames].transpose(0, 2, 1).reshape(len(frames), -1),
                context.dt / scales[frames] ** 2,
                lower[frames],
                upper[frames],
            ]
        ).T
        functions = _functions(context.kinematics, self.robust, maps.shape[1])
        columns = around(variables.steps, frames)
        return [FrameResidual.cost("contact_wrench", "all rows", frames, columns, parameters, functions)]

    def _unexplained(self, context: Context, able: np.ndarray) -> np.ndarray:
        """Frames without rows.  # (T,) bool"""
        return unexplained(context, able)

    def _rows(self, context: Context, origins: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Rows as ``lower <= A (F, M) <= upper``, M about the origins moved with the feet, and those feet.

        Args:
            context: the centre motion and its schedule.
            origins: points of the floor [m].  # (T, 3)

        Returns:
            A  # (T, R, 6), lower, upper  # (T, R), and each sole's share, own point and place  # (T, S, FOOT).
        """
        robot, frames = context.robot, context.frames
        given = support(context)
        positions, rotations = context.placements
        axes, anchors = hinges(robot, context.placements)
        hanging = weight_torques(robot, context.placements, axes, anchors)
        legs = [leg(robot, sole.body) for sole in robot.soles]
        bodies = [robot.body_names.index(sole.body) for sole in robot.soles]
        most = self.effort * robot.effort_limit / (float(robot.model.body_mass.sum()) * GRAVITY)
        signs = np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])
        of_legs = CONE + most_edges(robot)
        rows = of_legs + LEG + (vertical_moment.COUNT if math.isfinite(self.vertical) else 0)
        maps = np.zeros((frames, rows, 6))
        lower, upper = np.full((frames, rows), -FAR), np.full((frames, rows), FAR)
        feet = np.zeros((frames, len(robot.soles), FOOT))
        # Points stay where they are for a stance: what follows from them alone is found once.
        known: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}
        turning: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}
        for t in np.flatnonzero(~self._unexplained(context, given.able)).tolist():
            able = given.able[t]
            if not able.any():
                maps[t, :6] = np.eye(6)
                lower[t, :6] = upper[t, :6] = 0.0
                continue
            points = given.places[t, able]
            key = points.tobytes()
            if key not in known:
                known[key] = edges(thinned(points, most_edges(robot)), _WIDTH)
            normals, offsets = known[key]
            last = CONE + len(normals)
            maps[t, :CONE, 2] = [1.0, *[self.friction] * 4]
            maps[t, 1:CONE, :2] = signs
            maps[t, CONE:last, 3:5] = normals[:, ::-1] * [1.0, -1.0]
            maps[t, CONE:last, 2] = normals @ origins[t, :2] - offsets - self.margin
            lower[t, :last] = 0.0
            standing = np.unique(given.soles[able])
            for s in standing[standing < len(robot.soles)]:
                its = able & (given.soles == s)
                feet[t, s, 0] = 1.0 / len(standing)
                feet[t, s, 1:4] = given.own[its].mean(axis=0)
                feet[t, s, 4:] = given.places[t, its].mean(axis=0)
            if len(standing) > 1 or standing[0] >= len(robot.soles):
                continue
            if math.isfinite(self.vertical):
                if key not in turning:
                    turning[key] = vertical_moment.rows_about_centre(points, _WIDTH, self.friction)
                maps[t, of_legs + LEG :] = vertical_moment.moved(*turning[key], origins[t])
                lower[t, of_legs + LEG :] = 0.0
            s = int(standing[0])
            now = positions[t, bodies[s]] + rotations[t, bodies[s]] @ feet[t, s, 1:4]
            moved = np.append(feet[t, s, 4:] - now[:2], 0.0)
            its = legs[s]
            here = slice(of_legs, of_legs + len(its))
            maps[t, here, :3] = -np.cross(axes[t, its], anchors[t, its] + moved - origins[t])
            maps[t, here, 3:] = axes[t, its]
            lower[t, here], upper[t, here] = hanging[t, its] - most[its], hanging[t, its] + most[its]
        return maps, lower, upper, feet


def most_edges(robot: Robot) -> int:
    """How many edges a hull of all sole points can have, and no other has more; that of a point or a line has four."""
    return max(4, sum(len(sole.points) for sole in robot.soles))


@lru_cache(maxsize=8)
def _functions(kinematics: CasadiKinematics, robust: float, rows: int) -> GaussNewton:
    """Value, gradient and Hessian of one frame's cost, of so many rows."""
    size = kinematics.tangent_size
    needed, jacobian = wrench(kinematics)
    z, *given = symbols(kinematics)
    flat = ca.SX.sym("A", 6 * rows)
    weights, lower, upper = (ca.SX.sym(name, rows) for name in ("w", "l", "u"))
    A, dt = ca.reshape(flat, rows, 6), ca.sqrt(1 / (given[2] * GRAVITY))
    r, J = A @ needed(z, *given), jacobian(z, *given)
    error = ca.fmax(0, r - upper) - ca.fmax(0, lower - r)
    outside = ca.logic_or(ca.logic_or(r < lower, r > upper), lower == upper)
    # The Hessian is that of the least squares with the weights the robust cost gives now, as in tracking.
    root = ca.sqrt(1 + error**2 * weights / (dt * robust**2))
    pull = weights / root
    of_wrench = A.T @ (ca.repmat(pull * outside, 1, 6) * A)
    felt = _felt(kinematics).tolist()
    part = ca.SX(6, 3 * size)
    part[:, felt] = J[:, felt]
    return GaussNewton(
        z,
        ca.vertcat(*given, flat, weights, lower, upper),
        dt * robust**2 * ca.sum1(root - 1),
        J.T @ (A.T @ (pull * error)),
        (ca.sparsify(part), of_wrench),
    )


def _felt(kinematics: CasadiKinematics) -> np.ndarray:
    """Which of the steps of three frames move the wrench enough to be in the model of the Hessian.

    Wrists and ankles carry a hundredth of the robot: the smoothness of the motion curves the objective along them far
    more than the wrench does, and without them there is less to multiply and to factorise.  The gradient has all.
    """
    robot, size = kinematics.robot, kinematics.tangent_size
    _, jacobian = wrench(kinematics)
    feet = np.zeros(FOOT * len(robot.soles))
    by_steps = np.array(jacobian(np.zeros(3 * size), np.tile(robot.nominal, 3), np.zeros(3), 1.0, feet))
    kept = np.flatnonzero(np.linalg.norm(by_steps[:, 2 * size :], axis=0) > _FELT)
    return np.concatenate([kept + i * size for i in range(3)])
