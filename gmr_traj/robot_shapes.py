"""Collision shapes: MuJoCo geoms as capsules that cover them, and the pairs that must not overlap."""

from __future__ import annotations

import coal
import mujoco
import numpy as np

from gmr_traj.exceptions import RobotError
from gmr_traj.robot import Capsule
from gmr_traj.robot_toml import RobotFile

_SPHERE, _CAPSULE = int(mujoco.mjtGeom.mjGEOM_SPHERE), int(mujoco.mjtGeom.mjGEOM_CAPSULE)


def model_capsules(model: mujoco.MjModel) -> tuple[Capsule, ...]:
    """The collision geoms of a compiled model, as capsules in their bodies' frames."""
    out = []
    for g in range(model.ngeom):
        if not (int(model.geom_contype[g]) or int(model.geom_conaffinity[g])):
            continue
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, model.geom_quat[g])
        local_start, local_end, radius = covering_capsule(model, g)
        placed = [model.geom_pos[g] + rotation.reshape(3, 3) @ p for p in (local_start, local_end)]
        for p in placed:
            p.setflags(write=False)
        body = model.body(int(model.geom_bodyid[g])).name
        out.append(Capsule(model.geom(g).name or f"{body}_shape{g}", body, placed[0], placed[1], radius))
    return tuple(out)


def covering_capsule(model: mujoco.MjModel, g: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Start, end and radius, in the geom's frame, of a capsule that covers geom ``g``."""
    kind, size = int(model.geom_type[g]), model.geom_size[g]
    if kind == _SPHERE:
        return np.zeros(3), np.zeros(3), float(size[0])
    if kind == _CAPSULE:
        return np.array([0, 0, -size[1]]), np.array([0, 0, size[1]]), float(size[0])
    raise RobotError(f"geom {model.geom(g).name!r}: shapes of this kind are not supported")


def collision_pairs(file: RobotFile, model: mujoco.MjModel, capsules: tuple[Capsule, ...], configurations: np.ndarray) -> tuple[tuple[int, int], ...]:
    """Pairs of capsules that must not overlap.

    All pairs, less: those of one body or of bodies up to ``ignore_within_joints`` joints apart in the tree (neighbours
    overlap by design), those listed in ``[[collision.ignore]]``, and those that overlap in one of ``configurations``.
    """
    bodies = [model.body(c.body).id for c in capsules]
    ignored = {frozenset(p.bodies) for p in file.ignored_pairs}
    shapes = [coal.Capsule(c.radius, float(np.linalg.norm(c.end - c.start))) for c in capsules]
    frames = [_frames(model, capsules, q) for q in configurations]
    request = coal.DistanceRequest()
    request.enable_signed_distance = True
    out = []
    for i in range(len(capsules)):
        for k in range(i + 1, len(capsules)):
            names = frozenset((capsules[i].body, capsules[k].body))
            if joints_apart(model, bodies[i], bodies[k]) <= file.ignore_within_joints or names in ignored:
                continue
            if all(coal.distance(shapes[i], f[i], shapes[k], f[k], request, coal.DistanceResult()) > 0 for f in frames):
                out.append((i, k))
    return tuple(out)


def joints_apart(model: mujoco.MjModel, a: int, b: int) -> int:
    """Number of joints between two bodies along the tree."""
    def chain(body: int) -> list[int]:
        out = [body]
        while out[-1] > 0:
            out.append(int(model.body_parentid[out[-1]]))
        return out

    up_a, up_b = chain(a), chain(b)
    common = next(x for x in up_a if x in up_b)
    between = up_a[: up_a.index(common)] + up_b[: up_b.index(common)]
    return sum(int(model.body_jntnum[x]) for x in between)


def _frames(model: mujoco.MjModel, capsules: tuple[Capsule, ...], q: np.ndarray) -> list[coal.Transform3s]:
    """World placement of each capsule, its axis along z."""
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_kinematics(model, data)
    out = []
    for c in capsules:
        body = model.body(c.body).id
        rotation = data.xmat[body].reshape(3, 3)
        axis, quat, local = c.end - c.start, np.empty(4), np.empty(9)
        mujoco.mju_quatZ2Vec(quat, axis)
        mujoco.mju_quat2Mat(local, quat)
        out.append(coal.Transform3s(rotation @ local.reshape(3, 3), data.xpos[body] + rotation @ (c.start + c.end) / 2))
    return out
