"""Headerless csv: x, y, z, quaternion, joints in a row; xyzw from Unitree and for BeyondMimic, wxyz from ProtoMotions.

Both have the same width and neither says its frame rate; 30 Hz is what Unitree's LAFAN1 files and the converters that
read them take.
"""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from gmr_traj.exceptions import ClipError
from gmr_traj.formats import csv_file
from gmr_traj.formats.clip import Clip
from gmr_traj.formats.raw import RawMotion, table

ORDERS = {"unitree-csv": "xyzw", "protomotions-csv": "wxyz"}
_FPS = 30.0


def read(content: csv_file.Table, name: str | None) -> RawMotion:
    """What a csv without header says.

    Args:
        content: the table.
        name: format asked for, None to find the quaternion order.

    Raises:
        ClipError: there are too few columns.
    """
    rows = table(content.rows, "the table", None)
    if rows.shape[1] < 8:
        raise ClipError(f"the table has {rows.shape[1]} columns; expected position, quaternion and joints")
    return RawMotion(
        format=name or "csv",
        position=rows[:, :3],
        quaternion=rows[:, 3:7],
        order=None if name is None else ORDERS[name],
        joints=rows[:, 7:],
        default_fps=_FPS,
    )


def write(clip: Clip, stream: BinaryIO, name: str) -> tuple[str, ...]:
    """Write a csv without header in the order of ``name``.

    Returns:
        Notes on what the format cannot hold.
    """
    qpos = clip.motion.qpos
    order = clip.extras.get("quaternion", ORDERS[name]) if clip.format == name else ORDERS[name]
    turns = np.roll(qpos[:, 3:7], -1, axis=1) if order == "xyzw" else qpos[:, 3:7]
    csv_file.save(stream, csv_file.Table(np.concatenate([qpos[:, :3], turns, qpos[:, 7:]], axis=1), None))
    if clip.motion.fps != _FPS:
        return (f"csv does not hold the frame rate: read it with --fps {clip.motion.fps:.17g}",)
    return ()
