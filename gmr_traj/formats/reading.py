"""Reading a motion clip: the container by its first bytes, the format by what it holds, the rest by testing."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from gmr_traj.exceptions import ClipError, GmrTrajError
from gmr_traj.formats import (
    bones_csv,
    csv_file,
    gmr_pickle,
    holosoma_npz,
    npz_file,
    phc_pickle,
    project_npz,
    robot_csv,
    safe_pickle,
    tracking_npz,
)
from gmr_traj.formats.clip import Clip, check_format
from gmr_traj.formats.decide import QUATERNION_ORDERS, decide, joints_of, reduced
from gmr_traj.formats.decompress import compression
from gmr_traj.formats.file_bytes import read_bytes
from gmr_traj.formats.raw import RawMotion
from gmr_traj.robot import Robot

# What else is met under these endings, by a key that only it has, and what to do with it.
_NOT_CLIPS = {
    "poses": "a human motion (SMPL), not a robot's: retarget it first",
    "pose_body": "a human motion (SMPL-X), not a robot's: retarget it first",
    "base_frame_pos": "a PyRoki clip of ProtoMotions, which is not read: export it as csv (--format protomotions-csv)",
    "split_points": "a LocoMuJoCo trajectory, which is not read: save qpos, fps (frequency) and joint_names as npz",
    "root_ori": "a PHUMA clip, which is not read: save it as a GMR pickle (root_rot from root_ori, and so on)",
    "pose_quat_global": "a human motion (PHC's), not a robot's: retarget it first",
}
_MAGIC = {
    b"\x93NUMPY": "a single array (.npy), which is not read: save it as npz with qpos, fps and joint_names",
    b"\x89HDF\r\n": "an HDF5 file, which is not read: save qpos, fps and joint_names as npz",
    b"HIERARCHY": "a BVH file, which is a human motion: retarget it first",
}


def read_clip(
    path: str | Path,
    robot: Robot,
    *,
    format: str | None = None,
    fps: float | None = None,
    quaternion: str | None = None,
) -> Clip:
    """Read a motion clip of a robot from a file of any format in ``FORMATS``.

    Nothing is guessed silently: formats, quaternion order, order of joints and bodies and units are tested against the
    robot, ``Clip.notes`` says what was decided and why, and a question that stays open is an error naming the flag to
    set. No code in the file is run.

    Args:
        path: the file.
        robot: the robot with all its joints; a file may hold fewer (23 of the G1's 29).
        format: name of the format, None to find it.
        fps: frame rate [Hz] to use instead of the file's or the format's.
        quaternion: order of the base quaternion's components (``xyzw``, ``wxyz``) to use whatever the tests say.

    Raises:
        ClipError: the file cannot be read, is not a motion of this robot, or leaves a question open.
        ScheduleError: the contact schedule in the file does not fit it.
    """
    try:
        if format is not None:
            check_format(format)
        if quaternion not in (None, *QUATERNION_ORDERS):
            raise ClipError(f"there is no quaternion order {quaternion!r}; there are {', '.join(QUATERNION_ORDERS)}")
        return decide(
            _read_raw(read_bytes(Path(path)), Path(path), robot, format, quaternion),
            robot,
            fps=fps,
            quaternion=quaternion,
        )
    except GmrTrajError as error:
        raise type(error)(f"{path}: {error}") from error


def _read_raw(data: bytes, path: Path, robot: Robot, name: str | None, quaternion: str | None) -> RawMotion:
    for magic, what in _MAGIC.items():
        if data.startswith(magic):
            raise ClipError(f"this is {what}")
    if data.startswith(b"PK\x03\x04"):
        return _from_npz(npz_file.load(data), robot, name, quaternion)
    if data.startswith(b"\x80") or compression(data) or path.suffix in (".pkl", ".pickle", ".joblib"):
        content, packed = safe_pickle.load(data)
        return _from_pickle(content, packed, name)
    return _from_csv(csv_file.load(data), robot, name, quaternion)


def _from_npz(content: Mapping[str, np.ndarray], robot: Robot, name: str | None, quaternion: str | None) -> RawMotion:
    if (name is None and holosoma_npz.claims(content, robot)) or (
        name == "holosoma" and {"qpos", "joint_pos"} & set(content)
    ):
        return holosoma_npz.read(content, robot)
    if name in (None, "mjlab", "beyondmimic") and tracking_npz.claims(content):
        joints = content["joint_pos"]
        model = reduced(robot, joints_of(robot, joints.shape[1])) if joints.ndim == 2 else robot
        return tracking_npz.read(content, model, name, quaternion)
    if name in (None, "gmr-traj") and "qpos" in content:
        return project_npz.read(content)
    raise _unknown("npz", content, name)


def _from_pickle(content: Any, packed: str | None, name: str | None) -> RawMotion:
    if name in (None, "gmr") and gmr_pickle.claims(content):
        return gmr_pickle.read(content)
    if name in (None, "phc") and phc_pickle.claims(content):
        return phc_pickle.read(content, packed)
    raise _unknown("pickle", content, name)


def _from_csv(content: csv_file.Table, robot: Robot, name: str | None, quaternion: str | None) -> RawMotion:
    if name in (None, "bones-csv") and bones_csv.claims(content):
        if quaternion is not None:
            raise ClipError("this csv has Euler angles, no quaternion; leave --quaternion out")
        return bones_csv.read(content, robot)
    if name in (None, *robot_csv.ORDERS) and content.header is None:
        return robot_csv.read(content, name)
    raise _unknown("csv", dict.fromkeys(content.header or ("numbers without a header",)), name)


def _unknown(container: str, content: Any, name: str | None) -> ClipError:
    """What the file holds instead of a clip."""
    keys = [str(key) for key in content] if isinstance(content, Mapping) else []
    for key, what in _NOT_CLIPS.items():
        if key in keys and name is None:
            return ClipError(f"this is {what}")
    shown = ", ".join(keys[:8]) if keys else f"a {type(content).__name__}"
    wanted = f"--format {name} was asked for, but this" if name else "not a known clip: this"
    return ClipError(f"{wanted} {container} holds {shown}{', ...' if len(keys) > 8 else ''}")
