"""A motion near which constraint rows are built, with what has been found out about it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gmr_traj.collision.broadphase import Candidate, candidates
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot


class Visited:
    """A motion, its placements and close pairs, found once when they are first asked for and cut with the motion.

    A repair solves a second of the clip again; its rows come from cuts of what is known of the whole clip.

    Args:
        robot: the robot.
        motion: the motion, over T frames.
        whole: the motion that this one is a cut of, beginning at frame ``start``.
    """

    def __init__(self, robot: Robot, motion: RobotMotion, whole: Visited | None = None, start: int = 0) -> None:
        self.robot = robot
        self.motion = motion
        self._whole = whole
        self._frames = slice(start, start + motion.frames)
        self._placements: tuple[np.ndarray, np.ndarray] | None = None
        self._close: dict[float, list[Candidate]] = {}

    def part(self, start: int, stop: int) -> Visited:
        """Frames ``start`` to ``stop``."""
        return Visited(self.robot, self.motion.with_qpos(self.motion.qpos[start:stop]), self, start)

    @property
    def placements(self) -> tuple[np.ndarray, np.ndarray]:
        """World placements of the robot's bodies, ``(T, B, 3)`` and ``(T, B, 3, 3)``."""
        if self._placements is None:
            if self._whole is None:
                self._placements = placements(self.robot, self.motion.qpos)
            else:
                positions, rotations = self._whole.placements
                self._placements = positions[self._frames], rotations[self._frames]
        return self._placements

    def close(self, margin: float) -> list[Candidate]:
        """Pairs of capsules and frames with a clearance below ``margin`` [m]."""
        if margin not in self._close:
            if self._whole is None:
                self._close[margin] = candidates(self.robot, *self.placements, margin)
            else:
                self._close[margin] = _cut(self._whole.close(margin), self._frames)
        return self._close[margin]


def _cut(found: list[Candidate], frames: slice) -> list[Candidate]:
    out = []
    for candidate in found:
        first, last = np.searchsorted(candidate.frames, (frames.start, frames.stop))
        if first < last:
            here = slice(first, last)
            at = candidate.frames[here] - frames.start
            out.append(replace(candidate, frames=at, clearance=candidate.clearance[here]))
    return out
