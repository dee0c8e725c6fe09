"""Small clips of the G1 written the way other projects write them, for the tests of readers and writers.

Nothing here uses gmr_traj.formats: these are the files a user comes with.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path

import joblib
import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.robot import Robot

# The order in which Isaac lists the G1's joints, as trackers that run on both simulators publish it.
ISAAC_JOINTS = (
    "left_hip_pitch right_hip_pitch waist_yaw left_hip_roll right_hip_roll waist_roll left_hip_yaw right_hip_yaw "
    "waist_pitch left_knee right_knee left_shoulder_pitch right_shoulder_pitch left_ankle_pitch right_ankle_pitch "
    "left_shoulder_roll right_shoulder_roll left_ankle_roll right_ankle_roll left_shoulder_yaw right_shoulder_yaw "
    "left_elbow right_elbow left_wrist_roll right_wrist_roll left_wrist_pitch right_wrist_pitch left_wrist_yaw "
    "right_wrist_yaw"
)


def isaac_joints(robot: Robot) -> list[str]:
    """Names of the robot's joints in Isaac's order."""
    return [f"{name}_joint" for name in ISAAC_JOINTS.split() if f"{name}_joint" in robot.joint_names]


def isaac_bodies(robot: Robot) -> list[str]:
    """Names of the robot's bodies in Isaac's order: the base, then the body each joint moves."""
    moved = {robot.joint_names[j]: robot.body_names[robot.model.jnt_bodyid[j + 1] - 1] for j in range(robot.dof)}
    return [robot.body_names[0], *(moved[name] for name in isaac_joints(robot))]


def squats(robot: Robot, frames: int = 24, heading: float = 0.8) -> np.ndarray:
    """A robot that bends its knees over flat soles, waves its arms and turns its waist.  # (T, 7 + n)."""
    phase = np.linspace(0.0, 2.0 * np.pi, frames)
    qpos = np.tile(robot.nominal, (frames, 1))
    qpos[:, 3:7] = Rotation.from_euler("z", heading).as_quat(scalar_first=True)
    qpos[:, 0], qpos[:, 1] = 0.4, -0.3
    for k, name in enumerate(robot.joint_names):
        bend = 0.3 + 0.15 * np.sin(phase)
        side = 1.0 if name.startswith("left") else -1.0
        if name.endswith(("hip_pitch_joint", "ankle_pitch_joint")):
            qpos[:, 7 + k] = -bend
        elif name.endswith("knee_joint"):
            qpos[:, 7 + k] = 2.0 * bend
        elif name == "waist_yaw_joint":
            qpos[:, 7 + k] = 0.5 * np.sin(phase)
        elif "shoulder" in name or "elbow" in name:
            qpos[:, 7 + k] = side * (0.2 + 0.02 * k) + 0.3 * np.sin(phase + k)
        elif "wrist" in name:
            qpos[:, 7 + k] = side * 0.1 * np.cos(phase + k)
    data = mujoco.MjData(robot.model)
    sole = robot.soles[0]
    for t in range(frames):
        data.qpos[:] = qpos[t]
        mujoco.mj_kinematics(robot.model, data)
        body = data.body(sole.body)
        points = body.xpos + sole.points @ body.xmat.reshape(3, 3).T
        qpos[t, 2] -= points[:, 2].min()
    return qpos


def tracking_arrays(
    robot: Robot, qpos: np.ndarray, joints: list[str], bodies: list[str], fps: float
) -> dict[str, np.ndarray]:
    """Arrays of a motion tracker's npz in the given orders; velocities by differences of the placements."""
    data = mujoco.MjData(robot.model)
    positions, turns = np.empty((len(qpos), len(bodies), 3)), np.empty((len(qpos), len(bodies), 4))
    for t in range(len(qpos)):
        data.qpos[:] = qpos[t]
        mujoco.mj_kinematics(robot.model, data)
        for k, name in enumerate(bodies):
            positions[t, k], turns[t, k] = data.body(name).xpos, data.body(name).xquat
    columns = [7 + robot.joint_names.index(name) for name in joints]
    zeros = np.zeros_like(positions)
    return {
        "fps": np.array([fps]),
        "joint_pos": qpos[:, columns].astype(np.float32),
        "joint_vel": np.gradient(qpos[:, columns], 1 / fps, axis=0).astype(np.float32),
        "body_pos_w": positions.astype(np.float32),
        "body_quat_w": turns.astype(np.float32),
        "body_lin_vel_w": np.gradient(positions, 1 / fps, axis=0).astype(np.float32),
        "body_ang_vel_w": zeros.astype(np.float32),
    }


def gmr(robot: Robot, qpos: np.ndarray, path: Path) -> None:
    """A pickle as GMR's dataset script writes it, with two bodies that are not the robot's own."""
    still = np.array(qpos)
    still[:, :3], still[:, 3:7] = 0.0, (1, 0, 0, 0)
    local = tracking_arrays(robot, still, [], list(robot.body_names), 30)["body_pos_w"]
    foot = tracking_arrays(robot, still, [], ["left_ankle_roll_link"], 30)
    turn = Rotation.from_quat(foot["body_quat_w"][:, 0], scalar_first=True)
    toe = foot["body_pos_w"][:, 0] + turn.apply([0.08, 0.0, -0.02])
    content = {
        "fps": np.float64(29.875),
        "root_pos": qpos[:, :3],
        "root_rot": qpos[:, [4, 5, 6, 3]],
        "dof_pos": qpos[:, 7:],
        "local_body_pos": np.concatenate([local, toe[:, None], np.zeros((len(qpos), 1, 3))], axis=1).astype(np.float32),
        "link_body_list": [*robot.body_names, "left_toe_link", "pelvis_contour_link"],
    }
    path.write_bytes(pickle.dumps(content, protocol=4))


def project(robot: Robot, qpos: np.ndarray, path: Path) -> None:
    """gmr-traj's own npz."""
    np.savez(path, qpos=qpos, fps=50, joint_names=np.array(robot.joint_names), robot=robot.name)


def unitree_csv(robot: Robot, qpos: np.ndarray, path: Path) -> None:
    """Csv as of Unitree's LAFAN1 set."""
    np.savetxt(path, np.hstack([qpos[:, :3], qpos[:, [4, 5, 6, 3]], qpos[:, 7:]]), delimiter=",", fmt="%.6f")


def protomotions_csv(robot: Robot, qpos: np.ndarray, path: Path) -> None:
    """Csv as of ProtoMotions."""
    np.savetxt(path, qpos, delimiter=",")


def bones_csv(robot: Robot, qpos: np.ndarray, path: Path) -> None:
    """Csv as of BONES-SEED."""
    header = ["Frame", *(f"root_{kind}{axis}" for kind in ("translate", "rotate") for axis in "XYZ")]
    header += [f"{name}_dof" for name in robot.joint_names]
    angles = np.degrees(Rotation.from_quat(qpos[:, 3:7], scalar_first=True).as_euler("xyz"))
    rows = np.hstack([np.arange(len(qpos))[:, None], 100 * qpos[:, :3], angles, np.degrees(qpos[:, 7:])])
    np.savetxt(path, rows, delimiter=",", header=",".join(header), comments="", fmt="%.9f")


def mjlab(robot: Robot, qpos: np.ndarray, path: Path) -> None:
    """Npz of mjlab's tracker."""
    np.savez(path, **tracking_arrays(robot, qpos, list(robot.joint_names), list(robot.body_names), 50))


def beyondmimic(robot: Robot, qpos: np.ndarray, path: Path) -> None:
    """Npz of BeyondMimic's tracker."""
    np.savez(path, **tracking_arrays(robot, qpos, isaac_joints(robot), isaac_bodies(robot), 50))


def holosoma(robot: Robot, qpos: np.ndarray, path: Path) -> None:
    """Npz of holosoma's tracker, with an object and a body that is not the robot's own."""
    box = np.tile([1.0, 0.0, 0.2, 1.0, 0.0, 0.0, 0.0], (len(qpos), 1))
    bodies = ["world", *robot.body_names]
    arrays = tracking_arrays(robot, qpos, [], bodies, 50)
    arrays = {key: value.astype(np.float64) for key, value in arrays.items() if not key.startswith("joint")}
    hand = bodies.index("right_wrist_yaw_link")
    turn = Rotation.from_quat(arrays["body_quat_w"][:, hand], scalar_first=True)
    for key, value in arrays.items():
        if key.startswith("body"):
            extra = value[:, hand] + (turn.apply([0.1, 0.0, 0.0]) if key == "body_pos_w" else 0.0)
            arrays[key] = np.concatenate([value, extra[:, None]], axis=1)
    arrays["joint_pos"] = np.hstack([qpos, box])
    arrays["joint_vel"] = np.zeros((len(qpos), qpos.shape[1] - 1 + 6))
    arrays["object_pos_w"] = box[:, :3]
    np.savez(
        path, **arrays, joint_names=np.array(robot.joint_names), body_names=np.array([*bodies, "right_thumb_link"])
    )


def phc(robot: Robot, qpos: np.ndarray, path: Path) -> None:
    """Joblib pickle as of PHC and ASAP."""
    pose = np.zeros((len(qpos), 1 + robot.dof + 3, 3), dtype=np.float32)
    pose[:, 0] = Rotation.from_quat(qpos[:, 3:7], scalar_first=True).as_rotvec()
    pose[:, 1 : 1 + robot.dof] = robot.model.jnt_axis[1:] * qpos[:, 7:, None]
    content = {
        "root_trans_offset": qpos[:, :3].astype(np.float32),
        "pose_aa": pose,
        "dof": qpos[:, 7:].astype(np.float32),
        "root_rot": qpos[:, [4, 5, 6, 3]],
        "smpl_joints": np.ones((len(qpos), 24, 3), dtype=np.float32),
        "fps": 30,
    }
    joblib.dump({"a_walk": content}, path)


#: For each format how a file of it is made, its ending, and to what its numbers hold a configuration.
FILES: dict[str, tuple[Callable[[Robot, np.ndarray, Path], None], str, float]] = {
    "gmr": (gmr, ".pkl", 1e-12),
    "gmr-traj": (project, ".npz", 1e-12),
    "unitree-csv": (unitree_csv, ".csv", 1e-6),
    "protomotions-csv": (protomotions_csv, ".csv", 1e-12),
    "bones-csv": (bones_csv, ".csv", 1e-9),
    "mjlab": (mjlab, ".npz", 2e-7),
    "beyondmimic": (beyondmimic, ".npz", 2e-7),
    "holosoma": (holosoma, ".npz", 1e-12),
    "phc": (phc, ".pkl", 2e-7),
}
