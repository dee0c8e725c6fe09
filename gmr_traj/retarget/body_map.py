"""Which joint of a person tells which body of a robot where to be: a map, read from a TOML file.

The fields:

    rigs = ["lafan1"]               # human rigs whose joint names and joint frames the map is made for
    robot = "unitree_g1"            # the robot
    root = "Hips"                   # the human joint that positions are scaled about; one target must have it
    human_height = 1.8              # [m] height of a person for whom the scales below are right
    joint_ranges = "..."            # optional: narrower joint ranges, see gmr_traj/retarget/joint_ranges.py

    [posture]                       # optional: the robot in the posture that the rotation offsets were derived from;
    "*_elbow_joint" = 1.5708        # joints, which may use * and ? [rad]; see gmr_traj/retarget/alignment.py

    [[targets]]                     # one a robot body
    joint = "LeftFoot"              # human joint whose position counts
    orientation_joint = "LeftToe"   # optional: human joint whose orientation counts; `joint` otherwise
    body = "left_ankle_roll_link"   # robot body
    point = [0.1, 0.0, -0.02]       # optional: the point of that body, in its frame [m]; its origin otherwise
    scale = 0.9                     # of the position relative to the root
    position_offset = [0, 0, 0]     # optional: added to the position, in the turned frame [m]
    rotation_offset = [1, 0, 0, 0]  # joint frame to body frame, quaternion wxyz
    stage_one = { position = 50, orientation = 10 }     # costs of the errors [1/m], [1/rad]
    stage_two = { position = 50, orientation = 10 }
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gmr_traj import resources
from gmr_traj.exceptions import MapError, ResourceError
from gmr_traj.retarget.joint_ranges import load_joint_ranges
from gmr_traj.robot import Robot
from gmr_traj.toml_table import Table, read_toml

_BETWEEN = "_to_"
# A quaternion in a map may be off unit length by this much; published figures have eight digits.
_UNIT_TOLERANCE = 1e-3
_NONE = [1.0, 0.0, 0.0, 0.0]  # no rotation


@dataclass(frozen=True)
class Target:
    """What one human joint tells one robot body; see the module's text for the fields.

    Attributes:
        joint, orientation_joint: human joints whose position and whose orientation count.
        body: the robot's body.
        point: in the body's frame [m].  # (3,)
        scale: of the position relative to the root.
        position_offset: in the turned frame [m].  # (3,)
        rotation_offset: joint frame to body frame, unit, wxyz.  # (4,)
        stage_one, stage_two: (position, orientation) costs; an error weighs with the square of its cost.
    """

    joint: str
    orientation_joint: str
    body: str
    point: np.ndarray
    scale: float
    position_offset: np.ndarray
    rotation_offset: np.ndarray
    stage_one: tuple[float, float]
    stage_two: tuple[float, float]


@dataclass(frozen=True)
class BodyMap:
    """A human-to-robot map.

    Attributes:
        name: stem of the file.
        rigs: human rigs it is made for.
        robot: name of the robot it is made for.
        root: the human joint that positions are scaled about.
        human_height: height of a person for whom the scales are right [m].
        targets: one a robot body.
        joint_ranges: joint -> narrower range [rad] that retargeting keeps to.
        posture: joint or pattern -> position [rad] in the posture that the rotation offsets were derived from.
    """

    name: str
    rigs: tuple[str, ...]
    robot: str
    root: str
    human_height: float
    targets: tuple[Target, ...]
    joint_ranges: Mapping[str, tuple[float, float]]
    posture: Mapping[str, float]

    @property
    def root_target(self) -> Target:
        """The target that belongs to the root."""
        return next(target for target in self.targets if target.joint == self.root)

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the robot's bodies, in the order of the targets."""
        return tuple(target.body for target in self.targets)

    @property
    def points(self) -> np.ndarray:
        """The bodies' points, in their frames [m].  # (B, 3)"""
        return np.stack([target.point for target in self.targets])

    def costs(self, stage: int) -> np.ndarray:
        """(position, orientation) costs in stage 1 or 2.  # (B, 2)"""
        return np.array([target.stage_one if stage == 1 else target.stage_two for target in self.targets])


def map_names() -> tuple[str, ...]:
    """Names of the maps that ship with gmr-traj."""
    return tuple(name for name in resources.names("configs") if _BETWEEN in name)


def default_map_name(rig: str, robot: str) -> str:
    """The shipped map from a rig to a robot.

    Raises:
        MapError: there is none; the message lists those there are.
    """
    ends = f"{_BETWEEN}{robot}"
    candidates = [name for name in map_names() if name.endswith(ends)]
    for name in sorted(candidates, key=lambda name: name != rig + ends):
        top = read_toml(resources.find("configs", name), MapError)
        if rig in top.texts("rigs"):
            return name
    known = ", ".join(map_names()) or "none"
    what = "a human skeleton that is not known" if rig == "unknown" else f"the human rig {rig!r}"
    raise MapError(f"no map leads from {what} to robot {robot}; there are: {known}; give one of your own with --map")


def load_map(name_or_path: str | Path, robot: Robot, *, draft: bool = False) -> BodyMap:
    """Load a map.

    Args:
        name_or_path: a map that ships with gmr-traj (``lafan1_to_unitree_g1``), or the path of a file.
        robot: the robot it must fit; with locked joints, too.
        draft: targets may come without rotation offsets, which are none then.

    Raises:
        ResourceError: there is no such map.
        MapError: a field is missing, unknown or of the wrong kind, or does not fit the robot.
    """
    try:
        path = resources.find("configs", name_or_path)
    except ResourceError:
        known = ", ".join(map_names())
        raise ResourceError(f"{name_or_path}: no such file, and no map of that name; there are: {known}") from None
    top = read_toml(path, MapError)
    made_for = top.text("robot")
    if made_for != robot.name:
        raise top.error(f"is a map to robot {made_for!r}, not to {robot.name!r}")
    rigs, root, height = top.texts("rigs"), top.text("root"), top.number("human_height", above=0.0)
    ranges, posture = top.text("joint_ranges", ""), top.table("posture", required=False)
    targets = tuple(_target(table, robot, draft) for table in top.tables("targets"))
    top.done()
    for k, target in enumerate(targets):
        if target.body in (earlier.body for earlier in targets[:k]):
            raise top.error(f"gives body {target.body!r} two targets; expected one a body")
    roots = sum(target.joint == root for target in targets)
    if roots != 1:
        raise top.error(f"root is {root!r}, which is the joint of {roots} [[targets]]; expected one")
    for stage in ("stage_one", "stage_two"):
        if not any(any(getattr(target, stage)) for target in targets):
            raise top.error(f"all costs of {stage} are zero; nothing would be followed")
    return BodyMap(
        name=path.stem,
        rigs=rigs,
        robot=made_for,
        root=root,
        human_height=height,
        targets=targets,
        joint_ranges=load_joint_ranges(ranges, robot, beside=path) if ranges else {},
        posture={joint: posture.number(joint) for joint in posture.values},
    )


def _target(table: Table, robot: Robot, draft: bool) -> Target:
    joint, body = table.text("joint"), table.text("body")
    table.where = f"[[targets]] {joint} -> {body}:"
    if body not in robot.body_names:
        raise table.error(f"robot {robot.name} has no body {body!r}; it has {', '.join(robot.body_names)}")
    target = Target(
        joint=joint,
        orientation_joint=table.text("orientation_joint", "") or joint,
        body=body,
        point=_optional_point(table, "point"),
        scale=table.number("scale", above=0.0),
        position_offset=_optional_point(table, "position_offset"),
        rotation_offset=_quaternion(table, "rotation_offset", _NONE if draft else None),
        stage_one=_costs(table, "stage_one"),
        stage_two=_costs(table, "stage_two"),
    )
    table.done()
    return target


def _optional_point(table: Table, key: str) -> np.ndarray:
    return table.point(key) if table.get(key, required=False) is not None else np.zeros(3)


def _quaternion(table: Table, key: str, default: list[float] | None) -> np.ndarray:
    value = table.get(key, default, required=default is None)
    numbers = isinstance(value, list) and all(isinstance(x, (int, float)) and not isinstance(x, bool) for x in value)
    norm = float(np.linalg.norm(value)) if numbers and len(value) == 4 else 0.0
    if not abs(norm - 1.0) <= _UNIT_TOLERANCE:
        raise table.error(f"{key} is {value!r}; expected a quaternion [w, x, y, z] of length 1")
    return np.array(value, dtype=float) / norm


def _costs(table: Table, key: str) -> tuple[float, float]:
    inner = table.table(key)
    inner.where = f"{table.where} {key}"
    costs = inner.weight("position"), inner.weight("orientation")
    inner.done()
    return costs
