"""Landmarks: points of the robot and the joints of a person that they stand for."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from gmr_traj import resources
from gmr_traj.exceptions import MapError, ResourceError
from gmr_traj.human_motion import HumanMotion
from gmr_traj.robot import Robot
from gmr_traj.toml_table import Table, read_toml

HIPS = ("left_hip", "right_hip")


@dataclass(frozen=True)
class LandmarkPoint:
    """A point of the robot.

    Attributes:
        landmark: name of the landmark it stands for.
        body: the body it is fixed in.
        point: where in that body's frame [m].  # (3,)
        weight: how much it counts, 1 is typical.
    """

    landmark: str
    body: str
    point: np.ndarray
    weight: float = 1.0


@dataclass(frozen=True)
class Landmarks:
    """The landmarks that a robot and a person share.

    Attributes:
        points: the robot's points.  # K
        joints: indices of the person's joints.  # (K,)
    """

    points: tuple[LandmarkPoint, ...]
    joints: np.ndarray

    def index(self, landmark: str) -> int:
        """Place of a landmark among them."""
        return [point.landmark for point in self.points].index(landmark)


def read_settings(method: str, robot: Robot) -> Table:
    """The top table of a method's file for a robot, ``configs/<method>_<robot>.toml``.

    Raises:
        ResourceError: there is none, or it cannot be read.
    """
    name = f"{method}_{robot.name}"
    if name not in resources.names("configs"):
        raise ResourceError(f"method {method} has no points for robot {robot.name}: there is no configs/{name}.toml")
    table = read_toml(resources.find("configs", name), ResourceError)
    if table.text("robot") != robot.name:
        raise table.error(f"is for robot {table.text('robot')!r}, not {robot.name!r}")
    return table


def read_points(table: Table, robot: Robot) -> tuple[LandmarkPoint, ...]:
    """The ``[[points]]`` of a method's file.

    Raises:
        ResourceError: an entry is wrong, names a body the robot does not have, or repeats a landmark; or the hips are
            missing, from which the heading is taken.
    """
    found: list[LandmarkPoint] = []
    for entry in table.tables("points"):
        body = entry.text("body")
        if body not in robot.body_names:
            raise entry.error(f"body is {body!r}; robot {robot.name} has {', '.join(robot.body_names)}")
        point = entry.point("point") if entry.get("point", required=False) is not None else np.zeros(3)
        own = LandmarkPoint(entry.text("landmark"), body, point, entry.number("weight", 1.0, above=0.0))
        if own.landmark in (other.landmark for other in found):
            raise entry.error(f"repeats landmark {own.landmark!r}")
        entry.done()
        found.append(own)
    _need_hips([point.landmark for point in found], table)
    return tuple(found)


def match(human: HumanMotion, points: Collection[LandmarkPoint]) -> Landmarks:
    """The landmarks that a person has, by the names of ``configs/landmarks.toml``.

    Raises:
        MapError: nobody has said what the landmarks are called in the person's rig.
        ClipError: the person lacks a joint that the rig should have.
    """
    table = read_toml(resources.find("configs", "landmarks"), ResourceError)
    if human.rig not in table.values:
        rigs = ", ".join(table.values)
        raise MapError(f"this method knows no landmarks of the human rig {human.rig!r}; it knows those of {rigs}")
    names = table.table(human.rig)
    _need_hips(names.values, names)
    shared = tuple(point for point in points if point.landmark in names.values)
    return Landmarks(shared, np.array([human.index(names.text(point.landmark)) for point in shared]))


def thinned(human: HumanMotion, fps: float) -> HumanMotion:
    """Every k-th frame of a motion, k being how often ``fps`` goes into its frame rate (at least 1)."""
    k = max(1, int(human.fps / fps + 1e-6))
    if k == 1:
        return human
    return replace(
        human,
        positions=human.positions[::k],
        quaternions=human.quaternions[::k],
        fps=human.fps / k,
        contacts={joint: touching[::k] for joint, touching in human.contacts.items()},
    )


def _need_hips(landmarks: Collection[str], table: Table) -> None:
    missing = [hip for hip in HIPS if hip not in landmarks]
    if missing:
        raise table.error(f"has no landmark {missing[0]!r}, which the heading is taken from")
