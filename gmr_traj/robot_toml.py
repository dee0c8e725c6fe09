"""Reading robot.toml: the figures of a robot that its model file does not hold.

The fields:

    name = "..."                    # the robot's name, which clips carry
    model = "robot.xml"             # MJCF or URDF, relative to this file
    anchor_body = "..."             # the body by which tracking is judged
    mesh_folder = "..."             # optional: where the model's meshes are
    ignore_missing_meshes = false   # optional: go on without collision meshes that are not found

    [looks]                         # optional: meshes of the links, for pictures only
    package, model                  # a Python package, and the file of it whose bodies bear the same names

    [[joints]]                      # every joint in exactly one entry; names may use * and ?
    names = ["*_knee_joint"]
    velocity, acceleration, effort  # limits [rad/s], [rad/s^2], [N m], above zero
    stiffness, damping              # PD gains [N m/rad], [N m s/rad]

    [nominal]                       # a natural standing configuration [rad]; zero where a joint is not named
    "*_knee_joint" = 0.6

    [[key_bodies]]                  # bodies that describe the motion
    bodies = ["pelvis"]
    position_weight, orientation_weight     # optional, 1

    [[soles]]                       # name, body, toe, heel: contact points [m] in the body's frame
    outline                         # optional: more points that must stay above the floor

    [[supports]]                    # optional: name, shapes: collision shapes of a hand, a knee, ... that may rest on
                                    # the floor

    [[capsules]]                    # optional: name, body, start, end (optional), radius [m]; these replace the
                                    # model's own shapes of that body

    [collision]
    ignore_within_joints = 2        # bodies at most so many joints apart may overlap
    [[collision.ignore]]            # bodies = ["a", "b"] that may overlap, reason = "why that is right"
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gmr_traj.exceptions import RobotError
from gmr_traj.robot import Capsule, Sole
from gmr_traj.toml_table import Table, read_toml

# Sole points may be off their common plane by this much [m].
_PLANE_TOLERANCE = 1e-6


@dataclass(frozen=True)
class JointFigures:
    """Limits and gains shared by the joints whose names match one of ``patterns``."""

    patterns: tuple[str, ...]
    velocity: float
    acceleration: float
    effort: float
    stiffness: float
    damping: float


@dataclass(frozen=True)
class KeyBodyFigures:
    """Tracking weights shared by the bodies whose names match one of ``patterns``."""

    patterns: tuple[str, ...]
    position_weight: float
    orientation_weight: float


@dataclass(frozen=True)
class SupportShapes:
    """A part of the robot that may rest on the floor, by the names of its collision shapes."""

    name: str
    shapes: tuple[str, ...]


@dataclass(frozen=True)
class IgnoredPair:
    """Two bodies whose shapes may overlap, and why that is right."""

    bodies: tuple[str, str]
    reason: str


@dataclass(frozen=True)
class RobotFile:
    """The content of one robot.toml, before it is held against the model; see the module's text for the fields."""

    path: Path
    name: str
    model: Path
    mesh_folder: Path | None
    ignore_missing_meshes: bool
    looks: tuple[str, str] | None
    anchor_body: str
    joints: tuple[JointFigures, ...]
    nominal: dict[str, float]
    key_bodies: tuple[KeyBodyFigures, ...]
    soles: tuple[Sole, ...]
    supports: tuple[SupportShapes, ...]
    capsules: tuple[Capsule, ...]
    ignore_within_joints: int
    ignored_pairs: tuple[IgnoredPair, ...]


def read_robot_toml(path: Path) -> RobotFile:
    """Read a robot.toml.

    Raises:
        RobotError: the file cannot be read, is not TOML, or a field is missing, unknown or of the wrong kind.
    """
    top = read_toml(path, RobotError)
    nominal, collision = top.table("nominal"), top.table("collision", required=False)
    mesh_folder = top.text("mesh_folder", "")
    looks = top.table("looks", required=False)
    file = RobotFile(
        path=path,
        name=top.text("name"),
        model=path.parent / top.text("model"),
        mesh_folder=path.parent / mesh_folder if mesh_folder else None,
        ignore_missing_meshes=top.flag("ignore_missing_meshes", False),
        looks=(looks.text("package"), looks.text("model")) if looks.values else None,
        anchor_body=top.text("anchor_body"),
        joints=tuple(_joint(t) for t in top.tables("joints")),
        nominal={key: nominal.number(key) for key in nominal.values},
        key_bodies=tuple(_key_body(t) for t in top.tables("key_bodies")),
        soles=tuple(_sole(t) for t in top.tables("soles")),
        supports=tuple(_support(t) for t in top.tables("supports", required=False)),
        capsules=tuple(_capsule(t) for t in top.tables("capsules", required=False)),
        ignore_within_joints=collision.count("ignore_within_joints", 2),
        ignored_pairs=tuple(_ignored(t) for t in collision.tables("ignore", required=False)),
    )
    collision.done()
    looks.done()
    top.done()
    names = [sole.name for sole in file.soles]
    if len(set(names)) != len(names):
        raise RobotError(f"{path}: two [[soles]] have the same name; their names are {', '.join(names)}")
    names += [support.name for support in file.supports]
    if len(set(names)) != len(names):
        raise RobotError(f"{path}: names of [[soles]] and [[supports]] must differ; they are {', '.join(names)}")
    return file


def _joint(table: Table) -> JointFigures:
    figures = JointFigures(
        table.texts("names"),
        *(table.number(key, above=0.0) for key in ("velocity", "acceleration", "effort")),
        *(table.weight(key) for key in ("stiffness", "damping")),
    )
    table.done()
    return figures


def _key_body(table: Table) -> KeyBodyFigures:
    weights = [table.weight(key, 1.0) for key in ("position_weight", "orientation_weight")]
    figures = KeyBodyFigures(table.texts("bodies"), *weights)
    table.done()
    return figures


def _sole(table: Table) -> Sole:
    toe, heel = table.points("toe"), table.points("heel")
    outline = table.points("outline", required=False)
    points = np.vstack([toe, heel])
    # The smallest singular value of the centred points is their scatter off the best plane.
    if len(points) > 3 and np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[2] > _PLANE_TOLERANCE:
        raise table.error("has toe and heel points that are not in one plane")
    for array in (points, outline):
        array.setflags(write=False)
    parts = ("toe",) * len(toe) + ("heel",) * len(heel)
    sole = Sole(table.text("name"), table.text("body"), points, parts, outline)
    table.done()
    return sole


def _support(table: Table) -> SupportShapes:
    support = SupportShapes(table.text("name"), table.texts("shapes"))
    table.done()
    return support


def _capsule(table: Table) -> Capsule:
    start = table.point("start")
    end = table.point("end") if "end" in table.values else start.copy()
    for array in (start, end):
        array.setflags(write=False)
    capsule = Capsule(table.text("name"), table.text("body"), start, end, table.number("radius", above=0.0))
    table.done()
    return capsule


def _ignored(table: Table) -> IgnoredPair:
    bodies = table.texts("bodies")
    if len(bodies) != 2:
        raise table.error(f"bodies is {list(bodies)}; expected two names")
    pair = IgnoredPair((bodies[0], bodies[1]), table.text("reason"))
    table.done()
    return pair
