"""How much a reading of a file looks like a robot that stands and walks on a level floor.

The order of a quaternion or of joints leaves no trace in shapes, norms or continuity (reordering components keeps the
angle between successive quaternions).  Standing does: read the wrong way, the base tilts by its heading, the lowest
foot is not level, and it slides while it bears the robot.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.kinematics.mujoco_kinematics import body_points, placements
from gmr_traj.robot import Robot

# What a right reading stays below, roughly: one unit of oddness each.  Over 26 G1 clips from seven projects a whole
# clip read with the wrong quaternion order is odder than read rightly by at least 3.2, with breadth-first joints by at
# least 2.9; and in every window of 60 frames (quaternions: 20) the right reading is still the less odd one.
_TILT = 20.0  # of the base, median [deg]
_LEVEL = 10.0  # of the lowest sole, median [deg]
_SLIP = 0.2  # of the lowest sole point, median [m/s]

#: Difference in oddness from which the less odd of two readings is taken; below it a person has to say.
DECISIVE = 1.0
#: Difference from which what a format defines is doubted.
CONTRADICTING = 1.5
#: No robot on its feet, rightly read, is odder; a reading that is cannot contradict a format, the robot lies or crawls.
ON_ITS_FEET = 5.0

_PAIRS = 250


class StandingTest:
    """The soles of a clip in base coordinates, to be placed by one reading of the base after another.

    Args:
        robot: robot whose joints are ``joints``.
        joints: joint positions [rad].  # (T, n)
        fps: frame rate [Hz].
    """

    def __init__(self, robot: Robot, joints: np.ndarray, fps: float) -> None:
        first = np.unique(np.linspace(0, max(len(joints) - 2, 0), _PAIRS).astype(int))
        self._frames = np.stack([first, np.minimum(first + 1, len(joints) - 1)])  # (2, K), successive frames
        self._fps = fps
        frames = self._frames.reshape(-1)
        qpos = np.zeros((len(frames), 7 + robot.dof))
        qpos[:, 3] = 1.0
        qpos[:, 7:] = joints[frames]
        positions, rotations = placements(robot, qpos)
        points, normals = [], []
        for sole in robot.soles:
            body = robot.body_names.index(sole.body)
            points.append(body_points((positions, rotations), body, sole.points))
            normals.append(np.repeat(rotations[:, None, body, :, 2], len(sole.points), axis=1))
        self._points = np.concatenate(points, axis=1) if points else np.zeros((len(frames), 1, 3))  # (2K, P, 3)
        self._normals = np.concatenate(normals, axis=1) if normals else np.tile([0.0, 0.0, 1.0], (len(frames), 1, 1))

    def oddness(self, position: np.ndarray, quaternion: np.ndarray) -> float:
        """Sum of base tilt, tilt of the lowest sole and slip of its lowest point, each in units of what is usual.

            tilt / 20 deg + level / 10 deg + slip / 0.2 m/s,   medians over the clip

        Args:
            position: base positions [m].  # (T, 3)
            quaternion: unit base quaternions wxyz.  # (T, 4)
        """
        frames = self._frames.reshape(-1)
        base = Rotation.from_quat(quaternion[frames], scalar_first=True).as_matrix()
        world = position[frames, None] + np.einsum("tij,tpj->tpi", base, self._points)
        count = self._frames.shape[1]
        lowest = world[:count, :, 2].argmin(axis=1)
        each = np.arange(count)
        tilt = _degrees(base[:count, 2, 2])
        level = _degrees(np.einsum("ti,ti->t", base[:count, 2], self._normals[each, lowest]))
        slip = np.linalg.norm(world[count + each, lowest] - world[each, lowest], axis=1) * self._fps
        return float(np.median(tilt) / _TILT + np.median(level) / _LEVEL + np.median(slip) / _SLIP)

    def lowest_sole(self, position: np.ndarray, quaternion: np.ndarray) -> float:
        """Median height of the lowest sole point [m]; about zero for a clip on the floor."""
        frames = self._frames[0]
        base = Rotation.from_quat(quaternion[frames], scalar_first=True).as_matrix()
        points = self._points[: len(frames)]
        heights = position[frames, None, 2] + np.einsum("tj,tpj->tp", base[:, 2], points)
        return float(np.median(heights.min(axis=1)))


def _degrees(cosine: np.ndarray) -> np.ndarray:
    angle: np.ndarray = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return angle
