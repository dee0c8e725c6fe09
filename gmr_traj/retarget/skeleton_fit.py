"""A person with the robot's bone lengths: what stands in for a body model's shape parameters.

PHC fits the shape of SMPL, and a scale, until its joints are where the robot's are in a like posture, and then poses
that body with the person's joint rotations.  Without the body model (its licence does not let it ship) the same is
done to the skeleton itself: every bone is given a length, and keeps the direction it has in the motion.
"""

from __future__ import annotations

import numpy as np

from gmr_traj.human_motion import HumanMotion
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.retarget.landmarks import LandmarkPoint, Landmarks
from gmr_traj.robot import Robot

_SAMPLES = 40  # frames looked at; distances within a person hardly change
# Of landmarks on both sides, the pairs whose distance is a width of the trunk.
_WIDE = ("hip", "shoulder")


def fit_bones(human: HumanMotion, landmarks: Landmarks, robot: Robot, penalty: float) -> np.ndarray:
    """Length of every bone of a person of the robot's proportions, relative to the person's own.

        minimise  mean_t sum over pairs (|p_i - p_j|(t) - d_ij)^2 + penalty^2 sum_b log(s_b / s)^2    over s_b and s

    Pairs are each landmark with the nearest one above it in the tree, and left with right hip and shoulder; d_ij is the
    distance of the robot's points with all joints at zero.  The penalty on unequal ratios is what the paper's penalty
    on SMPL's shape parameters is there for.

    Args:
        human: the person.
        landmarks: what the robot and the person share.
        robot: the robot.
        penalty: [m].

    Returns:
        s_b of the bone from each joint's parent to the joint; 1 for the root.  # (J,)
    """
    joints = landmarks.joints
    pairs, desired = _pairs(human, landmarks), _at_zero(landmarks.points, robot)
    wanted = np.array([np.linalg.norm(desired[i] - desired[k]) for i, k in pairs])
    frames = np.unique(np.linspace(0, human.frames - 1, _SAMPLES).astype(int))
    bones = _bones(human, frames)
    used = _above(human, joints)
    first, second = (joints[[pair[side] for pair in pairs]] for side in (0, 1))

    def residuals(x: np.ndarray) -> np.ndarray:
        ratios = np.ones(len(human.names))
        ratios[used] = np.exp(x[0] + x[1:])
        placed = _chain(human, ratios, bones, np.zeros((len(frames), 3)))
        distance = np.linalg.norm(placed[:, first] - placed[:, second], axis=2)
        return np.concatenate([((distance - wanted) / np.sqrt(len(frames))).ravel(), penalty * x[1:]])

    from scipy.optimize import least_squares  # as much to load as the rest of retargeting, and for this alone

    x = least_squares(residuals, np.zeros(1 + len(used))).x
    ratios = np.full(len(human.names), float(np.exp(x[0])))  # bones that lead to no landmark: the common scale
    ratios[used] = np.exp(x[0] + x[1:])
    ratios[0] = 1.0
    return ratios


def with_bones(human: HumanMotion, ratios: np.ndarray) -> np.ndarray:
    """Joint positions of a person whose bones have other lengths: the same directions, the root where it was [m].

        p'_root = p_root,    p'_j = p'_parent + s_j (p_j - p_parent)

    Returns:
        Positions.  # (T, J, 3)
    """
    frames = np.arange(human.frames)
    return _chain(human, ratios, _bones(human, frames), human.positions[:, 0])


def _bones(human: HumanMotion, frames: np.ndarray) -> np.ndarray:
    """Vectors from each joint's parent to the joint, zero for the root.  # (T, J, 3)"""
    positions = human.positions[frames]
    parents = np.array(human.parents)
    bones = positions - positions[:, np.maximum(parents, 0)]
    bones[:, parents < 0] = 0.0
    return bones


def _chain(human: HumanMotion, ratios: np.ndarray, bones: np.ndarray, root: np.ndarray) -> np.ndarray:
    placed = np.empty_like(bones)
    for j, parent in enumerate(human.parents):
        placed[:, j] = root if parent < 0 else placed[:, parent] + ratios[j] * bones[:, j]
    return placed


def _above(human: HumanMotion, joints: np.ndarray) -> np.ndarray:
    """Joints whose bones lead from the root to any of ``joints``."""
    found: set[int] = set()
    for joint in joints.tolist():
        while human.parents[joint] >= 0:
            found.add(joint)
            joint = human.parents[joint]
    return np.array(sorted(found))


def _pairs(human: HumanMotion, landmarks: Landmarks) -> list[tuple[int, int]]:
    """Pairs of landmarks whose distance hardly depends on the posture."""
    of_joint = {joint: k for k, joint in enumerate(landmarks.joints.tolist())}
    pairs = []
    for joint, k in of_joint.items():
        above = human.parents[joint]
        while above >= 0 and above not in of_joint:
            above = human.parents[above]
        if above >= 0:
            pairs.append((k, of_joint[above]))
    names = {point.landmark for point in landmarks.points}
    wide = [(f"left_{part}", f"right_{part}") for part in _WIDE]
    pairs += [(landmarks.index(left), landmarks.index(right)) for left, right in wide if {left, right} <= names]
    return pairs


def _at_zero(points: tuple[LandmarkPoint, ...], robot: Robot) -> np.ndarray:
    """The robot's points with all joints at zero.  # (K, 3)"""
    zero = np.zeros((1, 7 + robot.dof))
    zero[0, 3] = 1.0
    positions, rotations = placements(robot, zero)
    slots = [robot.body_names.index(point.body) for point in points]
    local = np.array([point.point for point in points])
    return positions[0, slots] + np.einsum("kij,kj->ki", rotations[0, slots], local)
