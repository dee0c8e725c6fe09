"""A MuJoCo model's collision geoms as python-fcl shapes."""

from __future__ import annotations

from dataclasses import dataclass

import fcl
import mujoco
import numpy as np
from scipy.spatial import ConvexHull

from gmr_traj.collision.segments import Array
from gmr_traj.exceptions import RobotError
from gmr_traj.robot import Capsule

_KIND = {int(kind): kind.name.removeprefix("mjGEOM_").lower() for kind in mujoco.mjtGeom.__members__.values()}


@dataclass(frozen=True)
class Shape:
    """A collision shape fixed to a body.

    Attributes:
        name: of the geom or capsule it was made from.
        body: name of the body.
        position, rotation: placement of the shape in the body's frame [m].  # (3,), (3, 3)
        geometry: the python-fcl geometry.
    """

    name: str
    body: str
    position: Array
    rotation: Array
    geometry: fcl.CollisionGeometry


def geom_shapes(model: mujoco.MjModel) -> tuple[Shape, ...]:
    """All geoms that can collide, in the model's order; a mesh by its convex hull, as MuJoCo itself does.

    Raises:
        RobotError: a geom of a kind that has no convex shape (plane, height field, signed distance field).
    """
    colliding = [g for g in range(model.ngeom) if int(model.geom_contype[g]) or int(model.geom_conaffinity[g])]
    out = []
    for g in colliding:
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, model.geom_quat[g])
        body = model.body(int(model.geom_bodyid[g])).name
        name = model.geom(g).name or f"geom {g} of {body}"
        out.append(Shape(name, body, np.array(model.geom_pos[g]), rotation.reshape(3, 3), _geometry(model, g, name)))
    return tuple(out)


def capsule_shape(capsule: Capsule) -> Shape:
    """A robot's capsule as a shape."""
    along = capsule.end - capsule.start
    quaternion, rotation = np.empty(4), np.empty(9)
    mujoco.mju_quatZ2Vec(quaternion, along)
    mujoco.mju_quat2Mat(rotation, quaternion)
    geometry = fcl.Capsule(capsule.radius, float(np.linalg.norm(along)))
    return Shape(capsule.name, capsule.body, 0.5 * (capsule.start + capsule.end), rotation.reshape(3, 3), geometry)


def _geometry(model: mujoco.MjModel, g: int, name: str) -> fcl.CollisionGeometry:
    """The python-fcl geometry of geom g, in the geom's frame. MuJoCo gives half sizes, FCL takes whole ones."""
    size = np.array(model.geom_size[g])
    kind = _KIND[int(model.geom_type[g])]
    if kind == "sphere":
        return fcl.Sphere(size[0])
    if kind == "capsule":
        return fcl.Capsule(size[0], 2 * size[1])
    if kind == "cylinder":
        return fcl.Cylinder(size[0], 2 * size[1])
    if kind == "box":
        return fcl.Box(*(2 * size))
    if kind == "ellipsoid":
        return fcl.Ellipsoid(*size)
    if kind == "mesh":
        mesh = int(model.geom_dataid[g])
        first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        return _convex(model.mesh_vert[first : first + count].astype(np.float64))
    raise RobotError(
        f"collision geom {name!r} is a {kind}, which cannot be checked for self-collision; "
        "use a sphere, capsule, cylinder, box, ellipsoid or mesh, or set its contype and conaffinity to 0"
    )


def _convex(points: Array) -> fcl.Convex:
    """Convex hull with its triangles seen counter-clockwise from outside, as FCL expects them."""
    hull = ConvexHull(points)
    index = {int(old): new for new, old in enumerate(hull.vertices)}
    faces: list[int] = []
    for triangle, plane in zip(hull.simplices, hull.equations, strict=True):
        p, q, r = points[triangle]
        outward = np.cross(q - p, r - p) @ plane[:3] > 0
        faces += [3, *(index[int(k)] for k in (triangle if outward else triangle[::-1]))]
    return fcl.Convex(points[hull.vertices], len(hull.simplices), np.array(faces))
