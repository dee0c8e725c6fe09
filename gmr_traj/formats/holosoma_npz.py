"""holosoma's npz in its three shapes.

- For its tracker: the keys of ``tracking_npz``, but ``joint_pos`` and ``joint_vel`` are the whole qpos (T, 7 + n [+ 7
  of an object]) and qvel; bodies include the world; ``joint_names`` and ``body_names`` say which is which.  The base's
  angular velocity in ``joint_vel`` is in world axes, and linear velocities are those of centres of mass.
- From its retargeter: ``qpos`` (T, 7 + n [+ 7]), ``human_joints``, ``cost``.
- OmniRetarget's data set: the same ``qpos`` with the base's (and object's) quaternion before its position.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import BinaryIO

import numpy as np

from gmr_traj.exceptions import ClipError
from gmr_traj.formats import npz_file, tracking_npz
from gmr_traj.formats.body_layout import BodyLayout
from gmr_traj.formats.body_velocities import finite_differences
from gmr_traj.formats.clip import Clip
from gmr_traj.formats.decide import joint_sets, joints_of, reduced
from gmr_traj.formats.fields import further, like, like_fps
from gmr_traj.formats.raw import RawMotion, names, table
from gmr_traj.formats.tree_order import moving_bodies
from gmr_traj.formats.units import unit_quaternions
from gmr_traj.robot import Robot

_OBJECT = 7
_RETARGETER = ("human_joints", "cost")
_KEYS = (*tracking_npz.KEYS, "qpos", "joint_names", "body_names")


def claims(content: Mapping[str, np.ndarray], robot: Robot) -> bool:
    """Whether an npz is holosoma's: a whole qpos where trackers have joints, or a human or an object beside qpos."""
    if tracking_npz.claims(content):
        return (
            content["joint_pos"].ndim == 2 and _joint_count(content["joint_pos"].shape[1], content, robot) is not None
        )
    if "qpos" not in content or content["qpos"].ndim != 2 or "robot" in content:
        return False
    if any(key in content for key in _RETARGETER) or _quaternion_first(content["qpos"]):
        return True
    width = content["qpos"].shape[1]
    count = _joint_count(width, content, robot)
    return count is not None and width == 7 + count + _OBJECT


def read(content: Mapping[str, np.ndarray], robot: Robot) -> RawMotion:
    """What a holosoma npz says.

    Raises:
        ClipError: a field has another shape or type.
    """
    field = "joint_pos" if "joint_pos" in content else "qpos"
    qpos = table(content[field], field, None)
    count = _joint_count(qpos.shape[1], content, robot)
    if count is None:
        raise ClipError(
            f"{field} has {qpos.shape[1]} columns; expected {7 + robot.dof}, with an object {7 + robot.dof + _OBJECT}"
        )
    first = field == "qpos" and _quaternion_first(qpos)
    base = np.roll(qpos[:, :7], -4, axis=1) if first else qpos[:, :7]
    joint_names = names(content["joint_names"], "joint_names") if "joint_names" in content else None
    extras = {"content": dict(content), "field": field, "quaternion_first": first, "joint_names": joint_names}
    if field == "joint_pos":
        model = reduced(robot, joint_names or joints_of(robot, count))
        extras["layout"] = _layout(content, model, len(qpos))
        if qpos.shape[1] > 7 + count and table(content.get("joint_vel"), "joint_vel", 12 + count).shape[0] != len(qpos):
            raise ClipError(f"joint_vel has another number of frames than joint_pos, {len(qpos)}")
    notes = ("the base's quaternion comes before its position (OmniRetarget)",) if first else ()
    return RawMotion(
        format="holosoma",
        position=base[:, :3],
        quaternion=base[:, 3:7],
        order="wxyz",
        joints=qpos[:, 7 : 7 + count],
        joint_names=joint_names,
        fps=content.get("fps"),
        extras=extras,
        notes=notes,
        further=_further(content, qpos.shape[1] > 7 + count),
    )


def write(clip: Clip, robot: Robot, stream: BinaryIO) -> tuple[str, ...]:
    """Write a holosoma npz in the shape of the clip's own file, or for the tracker; object and human as they were.

    holosoma's own converter hands the base's world angular velocity to MuJoCo, which takes it for one in the base's
    axes, so the body velocities in its files are not those of their positions; the ones written here are.

    Returns:
        Notes on what the format cannot hold.
    """
    own = clip.format == "holosoma"
    before = clip.extras["content"] if own else {}
    qpos = _file_qpos(clip)
    content = dict(before)
    content["fps"] = (
        like_fps(before.get("fps"), clip.motion.fps) if own else np.array([like_fps(None, clip.motion.fps)])
    )
    if own and clip.extras["field"] == "qpos":
        content["qpos"] = like(before["qpos"], qpos)
        npz_file.save(stream, content)
        return ()
    velocity = finite_differences(clip.motion.qpos, clip.motion.fps)
    layout = clip.extras["layout"] if own else BodyLayout.plain(("", *robot.body_names))
    arrays = {"joint_pos": qpos, "joint_vel": _file_qvel(clip, velocity)}
    arrays |= tracking_npz.body_arrays(robot, clip.motion.qpos, velocity, layout, "holosoma")
    content |= {key: like(before.get(key), value) for key, value in arrays.items()}
    if not own:
        content |= {
            "joint_names": np.array(clip.motion.joint_names),
            "body_names": np.array(("world", *robot.body_names)),
        }
    npz_file.save(stream, content)
    return ()


def _further(content: Mapping[str, np.ndarray], has_object: bool) -> tuple[str, ...]:
    return (*(("the object's columns",) if has_object else ()), *further(content, _KEYS))


def _joint_count(width: int, content: Mapping[str, np.ndarray], robot: Robot) -> int | None:
    """Number of joints in a qpos of ``width`` columns, with an object or without; None where no number fits."""
    listed = content.get("joint_names")
    counts = (
        (len(listed),) if listed is not None and listed.ndim else tuple(len(joints) for joints in joint_sets(robot))
    )
    return next((n for n in counts if width in (7 + n, 7 + n + _OBJECT)), None)


def _quaternion_first(qpos: np.ndarray) -> bool:
    """Columns 0 to 4 have unit length and columns 3 to 7 have not."""
    if qpos.shape[1] < 8 or qpos.dtype.kind != "f" or not len(qpos) or not np.isfinite(qpos[:, :7]).all():
        return False
    with np.errstate(over="ignore"):
        off = [np.abs(np.linalg.norm(qpos[:, a : a + 4], axis=1) - 1.0).max() for a in (0, 3)]
    return bool(off[0] < 1e-3 < 0.1 < off[1])


def _joint_columns(clip: Clip) -> list[int]:
    """For each of the file's joints its column in the motion."""
    listed = clip.extras.get("joint_names") if clip.format == "holosoma" else None
    return [clip.motion.joint_names.index(name) for name in listed or clip.motion.joint_names]


def _file_qpos(clip: Clip) -> np.ndarray:
    """Qpos in the order of the file, the object's columns as they were."""
    qpos = clip.motion.qpos
    base = np.array(qpos[:, :7])
    own = clip.format == "holosoma"
    if own and clip.extras["quaternion"] == "xyzw":
        base[:, 3:7] = np.roll(base[:, 3:7], -1, axis=1)
    if own and clip.extras["quaternion_first"]:
        base = np.roll(base, 4, axis=1)
    return np.concatenate(
        [base, qpos[:, 7:][:, _joint_columns(clip)], *_rest(clip, clip.extras.get("field"), 7)], axis=1
    )


def _file_qvel(clip: Clip, velocity: np.ndarray) -> np.ndarray:
    """Qvel in the order of the file, the object's columns as they were."""
    return np.concatenate(
        [velocity[:, :6], velocity[:, 6:][:, _joint_columns(clip)], *_rest(clip, "joint_vel", 6)], axis=1
    )


def _rest(clip: Clip, field: str | None, base: int) -> list[np.ndarray]:
    """Columns of the file's field after base and joints: the object's."""
    content = clip.extras["content"] if clip.format == "holosoma" else {}
    if field is None or field not in content:
        return []
    return [table(content[field], field, None)[:, base + len(clip.motion.joint_names) :]]


def _layout(content: Mapping[str, np.ndarray], robot: Robot, frames: int) -> BodyLayout:
    """What the bodies the file names are fixed to."""
    listed = names(content.get("body_names"), "body_names")
    positions = table(content["body_pos_w"], "body_pos_w", len(listed), 3)
    turns = table(content["body_quat_w"], "body_quat_w", len(listed), 4)
    missing = moving_bodies(robot) - set(listed)
    if missing:
        raise ClipError(f"body_names has no {min(missing)!r}, a body of {robot.name}")
    if not len(positions) == len(turns) == frames or not frames:
        raise ClipError(f"joint_pos has {frames} frames, body_pos_w {len(positions)}, body_quat_w {len(turns)}")
    flat, _ = unit_quaternions(turns.reshape(-1, 4))
    known = {name: listed.index(name) for name in robot.body_names if name in listed}
    return tracking_npz.file_layout(robot, known, positions, flat.reshape(turns.shape))
