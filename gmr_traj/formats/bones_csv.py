"""Csv with a header, as BONES-SEED and the SOMA retargeter write it for the G1.

Columns Frame, root_translateX..Z [cm], root_rotateX..Z [deg], then ``<joint>_dof`` [deg].  The rotation is about the
world's X, then Y, then Z (R = Rz Ry Rx).  120 Hz by convention; the file does not say.
"""

from __future__ import annotations

import warnings
from typing import BinaryIO

import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.exceptions import ClipError
from gmr_traj.formats import csv_file
from gmr_traj.formats.clip import Clip
from gmr_traj.formats.fields import further
from gmr_traj.formats.raw import RawMotion, table
from gmr_traj.formats.units import continuous
from gmr_traj.robot import Robot

_TRANSLATE = ("root_translateX", "root_translateY", "root_translateZ")
_ROTATE = ("root_rotateX", "root_rotateY", "root_rotateZ")
_FPS = 120.0


def claims(content: csv_file.Table) -> bool:
    """Whether a table's header is that of this format."""
    return content.header is not None and set(_TRANSLATE + _ROTATE) <= set(content.header)


def read(content: csv_file.Table, robot: Robot) -> RawMotion:
    """What a csv with header says.

    Raises:
        ClipError: it names no joint of the robot, or a column twice.
    """
    header = content.header or ()
    if len(set(header)) != len(header):
        raise ClipError(f"the header names {next(h for h in header if header.count(h) > 1)!r} twice")
    rows = table(content.rows, "the table", len(header))
    columns = {_joint(name, robot): k for k, name in enumerate(header) if _joint(name, robot)}
    if not columns:
        raise ClipError(f"the header names no joint of {robot.name}, such as {robot.joint_names[0]}_dof")
    rotate = rows[:, [header.index(name) for name in _ROTATE]]
    read_columns = (*_TRANSLATE, *_ROTATE, "Frame", *(header[k] for k in columns.values()))
    return RawMotion(
        format="bones-csv",
        position=rows[:, [header.index(name) for name in _TRANSLATE]] / 100.0,
        quaternion=continuous(Rotation.from_euler("xyz", rotate, degrees=True).as_quat(scalar_first=True)),
        order="wxyz",
        confirmed=True,
        joints=np.radians(rows[:, list(columns.values())]),
        joint_names=tuple(columns),
        default_fps=_FPS,
        extras={"header": header, "rows": rows},
        further=further(header, read_columns),
    )


def write(clip: Clip, stream: BinaryIO) -> tuple[str, ...]:
    """Write a csv with header: the columns of the clip's own file, or the usual ones.

    Returns:
        Notes on what the format cannot hold.
    """
    motion = clip.motion
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # gimbal lock: one of the ways to write the same rotation
        rotate = Rotation.from_quat(motion.qpos[:, 3:7], scalar_first=True).as_euler("xyz", degrees=True)
    values = dict(zip(_TRANSLATE, 100.0 * motion.qpos[:, :3].T, strict=True))
    values |= dict(zip(_ROTATE, np.unwrap(rotate, axis=0, period=360.0).T, strict=True))
    for name, column in zip(motion.joint_names, np.degrees(motion.qpos[:, 7:]).T, strict=True):
        values[name] = values[f"{name}_dof"] = column
    if clip.format == "bones-csv":
        header, rows = clip.extras["header"], np.array(clip.extras["rows"])
    else:
        header = ("Frame", *_TRANSLATE, *_ROTATE, *(f"{name}_dof" for name in motion.joint_names))
        rows = np.zeros((motion.frames, len(header)))
        rows[:, 0] = np.arange(motion.frames)
    for k, name in enumerate(header):
        rows[:, k] = values.get(name, rows[:, k])
    csv_file.save(stream, csv_file.Table(rows, header))
    return (f"csv does not hold the frame rate: read it with --fps {motion.fps:.17g}",) if motion.fps != _FPS else ()


def _joint(column: str, robot: Robot) -> str:
    """The joint a column means, empty where it means none."""
    name = column.removesuffix("_dof")
    return name if name in robot.joint_names else ""
