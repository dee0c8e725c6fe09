"""Method ``phc``: joint positions fitted by gradient descent over the whole clip at once, as PHC does it.

    minimise  1/(T K) sum_t sum_k || p_k(r_t + o, R_t, q_t) - p*_k,t || + posture mean(q^2)   over R_t, q_t and one o

(the distance, not its square), with the person's own root path r_t, one offset o for the clip, and p* the joints of a
person of the robot's proportions (see ``skeleton_fit``).  The root's path is **not** scaled, which is where the
method's faults come from: a robot with shorter legs makes the person's strides and knee bends, so its feet slide, sink
and float.  Nothing knows of the floor; one constant height is corrected at the end.

PHC: Luo et al., github.com/ZhengyiLuo/PHC; the retargeting is that of He et al., "Learning Human-to-Humanoid Real-Time
Whole-Body Teleoperation" (H2O).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.ndimage import convolve1d
from scipy.spatial.transform import Rotation

from gmr_traj.human_motion import HumanMotion
from gmr_traj.kinematics.batched_kinematics import BatchedKinematics, left_jacobian
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.references import BodyTargets
from gmr_traj.retarget.body_map import BodyMap
from gmr_traj.retarget.descent import step_rule
from gmr_traj.retarget.ground import heights
from gmr_traj.retarget.landmarks import HIPS, LandmarkPoint, Landmarks, match, read_points, read_settings, thinned
from gmr_traj.retarget.options import Options, Progress, Solved
from gmr_traj.retarget.skeleton_fit import fit_bones, with_bones
from gmr_traj.robot import Robot

_REPORT_EVERY = 10  # iterations between two reports of progress

#: ``first-frame``: the lowest point of the robot's surface in frame 0 comes to the floor, as in the code (which takes
#: the vertices of a mesh). ``mean-minimum``: the lowest body is on the floor in the mean over the frames, the GMR
#: paper's repair.
Height = Literal["first-frame", "mean-minimum"]


@dataclass(frozen=True)
class PhcSettings:
    """The numbers of ``configs/phc_<robot>.toml``, which says what they mean, with one of its kinds of descent."""

    points: tuple[LandmarkPoint, ...]
    frames_per_second: float
    penalty: float
    iterations: int
    filter_width: int
    filter_sigma: float
    joint_optimiser: str
    joint_rate: float
    root_optimiser: str
    root_rate: float
    posture: float

    @classmethod
    def read(cls, robot: Robot, descent: str) -> PhcSettings:
        """Read them.

        Raises:
            ResourceError: there is no such file for the robot, or it is wrong.
        """
        table = read_settings("phc", robot)
        skeleton, common = table.table("skeleton"), table.table("descent")
        rule = common.table(descent)
        settings = cls(
            points=read_points(table, robot),
            frames_per_second=table.number("frames_per_second", above=0.0),
            penalty=skeleton.weight("penalty"),
            iterations=common.count("iterations", 0),
            filter_width=common.count("filter_width", 0),
            filter_sigma=common.number("filter_sigma", above=0.0),
            joint_optimiser=rule.text("joint_optimiser"),
            joint_rate=rule.number("joint_rate", above=0.0),
            root_optimiser=rule.text("root_optimiser"),
            root_rate=rule.number("root_rate", above=0.0),
            posture=rule.weight("posture"),
        )
        for key in ("iterations", "filter_width"):
            if getattr(settings, key) < 1:
                raise common.error(f"{key} must be at least 1")
        for one in (table, skeleton, rule):
            one.done()
        return settings


def solve(
    human: HumanMotion,
    robot: Robot,
    body_map: BodyMap,
    options: Options,
    *,
    descent: str = "adadelta",
    height: Height = "first-frame",
) -> Solved:
    """Retarget a clip.

    Args:
        human: the person; thinned out to about 30 frames per second.
        robot: the robot.
        body_map: not used, the method has points of its own.
        options: the velocity limit is not used, the method has none.
        descent: ``adadelta`` as in 2024, or ``adam`` as since then.
        height: how the height is corrected.

    Raises:
        MapError: the method does not know the person's rig.
        ResourceError: there are no settings for the robot.
    """
    del body_map
    settings = PhcSettings.read(robot, descent)
    human = thinned(human, settings.frames_per_second)
    landmarks = match(human, settings.points)
    fitted = with_bones(human, fit_bones(human, landmarks, robot, settings.penalty))
    # As in the original, whose body model stands on the floor in frame 0.
    fitted[..., 2] -= fitted[0, :, 2].min()
    targets = fitted[:, landmarks.joints]  # (T, K, 3)
    qpos = descend(fitted[:, 0], targets, landmarks, robot, settings, options.progress)
    points = points_of(robot, qpos, landmarks)
    away, _ = mean_distance(points, targets)
    notes: tuple[str, ...] = (
        f"after {settings.iterations} iterations the landmarks are {1e3 * away:.0f} mm away in the mean",
    )
    if options.velocity_limit is not None:
        notes = (*notes, "the velocity limit has no effect, method phc knows none")
    # The original's bodies include the points that it adds to the robot (head, toes), so ours do.
    bodies = np.concatenate([placements(robot, qpos)[0], points], axis=1)[..., 2].min(axis=1)  # (T,)
    low = heights(robot, qpos[:1]).lowest[0] if height == "first-frame" else bodies.mean()
    raised = -float(low)
    qpos[:, 2] += raised
    followed = _references(targets + np.array([0.0, 0.0, raised]), landmarks)
    return Solved(qpos, followed, raised, settings.iterations, notes, human.fps)


def descend(
    root: np.ndarray,
    targets: np.ndarray,
    landmarks: Landmarks,
    robot: Robot,
    settings: PhcSettings,
    progress: Progress | None = None,
) -> np.ndarray:
    """The descent, from joints at zero and the person's heading.

    Args:
        root: the person's root path [m].  # (T, 3)
        targets: where the landmarks should be [m].  # (T, K, 3)
        landmarks: the landmarks.
        robot: the robot.
        settings: the numbers.
        progress: is told how far the work is.

    Returns:
        Configurations.  # (T, 7 + n)
    """
    kinematics = BatchedKinematics(robot, [(point.body, point.point) for point in landmarks.points])
    joints, offset = np.zeros((len(root), robot.dof)), np.zeros(3)
    heading = headings(*(targets[:, landmarks.index(hip)] for hip in HIPS))
    turn = np.outer(heading, [0.0, 0.0, 1.0])  # (T, 3) rotation vectors
    joint_rule = step_rule(settings.joint_optimiser, settings.joint_rate)
    turn_rule, offset_rule = (step_rule(settings.root_optimiser, settings.root_rate) for _ in range(2))
    kernel = gaussian_kernel(settings.filter_width, settings.filter_sigma)
    for k in range(settings.iterations):
        placed = kinematics.place(root + offset, Rotation.from_rotvec(turn).as_matrix(), joints)
        _, forces = mean_distance(placed.points, targets)
        by_base, by_turn, by_joints = kinematics.gradient(placed, forces)
        by_joints += 2.0 * settings.posture / joints.size * joints
        joints = joints + joint_rule.step(by_joints)
        turn = turn + turn_rule.step(np.einsum("tji,tj->ti", left_jacobian(turn), by_turn))
        offset = offset + offset_rule.step(by_base.sum(axis=0))
        joints = np.clip(joints, robot.position_lower, robot.position_upper)
        joints = convolve1d(joints, kernel, axis=0, mode="nearest")
        if progress is not None and ((k + 1) % _REPORT_EVERY == 0 or k + 1 == settings.iterations):
            progress("retargeting", k + 1, settings.iterations)
    joints = np.clip(joints, robot.position_lower, robot.position_upper)
    return np.hstack([root + offset, Rotation.from_rotvec(turn).as_quat(scalar_first=True), joints])


def mean_distance(points: np.ndarray, targets: np.ndarray) -> tuple[float, np.ndarray]:
    """Mean distance of points to their targets [m], and its gradient by the points, both arrays ``(T, K, 3)``.

    The gradient at distance zero, where there is none, is taken as zero.
    """
    away = points - targets
    distance = np.linalg.norm(away, axis=2, keepdims=True)
    return float(distance.mean()), away / np.maximum(distance, 1e-12) / distance.size


def headings(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Heading of a person [rad]: the horizontal direction that has the left hip on its left.  # (T,)

    Args:
        left: positions of the left hip [m].  # (T, 3)
        right: those of the right hip.  # (T, 3)
    """
    across = left - right
    return np.arctan2(-across[:, 0], across[:, 1])


def gaussian_kernel(width: int, sigma: float) -> np.ndarray:
    """A Gaussian of unit sum at ``width`` points around 0, sigma in the same unit.  # (width,)"""
    x = np.arange(width) - 0.5 * (width - 1)
    kernel = np.exp(-0.5 * (x / sigma) ** 2)
    return kernel / kernel.sum()


def points_of(robot: Robot, qpos: np.ndarray, landmarks: Landmarks) -> np.ndarray:
    """Where the robot's landmarks are [m].  # (T, K, 3)"""
    kinematics = BatchedKinematics(robot, [(point.body, point.point) for point in landmarks.points])
    turns = Rotation.from_quat(qpos[:, 3:7], scalar_first=True).as_matrix()
    return kinematics.place(qpos[:, :3], turns, qpos[:, 7:]).points


def _references(targets: np.ndarray, landmarks: Landmarks) -> BodyTargets:
    """What was followed; of several landmarks in one body the first, and no orientations."""
    bodies = [point.body for point in landmarks.points]
    first = [k for k, body in enumerate(bodies) if body not in bodies[:k]]
    turns = np.zeros((len(targets), len(first), 4))
    turns[..., 0] = 1.0
    return BodyTargets(
        names=tuple(bodies[k] for k in first),
        positions=targets[:, first],
        quaternions=turns,
        position_weights=np.ones(len(first)),
        orientation_weights=np.zeros(len(first)),
        points=np.array([landmarks.points[k].point for k in first]),
    )
