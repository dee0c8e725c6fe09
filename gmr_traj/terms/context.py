"""What every term is built from."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.contacts.detect import placed_sole_points
from gmr_traj.contacts.mask import to_mask
from gmr_traj.contacts.release import turning
from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.kinematics.casadi_kinematics import CasadiKinematics
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.motion import RobotMotion
from gmr_traj.references import BodyTargets
from gmr_traj.robot import Robot
from gmr_traj.visited import Visited


@dataclass(frozen=True)
class Context:
    """One problem's robot and motions, all over the same T frames.

    Attributes:
        robot: the robot.
        kinematics: its symbolic kinematics.
        centre: the motion about which tangent steps are taken (the input at first, later the last solution).
        target: the motion to stay close to: the input, raised to stand on the floor.
        trust: how far each frame of the target is to be believed, in (0, 1].  # (T,)
        schedule: stances.
        visited: motions near which constraint rows must be built: those of earlier passes, so that a row that once
            mattered stays, and last the centre.
        references: the source's targets, fitted to the robot; None where they are not known.
    """

    robot: Robot
    kinematics: CasadiKinematics
    centre: RobotMotion
    target: RobotMotion
    trust: np.ndarray
    schedule: ContactSchedule
    visited: tuple[Visited, ...]
    references: BodyTargets | None = None

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return self.centre.frames

    @property
    def dt(self) -> float:
        """Time between frames [s]."""
        return 1.0 / self.centre.fps

    @property
    def placements(self) -> tuple[np.ndarray, np.ndarray]:
        """World placements of the bodies in the centre motion, ``(T, B, 3)`` and ``(T, B, 3, 3)``."""
        return self.visited[-1].placements

    @cached_property
    def target_placements(self) -> tuple[np.ndarray, np.ndarray]:
        """World placements of the bodies in the target motion, ``(T, B, 3)`` and ``(T, B, 3, 3)``."""
        return placements(self.robot, self.target.qpos)

    @cached_property
    def turning(self) -> np.ndarray:
        """Sole points in stance that the turn of their foot lifts; see :mod:`~gmr_traj.contacts.release`.  # (T, K)"""
        height = placed_sole_points(self.robot, self.target_placements)[..., 2]
        return turning(to_mask(self.schedule, self.robot), height, self.robot)

    @cached_property
    def coordinates(self) -> np.ndarray:
        """The centre as a path in the tangent's coordinates, ``(T, 6 + n)``.

        Base position, base rotation as the running sum of world rotation increments
        ``log(R_t R_{t-1}')``, joints.  Differences of these plus differences of the steps are the velocities of the
        stepped motion: exactly for positions and joints, for the rotation up to ``1/2 w x (v_t + v_{t-1})`` with w the
        turn from one frame to the next, and terms of second order in the step.
        """
        qpos = self.centre.qpos
        rotation = Rotation.from_quat(qpos[:, 3:7], scalar_first=True)
        turn = np.zeros((len(qpos), 3))
        if len(qpos) > 1:
            turn[1:] = np.cumsum((rotation[1:] * rotation[:-1].inv()).as_rotvec(), axis=0)
        return np.hstack([qpos[:, :3], turn, qpos[:, 7:]])


def stepped(centre: RobotMotion, steps: np.ndarray) -> RobotMotion:
    """The motion ``q_t (+) v_t``; see :class:`~gmr_traj.kinematics.casadi_kinematics.CasadiKinematics`.

    Args:
        centre: q.
        steps: v.  # (T, 6 + n)
    """
    qpos = centre.qpos.copy()
    qpos[:, :3] += steps[:, :3]
    turned = Rotation.from_rotvec(steps[:, 3:6]) * Rotation.from_quat(qpos[:, 3:7], scalar_first=True)
    qpos[:, 3:7] = turned.as_quat(scalar_first=True)
    qpos[:, 7:] += steps[:, 6:]
    return centre.with_qpos(qpos)
