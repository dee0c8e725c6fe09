"""Where the robot's bodies should be: the human's joints, scaled and turned into the robot's frames."""

from __future__ import annotations

import numpy as np

from gmr_traj.exceptions import MapError
from gmr_traj.human_motion import HumanMotion
from gmr_traj.quaternions import product, rotated
from gmr_traj.references import BodyTargets
from gmr_traj.retarget.body_map import BodyMap


def scaled_targets(human: HumanMotion, body_map: BodyMap, *, height: float | None = None) -> BodyTargets:
    """Targets of the map's bodies: non-uniform local scaling, then the offsets.

        p = r s_b (p_joint - p_root) + r s_root p_root + R b,   R = R_joint R_offset,   r = h / h_ref

    with each body's own scale s_b, its position offset b in the turned frame, the human's height h and the height h_ref
    that the map assumes.  The root's own path is scaled uniformly, which keeps planted feet planted.

    Weights are the costs of the map's second stage, relative to the median of those that are not zero (positions and
    orientations each for themselves), so that 1 is typical.

    Args:
        human: the motion.
        body_map: the map.
        height: h [m]; the motion's own by default.

    Raises:
        MapError: the map is for another rig, or names a joint that the motion has not.
    """
    check(human, body_map)
    ratio = (human.height if height is None else height) / body_map.human_height
    root = human.positions[:, human.index(body_map.root)]
    root_scale = body_map.root_target.scale
    targets = body_map.targets
    joints = human.positions[:, [human.index(target.joint) for target in targets]]
    turned = human.quaternions[:, [human.index(target.orientation_joint) for target in targets]]
    # Components first, then bodies or frames and bodies.
    quaternions = product(np.moveaxis(turned, -1, 0), np.stack([target.rotation_offset for target in targets], axis=1))
    scales = np.array([target.scale for target in targets])
    positions = ratio * (scales[:, None] * (joints - root[:, None]) + root_scale * root[:, None])
    offsets = np.stack([target.position_offset for target in targets], axis=1)
    if offsets.any():
        positions += np.moveaxis(rotated(quaternions, offsets[:, None]), 0, -1)
    costs = body_map.costs(2)
    return BodyTargets(
        names=body_map.bodies,
        positions=positions,
        quaternions=np.ascontiguousarray(np.moveaxis(quaternions, 0, -1)),
        position_weights=_relative(costs[:, 0]),
        orientation_weights=_relative(costs[:, 1]),
        points=body_map.points,
    )


def check(human: HumanMotion, body_map: BodyMap) -> None:
    """Refuse a map that is not made for the motion.

    A motion of a rig that is not known may use any map whose joints it has.

    Raises:
        MapError: the map is for another rig, or names a joint that the motion has not.
    """
    if human.rig not in (*body_map.rigs, "unknown"):
        raise MapError(
            f"map {body_map.name} is made for {' and '.join(body_map.rigs)}, and the motion is of the rig {human.rig}, "
            "whose joint frames are others"
        )
    for target in body_map.targets:
        for joint in (target.joint, target.orientation_joint):
            if joint not in human.names:
                raise MapError(
                    f"map {body_map.name}: the motion has no joint {joint!r}; it has {', '.join(human.names)}"
                )


def _relative(costs: np.ndarray) -> np.ndarray:
    positive = costs[costs > 0]
    return costs / np.median(positive) if positive.size else costs
