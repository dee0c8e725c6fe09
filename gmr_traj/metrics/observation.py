"""What one clip looks like in the world: computed once, measured many times."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gmr_traj.exceptions import ClipError
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.metrics.self_collision import Overlaps, overlaps
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot


@dataclass(frozen=True)
class Observation:
    """World positions of everything the figures need, in every frame of one clip.

    Attributes:
        motion: the clip.
        robot: its robot.
        positions: body origins in the world [m], bodies in the order of ``robot.body_names``.  # (T, B, 3)
        rotations: body orientations in the world.  # (T, B, 3, 3)
        soles: contact points of each sole [m], in the order of ``robot.soles``.  # S of (T, K, 3)
        outlines: outline points of each sole [m].  # S of (T, M, 3)
        starts, ends: both ends of the axis of each collision shape [m], in the order of ``robot.capsules``.
            # (T, C, 3)
        lowest: height of the lowest point of each collision shape [m].  # (T, C)
        overlaps: self-collisions.
    """

    motion: RobotMotion
    robot: Robot
    positions: np.ndarray
    rotations: np.ndarray
    soles: tuple[np.ndarray, ...]
    outlines: tuple[np.ndarray, ...]
    starts: np.ndarray
    ends: np.ndarray
    lowest: np.ndarray
    overlaps: Overlaps

    def raised(self, height: float) -> Observation:
        """The same clip, all of it raised by ``height`` [m]."""
        up = np.array([0.0, 0.0, height])
        return replace(
            self,
            motion=self.motion.shifted(height),
            positions=self.positions + up,
            soles=tuple(points + up for points in self.soles),
            outlines=tuple(points + up for points in self.outlines),
            starts=self.starts + up,
            ends=self.ends + up,
            lowest=self.lowest + height,
        )


def observe(motion: RobotMotion, robot: Robot) -> Observation:
    """Forward kinematics, sole points, collision shapes and self-collisions of a clip.

    Raises:
        ClipError: where the clip's joints are not the robot's.
    """
    if motion.joint_names != robot.joint_names:
        raise ClipError(
            f"the clip has {len(motion.joint_names)} joints {_first_difference(motion, robot)}; "
            f"robot {robot.name} has {robot.dof}: reduce the robot to the clip's joints first"
        )
    positions, rotations = placements(robot, motion.qpos)
    index = {name: i for i, name in enumerate(robot.body_names)}

    def world(body: str, points: np.ndarray) -> np.ndarray:
        """Points (K, 3) given in a body's frame, in the world, (T, K, 3)."""
        i = index[body]
        return positions[:, i, None] + np.reshape(points, (-1, 3)) @ rotations[:, i].transpose(0, 2, 1)

    starts = np.empty((motion.frames, len(robot.capsules), 3))
    ends = np.empty_like(starts)
    for c, capsule in enumerate(robot.capsules):
        both = world(capsule.body, np.stack([capsule.start, capsule.end]))
        starts[:, c], ends[:, c] = both[:, 0], both[:, 1]
    radii = np.array([capsule.radius for capsule in robot.capsules])
    return Observation(
        motion=motion,
        robot=robot,
        positions=positions,
        rotations=rotations,
        soles=tuple(world(sole.body, sole.points) for sole in robot.soles),
        outlines=tuple(world(sole.body, sole.outline) for sole in robot.soles),
        starts=starts,
        ends=ends,
        lowest=np.minimum(starts[:, :, 2], ends[:, :, 2]) - radii,
        overlaps=overlaps(starts, ends, radii, robot.collision_pairs),
    )


def _first_difference(motion: RobotMotion, robot: Robot) -> str:
    for i, (mine, theirs) in enumerate(zip(motion.joint_names, robot.joint_names, strict=False)):
        if mine != theirs:
            return f"(joint {i} is {mine}, not {theirs})"
    return "(the first ones agree)"
