"""Which pairs of collision shapes must keep apart."""

from __future__ import annotations

import coal  # type: ignore[import-untyped]
import mujoco
import numpy as np

from gmr_traj.robot import Capsule
from gmr_traj.robot_toml import IgnoredPair


def collision_pairs(
    model: mujoco.MjModel,
    full_model: mujoco.MjModel,
    capsules: tuple[Capsule, ...],
    within: int,
    ignored: tuple[IgnoredPair, ...],
    configurations: np.ndarray,
) -> tuple[tuple[int, int], ...]:
    """Pairs of capsules that must not overlap, as indices.

    All pairs, less those of bodies at most ``within`` joints apart in the tree (neighbours overlap by design), those of
    bodies in ``ignored``, and those that overlap in one of ``configurations``.

    Args:
        model: the compiled model, perhaps with joints locked; bodies that cannot move against each other are no pair.
        full_model: the model with all joints, in which joints are counted.
        capsules: the shapes.
        within: number of joints.
        ignored: pairs of bodies that may overlap.
        configurations: configurations in which nothing really touches.  # (C, 7 + n)
    """
    bodies = [int(model.body(c.body).id) for c in capsules]
    exempt = {frozenset(pair.bodies) for pair in ignored}
    shapes = [coal.Capsule(c.radius, float(np.linalg.norm(c.end - c.start))) for c in capsules]
    placements = [_capsule_placements(model, capsules, q) for q in configurations]
    out = []
    for i, first in enumerate(capsules):
        for k in range(i + 1, len(capsules)):
            near = joints_apart(full_model, bodies[i], bodies[k]) <= within
            rigid = joints_apart(model, bodies[i], bodies[k]) == 0
            if near or rigid or frozenset((first.body, capsules[k].body)) in exempt:
                continue
            if all(_distance(shapes[i], p[i], shapes[k], p[k]) > 0 for p in placements):
                out.append((i, k))
    return tuple(out)


def _distance(
    shape_a: coal.Capsule, T_world_a: coal.Transform3s, shape_b: coal.Capsule, T_world_b: coal.Transform3s
) -> float:
    """Signed distance of two shapes [m], negative where they overlap."""
    request = coal.DistanceRequest()
    request.enable_signed_distance = True
    return float(coal.distance(shape_a, T_world_a, shape_b, T_world_b, request, coal.DistanceResult()))


def joints_apart(model: mujoco.MjModel, a: int, b: int) -> int:
    """Number of joints on the way from body ``a`` to body ``b`` along the tree."""
    up_a, up_b = _ancestors(model, a), _ancestors(model, b)
    common = next(body for body in up_a if body in up_b)
    way = up_a[: up_a.index(common)] + up_b[: up_b.index(common)]
    return sum(int(model.body_jntnum[body]) for body in way)


def _ancestors(model: mujoco.MjModel, body: int) -> list[int]:
    """A body, its parent, its parent's parent, ... the world."""
    out = [body]
    while out[-1] > 0:
        out.append(int(model.body_parentid[out[-1]]))
    return out


def _capsule_placements(model: mujoco.MjModel, capsules: tuple[Capsule, ...], q: np.ndarray) -> list[coal.Transform3s]:
    """World placement of every capsule, with its axis along z."""
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_kinematics(model, data)
    out = []
    for capsule in capsules:
        body = data.body(capsule.body)
        R_world_body = body.xmat.reshape(3, 3)
        quaternion, rotation = np.empty(4), np.empty(9)
        mujoco.mju_quatZ2Vec(quaternion, capsule.end - capsule.start)
        mujoco.mju_quat2Mat(rotation, quaternion)
        centre = body.xpos + R_world_body @ (capsule.start + capsule.end) / 2
        out.append(coal.Transform3s(R_world_body @ rotation.reshape(3, 3), centre))
    return out
