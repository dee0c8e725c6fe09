"""Clips of the motion trackers: npz of joint_pos, joint_vel (T, n) and body_pos_w, _quat_w, _lin_vel_w, _ang_vel_w.

mjlab lists bodies and joints depth first and writes velocities of the bodies' origins; BeyondMimic (Isaac) lists them
breadth first and writes velocities of their centres of mass.  Both are meant to be at 50 Hz, quaternions are wxyz.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import BinaryIO

import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.exceptions import ClipError
from gmr_traj.formats import npz_file
from gmr_traj.formats.body_layout import BodyLayout, attach
from gmr_traj.formats.body_match import match_bodies
from gmr_traj.formats.body_velocities import body_velocities, finite_differences
from gmr_traj.formats.clip import Clip
from gmr_traj.formats.fields import further, like, like_fps
from gmr_traj.formats.raw import RawMotion, table
from gmr_traj.formats.tree_order import breadth_first_bodies, breadth_first_joints, moving_bodies
from gmr_traj.formats.units import continuous, unit_quaternions
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.robot import Robot

KEYS = ("fps", "joint_pos", "joint_vel", "body_pos_w", "body_quat_w", "body_lin_vel_w", "body_ang_vel_w")
_REQUIRED = ("joint_pos", "body_pos_w", "body_quat_w")
_POINT = {"mjlab": "origin", "beyondmimic": "com", "holosoma": "com"}
_TRAINING_FPS = 50.0
_FIXED = 0.01  # a body that leaves its place by more than this [m] is not fixed to any of the robot's


def claims(content: Mapping[str, np.ndarray]) -> bool:
    """Whether an npz is of a motion tracker."""
    return all(key in content for key in _REQUIRED)


def read(content: Mapping[str, np.ndarray], robot: Robot, name: str | None, quaternion: str | None) -> RawMotion:
    """What a tracker's npz says, bodies and joints told apart by forward kinematics.

    Args:
        content: the arrays.
        robot: the robot, with as many joints as the file.
        name: format asked for, None to find it.
        quaternion: quaternion order asked for, None for wxyz or whatever fits.

    Raises:
        ClipError: a field has another shape, or no order of bodies and joints fits.
    """
    joints = table(content["joint_pos"], "joint_pos", robot.dof)
    positions = table(content["body_pos_w"], "body_pos_w", None, 3)
    count = positions.shape[1]
    turns = table(content["body_quat_w"], "body_quat_w", count, 4)
    if not len(joints) == len(positions) == len(turns) or not len(joints):
        raise ClipError(f"joint_pos has {len(joints)} frames, body_pos_w {len(positions)}, body_quat_w {len(turns)}")
    if count < len(moving_bodies(robot)):
        raise ClipError(f"the file has {count} bodies; {robot.name} has {len(moving_bodies(robot))} that move")
    flat, unit_notes = unit_quaternions(turns.reshape(-1, 4))
    turns = flat.reshape(turns.shape)
    match = match_bodies(robot, joints, positions, turns, (quaternion,) if quaternion else ("wxyz", "xyzw"))
    if name is not None and name != match.format:
        raise ClipError(
            f"--format {name} was asked for, but forward kinematics finds the bodies in the order of {match.format}"
        )
    if match.order == "xyzw":
        turns = np.roll(turns, 1, axis=-1)
    order = "depth first (MuJoCo's)" if match.format == "mjlab" else "breadth first (Isaac's)"
    note = f"bodies and joints {order}: forward kinematics meets the file's bodies to {match.residual * 1000:.1f} mm"
    return RawMotion(
        format=match.format,
        position=positions[:, match.base],
        quaternion=turns[:, match.base],
        order="wxyz",
        confirmed=True,
        joints=joints,
        joint_names=match.joint_names,
        fps=content.get("fps"),
        extras={
            "content": dict(content),
            "order": match.order,
            "layout": file_layout(robot, match.known, positions, turns),
        },
        notes=(note, *(("body quaternions are xyzw",) if match.order == "xyzw" else ()), *unit_notes),
        further=further(content, KEYS),
    )


def write(clip: Clip, robot: Robot, stream: BinaryIO, name: str) -> tuple[str, ...]:
    """Write a tracker's npz: every array anew from the motion.

    Args:
        clip: the clip.
        robot: the robot, with the clip's joints.
        stream: where to write.
        name: ``mjlab`` or ``beyondmimic``.

    Returns:
        Notes on what the format cannot hold.
    """
    own = clip.format == name
    before = clip.extras["content"] if own else {}
    qpos, fps = clip.motion.qpos, clip.motion.fps
    isaac = name == "beyondmimic"
    joint_names = breadth_first_joints(robot) if isaac else robot.joint_names
    layout = (
        clip.extras["layout"] if own else BodyLayout.plain(breadth_first_bodies(robot) if isaac else robot.body_names)
    )
    velocity = finite_differences(qpos, fps)
    columns = [robot.joint_names.index(joint) for joint in joint_names]
    arrays = {"joint_pos": qpos[:, 7:][:, columns], "joint_vel": velocity[:, 6:][:, columns]}
    arrays |= body_arrays(robot, qpos, velocity, layout, name)
    if own and clip.extras["order"] == "xyzw":
        arrays["body_quat_w"] = np.roll(arrays["body_quat_w"], -1, axis=-1)
    content = dict(before) if own else dict.fromkeys(KEYS)
    content |= {key: like(before.get(key), value, np.float32) for key, value in arrays.items()}
    content["fps"] = like_fps(before.get("fps"), fps) if own else np.array([like_fps(None, fps)])
    npz_file.save(stream, content)
    if not own and fps != _TRAINING_FPS:
        return (f"{name} trains at {_TRAINING_FPS:g} Hz; the clip keeps its {fps:g} Hz",)
    return ()


def file_layout(robot: Robot, known: dict[str, int], positions: np.ndarray, turns: np.ndarray) -> BodyLayout:
    """What the bodies of a file are fixed to.

    Args:
        robot: the robot.
        known: where in the file its bodies are, at least those that move against their parents.
        positions: origins of the file's bodies [m].  # (T, F, 3)
        turns: their unit quaternions wxyz.  # (T, F, 4)

    Raises:
        ClipError: one of them is fixed to no body of the robot.
    """
    flat = Rotation.from_quat(turns.reshape(-1, 4), scalar_first=True).as_matrix()
    rotations = flat.reshape(*turns.shape[:2], 3, 3)
    in_file = list(known.values())
    layout = attach(tuple(known), known, positions, rotations, (positions[:, in_file], rotations[:, in_file]))
    if layout.residuals.max() > _FIXED:
        worst = int(layout.residuals.argmax())
        raise ClipError(
            f"body {worst} of body_pos_w is fixed to no body of {robot.name}, it moves {layout.residuals[worst]:.2f} m"
        )
    return layout


def body_arrays(
    robot: Robot, qpos: np.ndarray, velocity: np.ndarray, layout: BodyLayout, name: str
) -> dict[str, np.ndarray]:
    """The four body_* arrays of a motion for the bodies of a layout.

    Linear velocities are those of the origins, or in the formats that have them so of the centres of mass of the
    robot's own bodies; the file's further bodies have no centre of mass here and keep their origins'.
    """
    positions, rotations = placements(robot, qpos)
    linear, angular = body_velocities(robot, qpos, velocity)
    world, turned = layout.place(robot.body_names, positions, rotations)
    quaternions = _quaternions(turned)
    out_linear, out_angular = np.zeros_like(world), np.zeros_like(world)
    for k, body in enumerate(layout.bodies):
        if body not in robot.body_names:
            continue  # the world, which is at rest
        b = robot.body_names.index(body)
        point = world[:, k]
        if not layout.offsets[k].any():
            if b == 0:
                quaternions[:, k] = qpos[:, 3:7]
            if _POINT[name] == "com":
                point = positions[:, b] + rotations[:, b] @ robot.model.body_ipos[b + 1]
        out_angular[:, k] = angular[:, b]
        out_linear[:, k] = linear[:, b] + np.cross(angular[:, b], point - positions[:, b])
    return {
        "body_pos_w": world,
        "body_quat_w": quaternions,
        "body_lin_vel_w": out_linear,
        "body_ang_vel_w": out_angular,
    }


def _quaternions(rotations: np.ndarray) -> np.ndarray:
    """Quaternions wxyz that change sign nowhere between frames."""
    flat = Rotation.from_matrix(rotations.reshape(-1, 3, 3)).as_quat(scalar_first=True)
    return continuous(flat.reshape(*rotations.shape[:2], 4))
