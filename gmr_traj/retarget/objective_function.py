"""Hessian and gradient of an inverse kinematics step as one CasADi function, made along the robot's tree.

A body whose motion has the angular velocity o and, of a point that goes along with it at the centre c, the velocity v
has an error e that changes by ``K (o, v)``, K of six rows (see ``frame_error``).  With the motions a_i of the tangent's
components, ``J_b = K_b (a_i for those i that move b)``, so that of

    H = sum_b J_b' W_b^2 J_b + mu I,    gradient = sum_b J_b' W_b^2 e_b

an entry needs only what is beyond the later of its two components,

    H_ij = a_i' S_j a_j  where i moves all that j moves, 0 where neither does,    S_j = sum_{b beyond j} K_b' W_b^2 K_b,

as in the composite rigid body algorithm (Featherstone, Rigid Body Dynamics Algorithms, 6.2), with S_j in place of
inertias.  mu is ``damping + lm_damping sum_b |W_b e_b|^2``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca

from gmr_traj.retarget.frame_error import Twist


@dataclass(frozen=True)
class Tree:
    """Which component of the tangent moves what.

    Attributes:
        parents: of each component the one before it on the way from the base, -1 for none.  # nv
        last: of each body the component that moves it and nothing between it and the body.  # B
    """

    parents: tuple[int, ...]
    last: tuple[int, ...]


@lru_cache(maxsize=16)
def objective(
    tree: Tree,
    costs: tuple[tuple[float, ...], ...],
    coupled: Callable[[Twist], Any],
) -> ca.Function:
    """(errors, their (p, c, slope), their squares, centre, motions a_i, dampings) -> (H, gradient).

    The first three are what ``error_functions.body_errors`` gives, a column a body; motions (o, v) are columns.
    Dampings are damping and lm_damping.

    Args:
        tree: the robot's.
        costs: (position, orientation) cost of every body.
        coupled: C of a twist, as ``frame_error.coupling`` gives it.
    """
    count, nv = len(costs), len(tree.parents)
    errors, rest, squares = ca.SX.sym("e", 6, count), ca.SX.sym("p", 5, count), ca.SX.sym("s", 2, count)
    centre, axes, dampings = ca.SX.sym("c", 3), ca.SX.sym("a", 6, nv), ca.SX.sym("mu", 2)
    beyond: dict[int, Any] = {}
    value: Any = 0.0
    for b, (far, turned) in enumerate(costs):
        composite = _composite(bool(far), coupled)
        [own] = composite.call([errors[:, b], rest[:, b], centre, [far**2, turned**2]], True, False)
        beyond[tree.last[b]] = beyond.get(tree.last[b], 0) + own
        value += far**2 * squares[0, b] + turned**2 * squares[1, b]
    mu = dampings[0] + dampings[1] * value
    # The first three move the base, and all else with it, along the world's axes.
    motions = ca.horzcat(ca.vertcat(ca.SX(3, 3), ca.SX.eye(3)), axes[:, 3:])
    H, gradient = {(i, i): mu for i in range(nv)}, ca.SX(nv, 1)
    for j in reversed(range(nv)):
        if j not in beyond:
            continue
        [force] = _applied().call([beyond[j], motions[:, j]], True, False)
        gradient[j] = ca.dot(motions[:, j], beyond[j][21:])
        movers = [j]
        while tree.parents[movers[-1]] >= 0:
            movers.append(tree.parents[movers[-1]])
        for i, entry in zip(movers, ca.vertsplit(motions[:, movers].T @ force), strict=True):
            H[i, j] = H[j, i] = entry + mu if i == j else entry
        if len(movers) > 1:
            beyond[movers[1]] = beyond.get(movers[1], 0) + beyond[j]
    places = sorted(H, key=lambda place: place[::-1])  # column by column
    sparsity = ca.Sparsity.triplet(nv, nv, [i for i, _ in places], [j for _, j in places])
    out = [ca.densify(ca.SX(sparsity, ca.vertcat(*[H[place] for place in places]))), ca.densify(gradient)]
    return ca.Function("objective", [errors, rest, squares, centre, axes, dampings], out)


@lru_cache(maxsize=8)
def _composite(with_position: bool, coupled: Callable[[Twist], Any]) -> ca.Function:
    """Of one body: (e, (p, c, slope), centre, squared costs) -> ``K' W^2 K``, entries that differ, and ``K' W^2 e``.

    K is (X, -A) and (-A, 0) with X = A [p - centre] + C, as p moves with v + o x (p - centre).

    Args:
        with_position: whether the linear part has a cost.
        coupled: C of a twist.
    """
    e, rest, centre, costs = ca.SX.sym("e", 6), ca.SX.sym("p", 5), ca.SX.sym("c", 3), ca.SX.sym("k", 2)
    twist, far, turned = Twist(e[:3], e[3:], rest[3], rest[4]), costs[0], costs[1]
    w, c, A = twist.w, twist.c, twist.inverse_jacobian
    # A'A = I + k (w w' - |w|^2 I), as A turns about w and stretches across it; A'w = w.
    square = ca.sumsqr(w)
    k = 2.0 * c - 0.25 - c * c * square
    AA = k * _square(w) + (1.0 - k * square) * _IDENTITY
    if with_position:
        X = A @ ca.skew(rest[:3] - centre) + coupled(twist)
        XX = sum(_square(X[i, :].T) for i in range(3))
        pull = far * twist.linear
        moving = [ca.vec((-far * X).T @ A), far * AA]
        found = [far * XX + turned * AA, *moving, X.T @ pull - turned * w, -(A.T @ pull)]
    else:
        found = [turned * AA, ca.SX(15, 1), -turned * w, ca.SX(3, 1)]
    return ca.Function("composite", [e, rest, centre, costs], [ca.vertcat(*found)])


@lru_cache(maxsize=1)
def _applied() -> ca.Function:
    """(S, a) -> ``S a``: S as :func:`_composite` lists it, a of the form (o, v).  # (6, 1)"""
    composite, motion = ca.SX.sym("S", 27), ca.SX.sym("a", 6)
    turning, mixed, moving = _symmetric(composite[:6]), ca.reshape(composite[6:15], 3, 3), _symmetric(composite[15:21])
    o, v = motion[:3], motion[3:]
    return ca.Function("applied", [composite, motion], [ca.vertcat(turning @ o + mixed @ v, mixed.T @ o + moving @ v)])


# The upper triangle of a symmetric matrix, row by row.
_ROWS, _COLUMNS = (0, 0, 0, 1, 1, 2), (0, 1, 2, 1, 2, 2)
_IDENTITY = ca.DM([1.0, 0.0, 0.0, 1.0, 0.0, 1.0])


def _square(x: Any) -> Any:
    """``x x'``, its upper triangle.  # (6, 1)"""
    return ca.vertcat(*[x[i] * x[j] for i, j in zip(_ROWS, _COLUMNS, strict=True)])


def _symmetric(upper: Any) -> Any:
    a, b, c, d, e, f = (upper[k] for k in range(6))
    return ca.vertcat(ca.horzcat(a, b, c), ca.horzcat(b, d, e), ca.horzcat(c, e, f))
