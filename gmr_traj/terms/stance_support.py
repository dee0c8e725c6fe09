"""What the stances of a schedule can bear in every frame: which points, where they stand, with which legs.

And what they do not explain: a clip may lie on its back, or stand on a box that nobody has told of.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gmr_traj.contacts.carrying import CarryingSettings, bearing, centre_height, load
from gmr_traj.contacts.limbs import limb_points
from gmr_traj.contacts.mask import limb_owners, limbs_to_mask
from gmr_traj.kinematics.mujoco_kinematics import body_points, lowest_points
from gmr_traj.robot import BodySupport, Robot, Sole
from gmr_traj.runs import runs
from gmr_traj.terms.context import Context

#: Joints of a leg that are looked at, from the foot up.
LEG = 6
# A body other than a foot that is lower than this may carry the robot [m].
_LOW = 0.025
# A robot that nothing known carries for longer than this [s], and that is carried to this extent all the same, stands
# on something else.  In a jump that was scaled down from a larger person the load seems to be 0.5 to 0.7.
_UNKNOWN, _CARRIED = 0.3, 0.8


@dataclass(frozen=True)
class Support:
    """Points that can bear a load; K are those of all soles, one after the other, and then those of the other supports.

    Attributes:
        able: which can.  # (T, K) bool
        places: where they stay during their stance [m].  # (T, K, 2)
        soles: the sole of each point; from the number of soles on the other supports.  # (K,)
        own: each point in its body's frame [m].  # (K, 3)
    """

    able: np.ndarray
    places: np.ndarray
    soles: np.ndarray
    own: np.ndarray


def support(context: Context) -> Support:
    """The support that the schedule gives the centre motion."""
    resting, places = [], []
    for sole in context.robot.soles:
        slot = context.robot.body_names.index(sole.body)
        points = body_points(context.placements, slot, sole.points)
        place = points[..., :2].copy()
        on = np.zeros(place.shape[:2], bool)
        for stance in (s for s in context.schedule.stances if s.sole == sole.name):
            during = slice(stance.start, stance.stop)
            on[during, stance.point] = True
            place[during, stance.point] = points[during, stance.point, :2].mean(axis=0)
        resting.append(on)
        places.append(place)
    on_limbs = limbs_to_mask(context.schedule, context.robot)
    limbs = limb_points(context.robot, context.placements)[0][..., :2]
    for k in range(limbs.shape[1]):
        for start, stop in runs(on_limbs[:, k]):
            limbs[start:stop, k] = limbs[start:stop, k].mean(axis=0)
    whose: list[Sole | BodySupport] = [*context.robot.soles, *context.robot.supports]
    return Support(
        able=bearing(np.hstack([np.concatenate(resting, axis=1) & ~context.turning, on_limbs])),
        places=np.concatenate([*places, limbs], axis=1),
        soles=np.repeat(np.arange(len(whose)), [len(one.points) for one in whose]),
        own=np.concatenate([one.points for one in whose]),
    )


def unexplained(context: Context, able: np.ndarray) -> np.ndarray:
    """Frames of which the stances say nothing about what carries the robot.  # (T,) bool

    A part of the body other than the feet is on the floor and not in stance; or no point can bear a load, and the
    centre of mass does not fall freely either, for longer than a stance that is missing for a moment would explain.

    Args:
        context: the centre motion and its schedule.
        able: which points can bear a load, as of :class:`Support`.  # (T, K) bool
    """
    positions, rotations = context.placements
    robot, settings = context.robot, CarryingSettings()
    feet = {sole.body for sole in robot.soles}
    stands = _standing_shapes(robot, able)
    out, nowhere = np.zeros(context.frames, bool), np.zeros(context.frames, bool)
    for capsule in (c for c in robot.capsules if c.body not in feet):
        low = lowest_points((positions, rotations), robot.body_names.index(capsule.body), capsule) < _LOW
        out |= low & ~stands.get(capsule.name, nowhere)
    loads = load(centre_height(robot, positions, rotations), context.centre.fps, settings.spread)
    for start, stop in runs((loads > settings.loaded) & ~able.any(axis=1)):
        if stop - start > _UNKNOWN * context.centre.fps and loads[start:stop].mean() > _CARRIED:
            out[start:stop] = True
    return out


def _standing_shapes(robot: Robot, able: np.ndarray) -> dict[str, np.ndarray]:
    """Shape of a support -> the frames in which any point of that support bears a load.  # (T,) bool"""
    limbs = able[:, able.shape[1] - len(limb_owners(robot)) :]
    out: dict[str, np.ndarray] = {}
    last = 0
    for support in robot.supports:
        own = slice(last, last := last + len(support.points))
        out |= dict.fromkeys(support.shapes, np.asarray(limbs[:, own].any(axis=1)))
    return out


def leg(robot: Robot, body: str) -> list[int]:
    """The joints between a foot and the base, from the foot up, at most ``LEG``."""
    model = robot.model
    at = int(model.body(body).id)
    out: list[int] = []
    while at > 1 and len(out) < LEG:
        if int(model.body_jntnum[at]):
            out.append(int(model.body_jntadr[at]) - 1)
        at = int(model.body_parentid[at])
    return out


def hinges(robot: Robot, placements: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """World axes and anchors [m] of the joints, ``(T, n, 3)`` each."""
    positions, rotations = placements
    model = robot.model
    slots = [robot.body_names.index(model.body(int(model.jnt_bodyid[j])).name) for j in range(1, model.njnt)]
    axes = np.einsum("tnij,nj->tni", rotations[:, slots], model.jnt_axis[1:])
    return axes, positions[:, slots] + np.einsum("tnij,nj->tni", rotations[:, slots], model.jnt_pos[1:])


def weight_torques(
    robot: Robot, placements: tuple[np.ndarray, np.ndarray], axes: np.ndarray, anchors: np.ndarray
) -> np.ndarray:
    """What the joints give to hold up what hangs on them, nothing touching it, over m g [m].  # (T, n)

    ``a_j . sum_b m_b (x_b - c_j) x e_z / m`` over the bodies b that joint j, of axis a_j through c_j, carries.
    """
    positions, rotations = placements
    model = robot.model
    ids = [int(model.body(name).id) for name in robot.body_names]
    share = model.body_mass[ids] / model.body_mass[ids].sum()
    centres = positions + np.einsum("tbij,bj->tbi", rotations, model.body_ipos[ids])
    out = np.zeros(axes.shape[:2])
    for slot, body in enumerate(ids):
        at = body
        while at > 1:
            if int(model.body_jntnum[at]):
                j = int(model.body_jntadr[at]) - 1
                moment = share[slot] * np.cross(centres[:, slot] - anchors[:, j], [0.0, 0.0, 1.0])
                out[:, j] += np.einsum("ti,ti->t", axes[:, j], moment)
            at = int(model.body_parentid[at])
    return out
