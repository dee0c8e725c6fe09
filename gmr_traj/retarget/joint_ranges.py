"""Joint ranges narrower than the robot's own, which keep retargeting away from postures no person takes.

A TOML file:

    robot = "unitree_g1"
    [ranges]                        # [rad]; names may use * and ?
    "*_hip_pitch_joint" = [-1.57, 1.57]
"""

from __future__ import annotations

from collections.abc import Mapping
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np

from gmr_traj import resources
from gmr_traj.exceptions import MapError
from gmr_traj.robot import Robot
from gmr_traj.toml_table import Table, read_toml


def load_joint_ranges(name: str, robot: Robot, beside: Path) -> dict[str, tuple[float, float]]:
    """Read joint ranges.

    Args:
        name: a file beside ``beside``, or one that ships with gmr-traj, with or without ``.toml``.
        robot: the robot.
        beside: the file that names them.

    Returns:
        joint -> (lower, upper) [rad], within the robot's own range.

    Raises:
        ResourceError: there is no such file.
        MapError: the file is not TOML, names a joint that the robot has not, or leaves a joint no range.
    """
    own = beside.parent / name
    path = own if own.is_file() else resources.find("configs", name)
    top = read_toml(path, MapError)
    made_for, table = top.text("robot"), top.table("ranges")
    top.done()
    if made_for != robot.name:
        raise top.error(f"holds joint ranges of robot {made_for!r}, not of {robot.name!r}")
    out: dict[str, tuple[float, float]] = {}
    for pattern in table.values:
        low, high = _range(table, pattern)
        joints = [joint for joint in robot.joint_names if fnmatchcase(joint, pattern)]
        if not joints:
            raise table.error(f"{pattern!r} is no joint of {robot.name}; it has {', '.join(robot.joint_names)}")
        for joint in joints:
            if joint in out:
                raise table.error(f"gives joint {joint!r} two ranges; expected one")
            i = robot.joint_names.index(joint)
            out[joint] = max(low, float(robot.position_lower[i])), min(high, float(robot.position_upper[i]))
            if not out[joint][0] < out[joint][1]:
                raise table.error(f"{pattern} = [{low:g}, {high:g}] leaves {joint} nothing of its own range")
    return out


def joint_limits(robot: Robot, ranges: Mapping[str, tuple[float, float]]) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper joint limits [rad] of the robot with some ranges narrowed.  # (n,) each"""
    lower, upper = np.array(robot.position_lower), np.array(robot.position_upper)
    for joint, (low, high) in ranges.items():
        i = robot.joint_names.index(joint)
        lower[i], upper[i] = low, high
    return lower, upper


def _range(table: Table, key: str) -> tuple[float, float]:
    value = table.get(key)
    numbers = isinstance(value, list) and all(type(x) in (int, float) and np.isfinite(x) for x in value)
    if not numbers or len(value) != 2 or not value[0] < value[1]:
        raise table.error(f"{key} is {value!r}; expected [lower, upper] in rad, the lower first")
    return float(value[0]), float(value[1])
