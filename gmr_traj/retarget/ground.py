"""How high a robot motion is above the floor, by the soles and the collision shapes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.robot import Robot

# Soles that are higher than this in so large a share of the frames float [m].
_FLOATING, _SHARE = 0.03, 0.95


@dataclass(frozen=True)
class Heights:
    """Lowest points, frame by frame.  Not of the bodies' origins: that of an ankle is well above its sole.

    Attributes:
        soles: of the soles [m].  # (T,)
        lowest: of soles and collision shapes [m].  # (T,)
        what: sole or shape that is lowest in the whole clip.
    """

    soles: np.ndarray
    lowest: np.ndarray
    what: str

    @property
    def raise_by(self) -> float:
        """What puts the lowest point of the clip on the floor [m]."""
        return -float(self.lowest.min())

    def notes(self) -> tuple[str, ...]:
        """What the user should know where one frame keeps the feet of all the others off the floor."""
        clear = float(np.quantile(self.soles, 1.0 - _SHARE)) + self.raise_by
        if clear <= _FLOATING:
            return ()
        return (
            f"{self.what} in frame {int(self.lowest.argmin())} is the lowest point and sets the height of the clip: in "
            f"{100 * _SHARE:.0f}% of the frames both soles are more than {1e3 * clear:.0f} mm above the floor "
            "(gmr-traj refine levels a clip by its feet)",
        )


def heights(robot: Robot, qpos: np.ndarray) -> Heights:
    """Lowest points of a motion.

    Args:
        robot: the robot.
        qpos: configurations.  # (T, 7 + n)
    """
    positions, rotations = placements(robot, qpos)

    def lowest(body: str, points: np.ndarray) -> np.ndarray:
        """Height of the lowest of points (K, 3) given in a body's frame, in each frame.  # (T,)"""
        b = robot.body_names.index(body)
        return np.asarray((positions[:, b, 2, None] + rotations[:, b, 2] @ points.T).min(axis=1))

    named = {f"{sole.name} sole": lowest(sole.body, np.vstack([sole.points, sole.outline])) for sole in robot.soles}
    soles = np.min(list(named.values()), axis=0)
    for capsule in robot.capsules:
        named[capsule.name] = lowest(capsule.body, np.stack([capsule.start, capsule.end])) - capsule.radius
    deepest = min(named, key=lambda name: float(named[name].min()))
    return Heights(soles, np.min(list(named.values()), axis=0), deepest)
