"""GMR's pickle: a dict of root_pos (T, 3), root_rot (T, 4) xyzw, dof_pos (T, n), fps, local_body_pos, link_body_list.

``local_body_pos`` holds the origins of the bodies in ``link_body_list`` with the base at the world's origin,
unturned; scripts that retarget a single file write None for both.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, BinaryIO

import numpy as np

from gmr_traj.exceptions import ClipError
from gmr_traj.formats import pickle_writer
from gmr_traj.formats.body_layout import BodyLayout, attach
from gmr_traj.formats.clip import Clip
from gmr_traj.formats.fields import further, like, like_fps
from gmr_traj.formats.raw import RawMotion, names, table
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.robot import Robot

KEYS = ("fps", "root_pos", "root_rot", "dof_pos", "local_body_pos", "link_body_list")
_REQUIRED = ("root_pos", "root_rot", "dof_pos")
_FIXED = 0.005  # a body that leaves its place by more than this [m] is not fixed to any of the robot's


def claims(content: Any) -> bool:
    """Whether a pickle's content is a GMR clip."""
    return isinstance(content, dict) and all(key in content for key in _REQUIRED)


def read(content: Mapping[str, Any]) -> RawMotion:
    """What a GMR pickle says.

    Raises:
        ClipError: a field has another shape or type.
    """
    joints = table(content["dof_pos"], "dof_pos", None)
    return RawMotion(
        format="gmr",
        position=table(content["root_pos"], "root_pos", 3),
        quaternion=table(content["root_rot"], "root_rot", 4),
        order="xyzw",
        joints=joints,
        fps=content.get("fps"),
        extras={"content": dict(content)},
        further=further(content, KEYS),
    )


def write(clip: Clip, robot: Robot, stream: BinaryIO) -> tuple[str, ...]:
    """Write a GMR pickle: the clip's own fields anew, what else its file held as it was.

    Returns:
        Notes on what the format cannot hold.
    """
    content = dict(clip.extras["content"]) if clip.format == "gmr" else dict.fromkeys(KEYS)
    notes: tuple[str, ...] = ()
    bodies, listed = content.get("local_body_pos"), content.get("link_body_list")
    if clip.format != "gmr":
        content["link_body_list"] = list(robot.body_names)
        content["local_body_pos"] = _local(clip, robot)[0].astype(np.float32)
    elif bodies is not None:
        positions, notes = _recompute(bodies, listed, content, clip, robot)
        content["local_body_pos"] = positions
    qpos = clip.motion.qpos
    content["fps"] = like_fps(content.get("fps"), clip.motion.fps)
    content["root_pos"] = like(content["root_pos"], qpos[:, :3])
    order = clip.extras.get("quaternion", "xyzw") if clip.format == "gmr" else "xyzw"
    content["root_rot"] = like(
        content["root_rot"], np.roll(qpos[:, 3:7], -1, axis=1) if order == "xyzw" else qpos[:, 3:7]
    )
    content["dof_pos"] = like(content["dof_pos"], qpos[:, 7:])
    pickle_writer.dump(content, stream)
    return notes


def _local(clip: Clip, robot: Robot, joints: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Placements of the robot's bodies with the base at the origin, unturned."""
    joints = clip.motion.qpos[:, 7:] if joints is None else joints
    qpos = np.zeros((len(joints), 7 + joints.shape[1]))
    qpos[:, 3] = 1.0
    qpos[:, 7:] = joints
    return placements(robot, qpos)


def _recompute(
    bodies: Any, listed: Any, content: Mapping[str, Any], clip: Clip, robot: Robot
) -> tuple[np.ndarray | None, tuple[str, ...]]:
    """local_body_pos of the clip, its further bodies fixed where they were in the file; None where that cannot be."""
    try:
        link_names = names(listed, "link_body_list")
        before = table(bodies, "local_body_pos", len(link_names), 3)
        joints = table(content["dof_pos"], "dof_pos", robot.dof)
        if len(joints) != len(before):
            raise ClipError(f"local_body_pos has {len(before)} frames, dof_pos {len(joints)}")
    except ClipError as error:
        return None, (f"local_body_pos is written as None: {error}",)
    known = {name: link_names.index(name) for name in robot.body_names if name in link_names}
    layout: BodyLayout = attach(robot.body_names, known, before, None, _local(clip, robot, joints))
    loose = [name for name, residual in zip(link_names, layout.residuals, strict=True) if residual > _FIXED]
    if loose:
        return None, (f"local_body_pos is written as None: body {loose[0]!r} is not fixed to any body of {robot.name}",)
    after = layout.place(robot.body_names, *_local(clip, robot))[0]
    return like(bodies, after), ()
