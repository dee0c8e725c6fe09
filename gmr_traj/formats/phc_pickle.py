"""The pickle of PHC, H2O, ASAP and PBHC: {clip name: {root_trans_offset, root_rot (xyzw), dof, pose_aa, fps, ...}}.

``pose_aa`` (T, 1 + n + k, 3) repeats the motion as rotation vectors: the base, then each joint's axis times its
angle, then k bodies the trainers add to the skeleton (hands, head), which stay at zero.  The files come from joblib;
they are written as plain pickles, which ``joblib.load`` reads as well, compressed where the file was.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from io import BytesIO
from typing import Any, BinaryIO

import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.exceptions import ClipError
from gmr_traj.formats import pickle_writer
from gmr_traj.formats.clip import Clip
from gmr_traj.formats.fields import further, like, like_fps
from gmr_traj.formats.raw import RawMotion, table
from gmr_traj.robot import Robot

_REQUIRED = ("root_trans_offset", "root_rot", "dof")
_KEYS = (*_REQUIRED, "pose_aa", "fps")
_ADDED = 3  # bodies added to the G1's skeleton: two hands and the head


def claims(content: Any) -> bool:
    """Whether a pickle's content is a PHC clip, or clips by name."""
    return _is_clip(content) or (isinstance(content, dict) and bool(content) and all(map(_is_clip, content.values())))


def read(content: Mapping[str, Any], packed: str | None) -> RawMotion:
    """What a PHC pickle says.

    Args:
        content: what the pickle holds.
        packed: how it was compressed.

    Raises:
        ClipError: it holds several clips, or a field has another shape or type.
    """
    name = None
    if not _is_clip(content):
        if len(content) > 1:
            shown = ", ".join([*map(str, list(content)[:5]), *(["..."] if len(content) > 5 else [])])
            raise ClipError(f"the file holds {len(content)} clips ({shown}); save each to a file of its own")
        name, content = next(iter(content.items()))
    joints = content["dof"]
    if isinstance(joints, np.ndarray) and joints.ndim == 3 and joints.shape[2] == 1:
        joints = joints[..., 0]
    return RawMotion(
        format="phc",
        position=table(content["root_trans_offset"], "root_trans_offset", 3),
        quaternion=table(content["root_rot"], "root_rot", 4),
        order="xyzw",
        joints=table(joints, "dof", None),
        fps=content.get("fps"),
        default_fps=30.0,
        extras={"content": dict(content), "name": name, "compression": packed},
        further=further(content, _KEYS),
    )


def write(clip: Clip, robot: Robot, stream: BinaryIO, name: str) -> tuple[str, ...]:
    """Write a PHC pickle.

    Args:
        clip: the clip.
        robot: the robot, with the clip's joints.
        stream: where to write.
        name: name of the clip, where its own file did not give it one.

    Returns:
        Notes on what the format cannot hold.
    """
    own = clip.format == "phc"
    content = (
        dict(clip.extras["content"])
        if own
        else dict.fromkeys(("root_trans_offset", "pose_aa", "dof", "root_rot", "fps"))
    )
    qpos = clip.motion.qpos
    order = clip.extras.get("quaternion", "xyzw") if own else "xyzw"
    turns = np.roll(qpos[:, 3:7], -1, axis=1) if order == "xyzw" else qpos[:, 3:7]
    pose, notes = _pose(content.get("pose_aa"), qpos, robot)
    if "pose_aa" in content:
        content["pose_aa"] = pose
    content["root_trans_offset"] = like(content["root_trans_offset"], qpos[:, :3], np.float32)
    content["dof"] = like(content["dof"], qpos[:, 7:], np.float32)
    content["root_rot"] = like(content["root_rot"], turns)
    if "fps" in content or clip.motion.fps != 30.0:
        content["fps"] = like_fps(content.get("fps"), clip.motion.fps)
    outer: Any = content
    if not own or clip.extras["name"] is not None:
        outer = {clip.extras["name"] if own else name: content}
    packed = clip.extras["compression"] if own else None
    buffer = BytesIO()
    pickle_writer.dump(outer, buffer)
    stream.write(zlib.compress(buffer.getvalue()) if packed else buffer.getvalue())
    if not own:
        notes = (*notes, "the human's joints (smpl_joints) are not in the clip and are left out")
    return notes


def _is_clip(content: Any) -> bool:
    return isinstance(content, dict) and all(key in content for key in _REQUIRED)


def _pose(before: Any, qpos: np.ndarray, robot: Robot) -> tuple[np.ndarray, tuple[str, ...]]:
    """Rotation vectors of base and joints; the further rows as the file has them, zero where it has none."""
    moving = 1 + robot.dof
    fits = isinstance(before, np.ndarray) and before.ndim == 3 and before.dtype.kind == "f" and before.shape[2] == 3
    notes: tuple[str, ...] = ()
    if isinstance(before, np.ndarray) and fits and len(before) == len(qpos) and before.shape[1] >= moving:
        pose = np.array(before, dtype=np.float64)
    else:
        pose = np.zeros((len(qpos), moving + _ADDED, 3))
        if before is not None:
            notes = (f"pose_aa is written anew with {moving + _ADDED} rows: the file's does not fit its motion",)
    pose[:, 0] = Rotation.from_quat(qpos[:, 3:7], scalar_first=True).as_rotvec()
    pose[:, 1:moving] = robot.model.jnt_axis[1:] * qpos[:, 7:, None]
    return like(before, pose, np.float32), notes
