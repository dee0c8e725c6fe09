"""Capsule clearances as CasADi expressions: the closed form of ``segments``, fit for Newton's method.

For capsules A (a0, a1, ra) and B (b0, b1, rb), all lengths in metres, ``c = min_st |a(s) - b(t)| - ra - rb``.
A sphere is a capsule without second end point: pass None for it, which gives a cheaper expression.
"""

from __future__ import annotations

import casadi as ca

Scalar = float | ca.SX

#: Shifts the point where the clearance has no derivative off the crossing of the axes; bounds its error [m].
CROSSING = 1e-9

#: Added to squared lengths [m^2], so that a segment may shrink to a point (1 micrometre).
POINT = 1e-12

#: Squared sine of the angle below which segments count as parallel.
PARALLEL = 1e-12

#: A direction that is not special to any robot, for capsules whose axes coincide or are points.
ANY_DIRECTION = ca.DM([0.48, 0.6, 0.64])


def witnesses(a0: ca.SX, a1: ca.SX | None, b0: ca.SX, b1: ca.SX | None) -> tuple[ca.SX, ca.SX]:
    """Parameters s, t in [0, 1] of the closest points a(s), b(t); 0 for a sphere.

    Branch-free, with min and max for the clamps; see ``segments.distance``. Its parallel step adds PARALLEL to the
    squared sine, which moves s by less than one part in 10^6 for angles above 0.001 rad and changes the distance by
    less than 10^-6 of the length for any.
    """
    zero = ca.SX(0)
    if a1 is None:
        return zero, zero if b1 is None else _project(a0, b0, b1)
    if b1 is None:
        return _project(b0, a0, a1), zero
    u, v, r = a1 - a0, b1 - b0, b0 - a0
    uu, vv, uv = ca.dot(u, u) + POINT, ca.dot(v, v) + POINT, ca.dot(u, v)
    ur, vr = ca.dot(u, r), ca.dot(v, r)
    s = _clamp((ur * vv - vr * uv) / (uu * vv * (1 + PARALLEL) - uv * uv))
    t = _clamp((s * uv - vr) / vv)
    return _clamp((t * uv + ur) / uu), t


def clearance(a0: ca.SX, a1: ca.SX | None, ra: Scalar, b0: ca.SX, b1: ca.SX | None, rb: Scalar) -> ca.SX:
    """Exact clearance of two capsules: ``min_st |a(s) - b(t)| - ra - rb`` [m], negative where they overlap.

    It is computed as ``|a(s) - b(t) + CROSSING k| - ra - rb`` with k a unit common perpendicular of the axes: within
    CROSSING of exact, and where the axes cross its gradient is k, a direction that separates them, rather than 0/0.
    The derivative is finite everywhere; it jumps where the closest point changes between the ends of (nearly)
    parallel segments, as that of the exact distance does.

    Args:
        a0: start of A.  # (3,)
        a1: end of A; None for a sphere.  # (3,)
        ra: radius of A.
        b0: start of B.  # (3,)
        b1: end of B; None for a sphere.  # (3,)
        rb: radius of B.
    """
    gap = _gap(a0, a1, b0, b1, *witnesses(a0, a1, b0, b1))
    return ca.norm_2(gap) - ra - rb


def clearance_jacobian(
    x: ca.SX, a0: ca.SX, a1: ca.SX | None, ra: Scalar, b0: ca.SX, b1: ca.SX | None, rb: Scalar
) -> tuple[ca.SX, ca.SX]:
    """The exact clearance of points that depend on x, and its Jacobian by the envelope theorem.

    At the minimum the derivatives with respect to s and t vanish or are held by a clamp, so with the unit normal
    ``n = (a(s) - b(t)) / |a(s) - b(t)|``

        dc/dx = n' ((1 - s) da0/dx + s da1/dx - (1 - t) db0/dx - t db1/dx).

    Cheaper than differentiating ``clearance``, and free of the quotients that make its derivative inaccurate for
    nearly parallel segments (the entries are bounded by those of the points' Jacobians).

    Returns:
        clearance and Jacobian.  # (1, 1), (1, nx)
    """
    s, t = witnesses(a0, a1, b0, b1)
    gap = _gap(a0, a1, b0, b1, s, t)
    length = ca.norm_2(gap)
    n = gap / length
    points, weights = [a0, b0], [n * (1 - s), -n * (1 - t)]
    if a1 is not None:
        points.append(a1)
        weights.append(n * s)
    if b1 is not None:
        points.append(b1)
        weights.append(-n * t)
    jacobian = ca.jtimes(ca.vertcat(*points), x, ca.vertcat(*weights), True).T
    return length - ra - rb, jacobian


def clearance_function(*, sphere_a: bool = False, sphere_b: bool = False) -> ca.Function:
    """``clearance`` as a function of the points: (a0, [a1,] ra, b0, [b1,] rb) -> (clearance, jacobian).

    The Jacobian is with respect to the points, stacked in the order of the inputs.  # (1, 6 | 9 | 12)
    """
    a0, b0, ra, rb = ca.SX.sym("a0", 3), ca.SX.sym("b0", 3), ca.SX.sym("ra"), ca.SX.sym("rb")
    a1 = None if sphere_a else ca.SX.sym("a1", 3)
    b1 = None if sphere_b else ca.SX.sym("b1", 3)
    of_a = [a0] if a1 is None else [a0, a1]
    of_b = [b0] if b1 is None else [b0, b1]
    value, jacobian = clearance_jacobian(ca.vertcat(*of_a, *of_b), a0, a1, ra, b0, b1, rb)
    inputs = [*of_a, ra, *of_b, rb]
    names = ["a0", "a1"][: len(of_a)] + ["ra"] + ["b0", "b1"][: len(of_b)] + ["rb"]
    return ca.Function("clearance", inputs, [value, jacobian], names, ["clearance", "jacobian"], {"cse": True})


def _project(p: ca.SX, start: ca.SX, end: ca.SX) -> ca.SX:
    """Parameter of the point of a segment closest to p."""
    along = end - start
    return _clamp(ca.dot(p - start, along) / (ca.dot(along, along) + POINT))


def _clamp(x: ca.SX) -> ca.SX:
    return ca.fmin(ca.fmax(x, 0), 1)


def _gap(a0: ca.SX, a1: ca.SX | None, b0: ca.SX, b1: ca.SX | None, s: ca.SX, t: ca.SX) -> ca.SX:
    """a(s) - b(t), moved by CROSSING along a common perpendicular so that it is never zero in practice."""
    gap = a0 - b0
    k = ca.SX(ANY_DIRECTION)
    if a1 is not None:
        gap += s * (a1 - a0)
    if b1 is not None:
        gap -= t * (b1 - b0)
    if a1 is not None and b1 is not None:
        # A thousandth of a constant direction leads from the common perpendicular over to it as u x v vanishes.
        u, v = a1 - a0, b1 - b0
        k = ca.cross(u, v) + 1e-3 * ca.sqrt((ca.dot(u, u) + POINT) * (ca.dot(v, v) + POINT)) * k
        k = k / ca.norm_2(k)
    return gap + CROSSING * k
