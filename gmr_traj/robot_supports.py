"""The parts of a robot, besides its feet, that may rest on the floor."""

from __future__ import annotations

import numpy as np

from gmr_traj.exceptions import RobotError
from gmr_traj.robot import BodySupport, Capsule
from gmr_traj.robot_toml import RobotFile


def body_supports(file: RobotFile, capsules: tuple[Capsule, ...]) -> tuple[BodySupport, ...]:
    """The ``[[supports]]`` of a robot.toml: the round ends of the shapes that they name.

    Args:
        file: the robot's figures.
        capsules: its collision shapes.

    Raises:
        RobotError: a shape does not exist, is in two supports, or belongs to a foot, which has a sole.
    """
    shapes = {capsule.name: capsule for capsule in capsules}
    feet, owner = {sole.body for sole in file.soles}, dict[str, str]()
    out = []
    for support in file.supports:
        where = f"{file.path}: [[supports]] {support.name!r}"
        balls: list[tuple[str, np.ndarray, float]] = []
        for name in support.shapes:
            if name not in shapes:
                raise RobotError(f"{where}: there is no collision shape {name!r}; there are {', '.join(shapes)}")
            if name in owner:
                raise RobotError(f"{where}: shape {name!r} is in {owner[name]!r} already; expected once")
            capsule, owner[name] = shapes[name], support.name
            if capsule.body in feet:
                raise RobotError(
                    f"{where}: shape {name!r} is of {capsule.body!r}, a foot, whose [[soles]] rest instead"
                )
            for end in np.unique([capsule.start, capsule.end], axis=0):
                balls.append((capsule.body, end, capsule.radius))
        points, radii = np.array([end for _, end, _ in balls]), np.array([radius for *_, radius in balls])
        points.setflags(write=False)
        radii.setflags(write=False)
        out.append(BodySupport(support.name, support.shapes, tuple(body for body, *_ in balls), points, radii))
    return tuple(out)
