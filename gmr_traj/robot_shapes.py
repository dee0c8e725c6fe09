"""Collision shapes of a model as capsules that cover them."""

from __future__ import annotations

import mujoco
import numpy as np

from gmr_traj.exceptions import RobotError
from gmr_traj.robot import Capsule

_GEOM = mujoco.mjtGeom
# A cylinder's rim is replaced by a regular polygon around it.
_RIM_POINTS = 24
# Radii tried for the capsule around a set of points, as multiples of the smallest possible one.
_RADIUS_FACTORS = np.linspace(1.0, 1.6, 13)


def model_capsules(model: mujoco.MjModel) -> tuple[Capsule, ...]:
    """The collision geoms (those with contact) of a compiled model, as capsules in their bodies' frames.

    Spheres and capsules stay what they are; other kinds become the capsule of ``covering_capsule``.

    Raises:
        RobotError: a body has a collision geom of a kind that no capsule can cover (a plane, a height field).
    """
    out = []
    for g in range(model.ngeom):
        if not (int(model.geom_contype[g]) or int(model.geom_conaffinity[g])):
            continue
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, model.geom_quat[g])
        local_start, local_end, radius = covering_capsule(model, g)
        start, end = (model.geom_pos[g] + rotation.reshape(3, 3) @ p for p in (local_start, local_end))
        for point in (start, end):
            point.setflags(write=False)
        body = model.body(int(model.geom_bodyid[g])).name
        out.append(Capsule(model.geom(g).name or f"{body}_shape{g}", body, start, end, radius))
    return tuple(out)


def covering_capsule(model: mujoco.MjModel, g: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Start, end [m] and radius [m], in the geom's frame, of a capsule that covers geom ``g``.

    - Ellipsoid with semi-axes a >= b >= c: radius b, the segment of half length a - b along the longest axis.
    - Box and cylinder: ``cover_points`` of the corners, or of a polygon around the rims.
    - Mesh: ``cover_points`` of its vertices, which covers its convex hull too.

    Raises:
        RobotError: the geom is of another kind.
    """
    kind, size = int(model.geom_type[g]), np.array(model.geom_size[g])
    if kind == int(_GEOM.mjGEOM_SPHERE):
        return np.zeros(3), np.zeros(3), float(size[0])
    if kind == int(_GEOM.mjGEOM_CAPSULE):
        half = np.array([0.0, 0.0, size[1]])
        return -half, half, float(size[0])
    if kind == int(_GEOM.mjGEOM_ELLIPSOID):
        order = np.argsort(size)
        half = np.zeros(3)
        half[order[2]] = size[order[2]] - size[order[1]]
        return -half, half, float(size[order[1]])
    if kind == int(_GEOM.mjGEOM_BOX):
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
        return cover_points(signs * size)
    if kind == int(_GEOM.mjGEOM_CYLINDER):
        angle = np.arange(_RIM_POINTS) * 2 * np.pi / _RIM_POINTS
        radius = size[0] / np.cos(np.pi / _RIM_POINTS)  # of the polygon whose sides touch the rim
        rim = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(_RIM_POINTS, size[1])], axis=1)
        return cover_points(np.vstack([rim, rim * [1, 1, -1]]))
    if kind == int(_GEOM.mjGEOM_MESH):
        mesh = int(model.geom_dataid[g])
        first = int(model.mesh_vertadr[mesh])
        return cover_points(np.array(model.mesh_vert[first : first + int(model.mesh_vertnum[mesh])], dtype=float))
    body = model.body(int(model.geom_bodyid[g])).name
    raise RobotError(
        f"body {body!r}: collision shape {model.geom(g).name!r} is of a kind that no capsule covers; expected a mesh, "
        "box, cylinder, ellipsoid, sphere or capsule"
    )


def cover_points(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Start, end and radius of the smallest capsule around points that this search finds.

    The axis is tried along each principal axis of the points, through the middle of their extents across it; the
    radius from the smallest possible (the largest distance d_i from the axis) upwards.  A point at t_i along the axis
    lies inside if ``start - s_i <= t_i <= end + s_i`` with ``s_i = sqrt(radius^2 - d_i^2)``, so the segment runs from
    ``min(t_i + s_i)`` to ``max(t_i - s_i)``.  The smallest volume wins.

    Args:
        points: at least one point [m].  # (K, 3)
    """
    centre = points.mean(axis=0)
    axes = np.linalg.eigh((points - centre).T @ (points - centre))[1].T  # rows
    along = (points - centre) @ axes.T  # (K, 3)
    middle = (along.min(axis=0) + along.max(axis=0)) / 2
    best: tuple[float, np.ndarray, np.ndarray, float] | None = None
    for k in range(3):
        across = np.delete(along - middle, k, axis=1)
        distance = np.linalg.norm(across, axis=1)
        for radius in distance.max() * _RADIUS_FACTORS:
            slack = np.sqrt(np.maximum(radius**2 - distance**2, 0.0))
            low, high = (along[:, k] + slack).min(), (along[:, k] - slack).max()
            if low > high:  # one ball covers all: any centre between high and low
                low = high = (low + high) / 2
            volume = np.pi * radius**2 * (high - low + 4 / 3 * radius)
            if best is None or volume < best[0]:
                ends = np.stack([middle, middle])
                ends[:, k] = low, high
                start, end = centre + ends @ axes
                best = float(volume), start, end, float(radius)
    assert best is not None
    return best[1], best[2], best[3]
