"""gmr-traj's own npz: qpos (T, 7 + n) wxyz, fps, joint_names, robot, and optionally contacts and references.

Files with nothing but ``qpos`` and ``fps`` are read where the width fits the robot.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import BinaryIO

import numpy as np

from gmr_traj.contacts.schedule_json import to_json
from gmr_traj.exceptions import ClipError
from gmr_traj.formats import npz_file
from gmr_traj.formats.clip import Clip
from gmr_traj.formats.fields import further, like_fps
from gmr_traj.formats.raw import RawMotion, names, table
from gmr_traj.references import BodyTargets

_REFERENCES = {
    "reference_names": "names",
    "reference_positions": "positions",
    "reference_quaternions": "quaternions",
    "reference_position_weights": "position_weights",
    "reference_orientation_weights": "orientation_weights",
}
_POINTS = "reference_points"  # may be missing: the bodies' origins, then
_KEYS = ("qpos", "fps", "joint_names", "robot", "contacts", *_REFERENCES, _POINTS)


def read(content: Mapping[str, np.ndarray]) -> RawMotion:
    """What a gmr-traj npz says.

    Raises:
        ClipError: a field has another shape or type.
    """
    qpos = table(content["qpos"], "qpos", None)
    if qpos.shape[1] < 8:
        raise ClipError(f"qpos has {qpos.shape[1]} columns; expected position, quaternion and joints")
    return RawMotion(
        format="gmr-traj",
        position=qpos[:, :3],
        quaternion=qpos[:, 3:7],
        order="wxyz",
        joints=qpos[:, 7:],
        joint_names=names(content["joint_names"], "joint_names") if "joint_names" in content else None,
        fps=content.get("fps"),
        robot=_text(content, "robot") or "",
        contacts=_text(content, "contacts"),
        references=_references(content),
        extras={"fps": content.get("fps"), "others": {k: v for k, v in content.items() if k not in _KEYS}},
        further=further(content, _KEYS),
    )


def write(clip: Clip, stream: BinaryIO) -> tuple[str, ...]:
    """Write a gmr-traj npz, always float64; it holds everything a clip has.

    Returns:
        No notes.
    """
    motion = clip.motion
    own = clip.format == "gmr-traj"
    order = clip.extras.get("quaternion", "wxyz") if own else "wxyz"
    qpos = np.array(motion.qpos)
    if order == "xyzw":
        qpos[:, 3:7] = np.roll(qpos[:, 3:7], -1, axis=1)
    content = {
        "qpos": qpos,
        "fps": like_fps(clip.extras.get("fps") if own else None, motion.fps),
        "joint_names": np.array(motion.joint_names),
        "robot": np.array(motion.robot),
    }
    if clip.schedule is not None:
        content["contacts"] = np.array(to_json(clip.schedule))
    if clip.references is not None:
        content |= {key: np.array(getattr(clip.references, field)) for key, field in _REFERENCES.items()}
        content[_POINTS] = np.array(clip.references.points)
    others = clip.extras.get("others", {}) if own else {}
    npz_file.save(stream, content | others | clip.extras.get("leads", {}))
    return ()


def _text(content: Mapping[str, np.ndarray], key: str) -> str | None:
    if key not in content:
        return None
    value = content[key]
    if value.ndim or value.dtype.kind != "U":
        raise ClipError(f"{key} is not text")
    return str(value)


def _references(content: Mapping[str, np.ndarray]) -> BodyTargets | None:
    present = [key for key in (*_REFERENCES, _POINTS) if key in content]
    if not present:
        return None
    if not set(_REFERENCES) <= set(present):
        raise ClipError(f"references are incomplete: {next(k for k in _REFERENCES if k not in present)} is missing")
    listed = names(content["reference_names"], "reference_names")
    return BodyTargets(
        names=listed,
        positions=table(content["reference_positions"], "reference_positions", len(listed), 3),
        quaternions=table(content["reference_quaternions"], "reference_quaternions", len(listed), 4),
        position_weights=table(content["reference_position_weights"], "reference_position_weights"),
        orientation_weights=table(content["reference_orientation_weights"], "reference_orientation_weights"),
        points=table(content[_POINTS], _POINTS, 3) if _POINTS in content else np.zeros((len(listed), 3)),
    )
