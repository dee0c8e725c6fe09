"""Making a map for a rig: rotation offsets and scales from one posture that person and robot both take.

Put the person and the robot in the same posture (both standing in a T, or both with hanging arms).  Then every joint
frame of the person should mean what the body frame of the robot means, so the offset between them is

    R_offset = R_joint' Z R_body

with Z the turn about the vertical that faces the robot where the person faces.  Z is found from the positions: of all
such turns it brings the robot's bodies closest to the person's joints, each about its root (Kabsch, in the plane).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase

import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.exceptions import MapError, RobotError
from gmr_traj.human_motion import HumanMotion
from gmr_traj.kinematics.mujoco_kinematics import body_id, placements
from gmr_traj.robot import Robot

# Bodies must be spread this far to the sides for the facing to be found [m].
_SPREAD = 0.1


@dataclass(frozen=True)
class Alignment:
    """How the frames and sizes of a person and a robot relate in one posture.

    Attributes:
        facing: turn about the vertical from the robot's heading to the person's [rad].
        rotation_offsets: joint frame to body frame, wxyz, one a pair.  # (B, 4)
        scales: distance of the body from the root over that of the joint, one a pair; 1 for the root itself.  # (B,)
        misfit: root mean square distance of the turned and scaled robot's bodies from the person's joints, over the
            person's height.  Above about 0.1 the postures are not the same.
    """

    facing: float
    rotation_offsets: np.ndarray
    scales: np.ndarray
    misfit: float


def align(
    human: HumanMotion,
    frame: int,
    robot: Robot,
    pairs: Sequence[tuple[str, str, str]],
    posture: Mapping[str, float],
    facing: float | None = None,
) -> Alignment:
    """Offsets and scales of a map from one frame of a person and one posture of a robot.

    Args:
        human: a motion of the rig.
        frame: the frame in which the person takes the posture.
        robot: the robot.
        pairs: (joint, joint whose orientation counts, robot body), the root first.  # B
        posture: joint or pattern -> position [rad]; joints that are not named are at zero.  Positions outside the
            joints' ranges are fine: the robot need not be able to take the posture.
        facing: Z [rad] where it is known, as that of a rig's own posture is; found from the positions otherwise.

    Raises:
        MapError: there is no such frame or joint, or person and robot are not spread enough to find the facing.
        RobotError: the robot has no such body or joint.
    """
    if not -human.frames <= frame < human.frames:
        raise MapError(f"the motion has no frame {frame}; it has frames 0 to {human.frames - 1}")
    positions, rotations = placements(robot, _configuration(robot, posture)[None])
    bodies = [body_id(robot, body) - 1 for _, _, body in pairs]
    joints = [human.index(joint) for joint, _, _ in pairs]
    turned = [human.index(joint) for _, joint, _ in pairs]
    there = positions[0, bodies] - positions[0, bodies[0]]
    here = human.positions[frame, joints] - human.positions[frame, joints[0]]
    if facing is None:
        facing = _facing(there[:, :2], here[:, :2])
    Z = Rotation.from_euler("z", facing)
    frames = Rotation.from_quat(human.quaternions[frame, turned], scalar_first=True)
    offsets = (frames.inv() * Z * Rotation.from_matrix(rotations[0, bodies])).as_quat(scalar_first=True, canonical=True)
    size = np.linalg.norm(here, axis=1), np.linalg.norm(there, axis=1)
    scales = np.where(size[0] > 1e-6, size[1] / np.maximum(size[0], 1e-6), 1.0)
    overall = float((size[0] * size[1]).sum() / (size[1] ** 2).sum())  # least squares
    misfit = float(np.sqrt(((here - overall * Z.apply(there)) ** 2).sum(axis=1).mean())) / human.height
    return Alignment(facing, offsets, scales, misfit)


def _facing(there: np.ndarray, here: np.ndarray) -> float:
    """The turn Z [rad] that maximises the sum of ``here . Z there`` over points of the plane.  # (B, 2) each

    Raises:
        MapError: the points are not spread enough.
    """
    if min(np.ptp(there, axis=0).max(), np.ptp(here, axis=0).max()) < _SPREAD:
        raise MapError(
            "the mapped joints or bodies are all above each other, so where the person faces cannot be found; say it"
        )
    return float(np.arctan2((there[:, 0] * here[:, 1] - there[:, 1] * here[:, 0]).sum(), (there * here).sum()))


def zero_pose(human: HumanMotion, up: str) -> HumanMotion:
    """The rig's posture at zero joint rotations, one frame: what its bones look like before any motion.

    Every joint frame is then that of the file's own axes; the offsets to the parents are those of the first frame.

    Args:
        human: a motion of the rig.
        up: the file's vertical axis, ``y`` or ``z``.

    Raises:
        MapError: ``up`` is another axis.
    """
    if up not in ("y", "z"):
        raise MapError(f"the vertical axis is {up!r}; expected y or z")
    turn = Rotation.from_matrix([[1, 0, 0], [0, 0, -1], [0, 1, 0]] if up == "y" else np.eye(3))
    frames = Rotation.from_quat(human.quaternions[0], scalar_first=True)
    positions = np.zeros((len(human.names), 3))
    for joint, parent in enumerate(human.parents):
        if parent >= 0:
            offset = frames[parent].inv().apply(human.positions[0, joint] - human.positions[0, parent])
            positions[joint] = positions[parent] + turn.apply(offset)
    quaternions = np.tile(turn.as_quat(scalar_first=True), (1, len(human.names), 1))
    return replace(human, positions=positions[None], quaternions=quaternions, contacts={})


def _configuration(robot: Robot, posture: Mapping[str, float]) -> np.ndarray:
    q = np.zeros(7 + robot.dof)
    q[3] = 1.0
    for pattern, value in posture.items():
        found = [i for i, joint in enumerate(robot.joint_names) if fnmatchcase(joint, pattern)]
        if not found:
            raise RobotError(f"robot {robot.name} has no joint {pattern!r}; it has {', '.join(robot.joint_names)}")
        q[[7 + i for i in found]] = value
    return q


def carried_over(
    offsets: np.ndarray,
    robot: Robot,
    bodies: Sequence[str],
    posture: Mapping[str, float],
    other: Robot,
    other_bodies: Sequence[str],
    other_posture: Mapping[str, float],
) -> np.ndarray:
    """Rotation offsets to another robot, from those to a robot that stands in the same posture with the same heading.

        R_offset' = R_offset R_body' R_other

    Args:
        offsets: joint frames to the robot's body frames, wxyz.  # (B, 4)
        robot: the robot they belong to.
        bodies: its bodies.  # B
        posture: its joints or patterns -> position [rad].
        other: the other robot.
        other_bodies: its counterparts of the bodies.  # B
        other_posture: its joints or patterns -> position [rad] in the same posture.

    Raises:
        RobotError: a robot has no such body or joint.
    """
    mine, theirs = _orientations(robot, bodies, posture), _orientations(other, other_bodies, other_posture)
    found = Rotation.from_quat(offsets, scalar_first=True) * mine.inv() * theirs
    return found.as_quat(scalar_first=True, canonical=True)


def _orientations(robot: Robot, bodies: Sequence[str], posture: Mapping[str, float]) -> Rotation:
    rotations = placements(robot, _configuration(robot, posture)[None])[1][0]
    return Rotation.from_matrix(rotations[[body_id(robot, body) - 1 for body in bodies]])
