"""The wrench that three consecutive configurations need from outside, and its Jacobian, as CasADi expressions.

A robot of rigid bodies is a cloud of points of masses m_p.  With p-, p0, p+ its points in three frames dt apart, c the
centre of mass, m the whole mass and o a point on the floor, over ``m g``:

    F = (c+ - 2 c0 + c-) / (g dt^2) + e_z
    M = (sum_p m_p p0 x (p+ + p-)) / (m g dt^2) - o x (c+ - 2 c0 + c-) / (g dt^2) + (c0 - o) x e_z

F is the force and M the moment about o.  The sum is the difference of the discrete angular momenta
``sum m_p p0 x p+ / dt`` of the two intervals, so the rate of the whole angular momentum is in it: arms and legs swing
with their mass.  Over the points of one body, with mass centre x and second moments C = sum m_p s s' about it,
``sum m_p p0 p+' = m_b x0 x+' + R0 C R+'``: no body is ever cut into points, and the Jacobian needs the sums of these
matrices over what each joint carries, from the leaves to the root.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import casadi as ca
import mujoco
import numpy as np

from gmr_traj.constants import GRAVITY
from gmr_traj.kinematics.casadi_kinematics import CasadiKinematics, Placements, constant_rotation
from gmr_traj.terms.composite import left_jacobian

#: Numbers that describe one sole's part in where the moment is taken about: its share, a point in its body, its place.
FOOT = 6

# Bodies whose second moments over the robot's mass are below this are points [m^2]: turned at 300 rad/s^2, one of them
# asks for a moment of less than 0.001 m g m.
_COMPACT = 3e-5


class _Carried:
    """Sums over everything that hangs on a body, itself included: masses of one or two frames.

    Attributes:
        first: sum of m_p p0.  # (3, 1)
        second: sum of m_p p+.  # (3, 1)
        product: sum of m_p p0 p+'.  # (3, 3)
    """

    def __init__(self, first: Any, second: Any, product: Any) -> None:
        self.first, self.second, self.product = first, second, product

    def __add__(self, other: _Carried) -> _Carried:
        return _Carried(self.first + other.first, self.second + other.second, self.product + other.product)


def symbols(kinematics: CasadiKinematics) -> list[Any]:
    """The arguments of :func:`wrench`: z, q, o, k, feet."""
    robot = kinematics.robot
    sizes = {
        "z": 3 * kinematics.tangent_size,
        "q": 3 * (7 + robot.dof),
        "o": 3,
        "k": 1,
        "feet": FOOT * len(robot.soles),
    }
    return [ca.SX.sym(name, size) for name, size in sizes.items()]


def around(values: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Values of the frame before, of the frame and of the one after, of some frames.  # (T, n) -> (F, 3 n)"""
    return np.hstack([values[frames - 1], values[frames], values[frames + 1]])


def arguments(
    qpos: np.ndarray, dt: float, frames: np.ndarray, origins: np.ndarray, feet: np.ndarray
) -> list[np.ndarray]:
    """q, o, k and feet of :func:`wrench`, of some frames F.

    Args:
        qpos: configurations.  # (T, 7 + n)
        dt: time between frames [s].
        frames: neither the first nor the last.  # (F,)
        origins: points of the floor [m].  # (T, 3)
        feet: each sole's share, own point and place.  # (T, S, FOOT)
    """
    k = np.full((len(frames), 1), 1.0 / (GRAVITY * dt**2))
    return [around(qpos, frames), origins[frames], k, feet[frames].reshape(len(frames), -1)]


@lru_cache(maxsize=4)
def wrench(kinematics: CasadiKinematics) -> tuple[ca.Function, ca.Function]:
    """(z, q, o, k, feet) -> w, the wrench over m g, ``(6, 1)``, force first; and -> J = dw/dz, ``(6, 3 (6 + n))``.

    z are the tangent steps of three frames, q their configurations, o a point of the floor [m], k = 1 / (g dt^2) [1/m].
    Where the feet are not where they were expected, the moment is about a point that goes with them: ``o + s`` with
    ``s = sum_f share_f (p_f - place_f)``, p_f the horizontal position of a point of foot f; ``feet`` has each foot's
    share, point in its body [m] (3) and expected place [m] (2).
    """
    size = kinematics.tangent_size
    z, q, o, k, feet = symbols(kinematics)
    steps = [z[i * size : (i + 1) * size] for i in range(3)]
    # Heights count from the floor, places from o: the numbers stay small, and the moment is about o at once.
    width = 7 + kinematics.robot.dof
    placed = []
    for i in range(3):
        reference = q[i * width : (i + 1) * width]
        placed.append(kinematics.placements(steps[i], ca.vertcat(reference[:3] - o, reference[3:])))
    masses = [_mass_points(kinematics, frame) for frame in placed]
    tree = _Tree(kinematics)
    after = tree.carried(masses[1], masses[2])
    before = tree.carried(masses[1], masses[0])
    up = ca.DM([0, 0, 1])
    centres = [before[0].second, before[0].first, after[0].second]
    force = k * (centres[2] - 2 * centres[1] + centres[0]) + up
    moment = k * (_axial(after[0].product) + _axial(before[0].product)) + ca.cross(centres[1], up)
    blocks = []
    for frame, step, sums, factor in (
        (placed[0], steps[0], before, k),
        (placed[2], steps[2], after, k),
    ):
        linear, angular = tree.derivatives(frame, step, sums)
        blocks.append(ca.vertcat(factor * linear, factor * angular))
    # The middle frame's points are in both sums: p0 x (p+ + p-) = -(p+ + p-) x p0.
    middle = [
        _Carried(a.second + b.second, a.first, (a.product + b.product).T) for a, b in zip(after, before, strict=True)
    ]
    linear, angular = tree.derivatives(placed[1], steps[1], middle)
    lever = ca.vertcat(linear[1, :], -linear[0, :], ca.SX(1, linear.shape[1]))
    blocks.insert(1, ca.vertcat(-2 * k * linear, -k * angular + lever))
    # M about o + s is M - s x F.
    off, turns = ca.SX.zeros(3), ca.SX(3, size)
    for number, sole in enumerate(kinematics.robot.soles):
        given = feet[FOOT * number : FOOT * (number + 1)]
        share = given[0]
        point, moves = tree.point(placed[1], steps[1], kinematics.slot(sole.body), given[1:4])
        off += share * ca.vertcat(point[:2] + o[:2] - given[4:6], 0)
        turns += share * ca.vertcat(moves[:2, :], ca.SX(1, size))
    moment -= ca.cross(off, force)
    jacobian = ca.horzcat(*blocks)
    jacobian[3:, :] -= ca.skew(off) @ jacobian[:3, :]
    jacobian[3:, size : 2 * size] += ca.skew(force) @ turns
    given, names, options = [z, q, o, k, feet], ["z", "q", "o", "k", "feet"], {"cse": True}
    return (
        ca.Function("wrench", given, [ca.vertcat(force, moment)], names, ["w"], options),
        ca.Function("wrench_jacobian", given, [jacobian], names, ["J"], options),
    )


def _axial(product: Any) -> Any:
    """``sum m_p a x b`` of the matrix ``sum m_p a b'``."""
    return ca.vertcat(product[1, 2] - product[2, 1], product[2, 0] - product[0, 2], product[0, 1] - product[1, 0])


def _mass_points(kinematics: CasadiKinematics, placements: Placements) -> list[tuple[float, Any, Any, np.ndarray]]:
    """Of every body: its share of the mass, where its mass centre is, the principal axes there, the moments by them."""
    model = kinematics.robot.model
    total = float(model.body_mass.sum())
    out = []
    for slot, name in enumerate(kinematics.robot.body_names):
        body = int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name))
        rotation = placements.rotations[slot]
        centre = placements.positions[slot] + rotation @ ca.DM(model.body_ipos[body])
        axes = rotation @ constant_rotation(model.body_iquat[body])
        inertia = np.asarray(model.body_inertia[body])
        # The moment about an axis is the sum of the second moments along the two others.
        moments = (inertia.sum() / 2 - inertia) / total
        if moments.max() < _COMPACT:
            moments = np.zeros(3)
        out.append((float(model.body_mass[body]) / total, centre, axes, moments))
    return out


class _Tree:
    """Sums up the tree, and derivatives of the sums by what each joint carries."""

    def __init__(self, kinematics: CasadiKinematics) -> None:
        model = kinematics.robot.model
        names = kinematics.robot.body_names
        self._size = kinematics.tangent_size
        ids = [int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)) for name in names]
        slot = {body: k for k, body in enumerate(ids)}
        self._parents = [slot.get(int(model.body_parentid[body]), -1) for body in ids]
        self._joints = [-1] * len(ids)
        for k, body in enumerate(ids[1:], start=1):
            if int(model.body_jntnum[body]):
                self._joints[k] = int(model.jnt_qposadr[int(model.body_jntadr[body])]) - 7
        share = np.array([float(model.body_mass[body]) for body in ids]) / float(model.body_mass.sum())
        for k in range(len(ids) - 1, 0, -1):
            share[self._parents[k]] += share[k]
        self._share = share.tolist()

    def carried(self, first: list[Any], second: list[Any]) -> list[_Carried]:
        """Sums of every body and what hangs on it."""
        out: list[_Carried] = []
        for (mass, x, R, moments), (_, y, S, _) in zip(first, second, strict=True):
            product = (mass * x) @ y.T
            for axis in range(3) if moments.any() else ():
                product = product + (float(moments[axis]) * R[:, axis]) @ S[:, axis].T
            out.append(_Carried(mass * x, mass * y, product))
        for k in range(len(out) - 1, 0, -1):
            out[self._parents[k]] = out[self._parents[k]] + out[k]
        return out

    def derivatives(self, placements: Placements, step: Any, sums: list[_Carried]) -> tuple[Any, Any]:
        """``sum m_p dp+`` and ``sum m_p p0 x dp+`` by the step of the second frame, ``(3, 6 + n)`` each.

        A joint of axis a through the point c moves what it carries by ``a x (p - c)``, and

            sum m_p p0 x (a x (p - c)) = a (tr Q - P0 . c) - (Q' a - c (P0 . a)),   Q = sum m_p p0 p', P0 = sum m_p p0.
        """
        linear, angular = ca.SX(3, self._size), ca.SX(3, self._size)
        whole, base = sums[0], placements.positions[0]
        mass = self._share
        linear[:, :3] = mass[0] * ca.SX.eye(3)
        angular[:, :3] = ca.skew(whole.first)
        turn = left_jacobian(step[3:6])
        linear[:, 3:6] = -ca.skew(whole.second - mass[0] * base) @ turn
        trace = ca.trace(whole.product) - ca.dot(whole.first, base)
        spin = trace * ca.SX.eye(3) - whole.product.T + base @ whole.first.T
        angular[:, 3:6] = spin @ turn
        for slot in range(1, len(sums)):
            joint, own = self._joints[slot], sums[slot]
            if joint < 0:
                continue
            a, c = placements.axes[joint], placements.centres[joint]
            linear[:, 6 + joint] = ca.cross(a, own.second - mass[slot] * c)
            angular[:, 6 + joint] = a * (ca.trace(own.product) - ca.dot(own.first, c)) - (
                own.product.T @ a - c * ca.dot(own.first, a)
            )
        return linear, angular

    def point(self, placements: Placements, step: Any, slot: int, own: Any) -> tuple[Any, Any]:
        """World position of a point of a body and its Jacobian by the step, ``(3, 6 + n)``."""
        point = placements.positions[slot] + placements.rotations[slot] @ own
        moves = ca.SX(3, self._size)
        moves[:, :3] = ca.SX.eye(3)
        moves[:, 3:6] = -ca.skew(point - placements.positions[0]) @ left_jacobian(step[3:6])
        while slot > 0:
            joint = self._joints[slot]
            if joint >= 0:
                moves[:, 6 + joint] = ca.cross(placements.axes[joint], point - placements.centres[joint])
            slot = self._parents[slot]
        return point, moves
