"""Small human motions written the way other projects write them, for the tests of their readers.

Nothing here uses gmr_traj: these are the files a user comes with.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation


class Bone(NamedTuple):
    """A joint of a BVH hierarchy: name, parent (empty for the root), OFFSET, channels."""

    name: str
    parent: str
    offset: Sequence[float]
    channels: str


EULER = "Yrotation Xrotation Zrotation"
# A person of Xsens's rig, in metres: y up, arms out along x, looking along z.
_SIDES = [(s, 1.0 if s == "Left" else -1.0) for s in ("Right", "Left")]
XSENS = [
    Bone("Hips", "", (0, 0, 0), "Xposition Yposition Zposition Xrotation Yrotation Zrotation"),
    Bone("Chest", "Hips", (0, 0.10, 0), EULER),
    Bone("Chest2", "Chest", (0, 0.10, 0), EULER),
    Bone("Chest3", "Chest2", (0, 0.10, 0), EULER),
    Bone("Chest4", "Chest3", (0, 0.10, 0), EULER),
    Bone("Neck", "Chest4", (0, 0.13, 0), EULER),
    Bone("Head", "Neck", (0, 0.10, 0.01), EULER),
    *(
        Bone(side + name, side + parent if parent != "Chest4" else parent, (sign * x, y, 0), EULER)
        for side, sign in _SIDES
        for name, parent, x, y in (
            ("Collar", "Chest4", 0.03, 0.07), ("Shoulder", "Collar", 0.14, 0), ("Elbow", "Shoulder", 0.29, 0),
            ("Wrist", "Elbow", 0.25, 0),
        )
    ),
    *(
        Bone(side + name, side + parent if parent != "Hips" else parent, (sign * x, y, z), EULER)
        for side, sign in _SIDES
        for name, parent, x, y, z in (
            ("Hip", "Hips", 0.09, 0.0, 0), ("Knee", "Hip", 0, -0.43, 0), ("Ankle", "Knee", 0, -0.42, 0),
            ("Toe", "Ankle", 0, -0.07, 0.17),
        )
    ),
]  # fmt: skip
STANDING = 0.43 + 0.42 + 0.63 + np.hypot(0.10, 0.01) - 0.1  # along the bones from ankle to head [m]


def columns(bones: Sequence[Bone]) -> list[tuple[str, str]]:
    """(joint, channel) of every column of the motion."""
    return [(bone.name, channel) for bone in bones for channel in bone.channels.split()]


def walk(frames: int = 40, fps: float = 30.0) -> np.ndarray:
    """Channel values of an Xsens person who walks along z with swinging legs [m, deg].  # (T, C)"""
    time = np.arange(frames) / fps
    values = np.zeros((frames, len(columns(XSENS))))
    swing = 25.0 * np.sin(2 * np.pi * time)
    knee = 20.0 + 20.0 * np.cos(2 * np.pi * time)
    moved = {
        ("Hips", "Xposition"): 0.2 + 0 * time,
        ("Hips", "Yposition"): 0.90 + 0.01 * np.cos(4 * np.pi * time),
        ("Hips", "Zposition"): 1.1 * time,
        ("Hips", "Yrotation"): 5.0 * np.sin(2 * np.pi * time),
        ("LeftHip", "Xrotation"): -swing,
        ("RightHip", "Xrotation"): swing,
        ("LeftKnee", "Xrotation"): knee,
        ("RightKnee", "Xrotation"): 40.0 - knee,
        ("LeftElbow", "Yrotation"): -30.0 + swing,
        ("LeftShoulder", "Zrotation"): -70.0 + 0 * time,
        ("RightShoulder", "Zrotation"): 70.0 + 0 * time,
    }
    for key, value in moved.items():
        values[:, columns(XSENS).index(key)] = value
    return values


def z_up(values: np.ndarray) -> np.ndarray:
    """The walk in a file whose Z is up: the root turned by 90 degrees about X."""
    turn = Rotation.from_euler("x", 90, degrees=True)
    out = values.copy()
    out[:, :3] = turn.apply(values[:, :3])
    out[:, 3:6] = (turn * Rotation.from_euler("XYZ", values[:, 3:6], degrees=True)).as_euler("XYZ", degrees=True)
    return out


def bvh(
    bones: Sequence[Bone], values: np.ndarray, frame_time: str = "0.033333", scale: float = 1.0, indent: str = "\t"
) -> str:
    """The text of a BVH file; lengths times ``scale``."""
    lines = ["HIERARCHY"]

    def put(bone: Bone, depth: int) -> None:
        pad = indent * depth
        lines.append(f"{pad}{'JOINT' if bone.parent else 'ROOT'} {bone.name}")
        lines.append(f"{pad}{{")
        lines.append(f"{pad}{indent}OFFSET {' '.join(f'{scale * x:.9f}' for x in bone.offset)}")
        lines.append(f"{pad}{indent}CHANNELS {len(bone.channels.split())} {bone.channels}")
        children = [b for b in bones if b.parent == bone.name]
        for child in children:
            put(child, depth + 1)
        if not children:
            lines.append(f"{pad}{indent}End Site\n{pad}{indent}{{\n{pad}{indent}{indent}OFFSET 0 0 0\n{pad}{indent}}}")
        lines.append(f"{pad}}}")

    put(bones[0], 0)
    scales = [scale if channel.endswith("position") else 1.0 for _, channel in columns(bones)]
    lines += ["MOTION", f"Frames: {len(values)}", f"Frame Time: {frame_time}"]
    lines += [" ".join(f"{x:.9f}" for x in row) for row in values * scales]
    return "\n".join(lines) + "\n"


def bvh_file(path: Path) -> None:
    """A BVH file in centimetres."""
    path.write_text(bvh(XSENS, walk(), scale=100.0))


def smpl_motion(frames: int = 30, width: int = 165) -> dict[str, np.ndarray]:
    """Entries of an AMASS file: a person upright in a world with Z up, who bends a knee and turns."""
    rng = np.random.default_rng(3)
    time = np.linspace(0, 1, frames)
    poses = 0.02 * rng.normal(size=(1, width)) * np.sin(2 * np.pi * time)[:, None]
    turn = Rotation.from_euler("z", 0.4 * time[:, None]) * Rotation.from_euler("x", 90, degrees=True)
    poses[:, :3] = turn.as_rotvec()
    poses[:, 3 * 4] = 0.5 * np.sin(np.pi * time)
    return {
        "poses": poses,
        "trans": np.stack([0.8 * time, 0 * time, 0.93 + 0 * time], axis=1),
        "betas": np.array([1.5, *np.zeros(15)]),
        "gender": np.array("neutral"),
        "mocap_frame_rate": np.array(120.0),
    }


def smplx_file(path: Path) -> None:
    """As AMASS has it for SMPL-X, with a dictionary that only Python can read."""
    others = {"surface_model_type": "smplx", "markers_latent_vids": np.array({"ARIEL": 9011}, dtype=object)}
    np.savez(path, **smpl_motion(), **others)


def smplx_parts_file(path: Path) -> None:
    """As GMR reads it: the parts of the pose, and no whole."""
    content = smpl_motion()
    poses = content.pop("poses")
    np.savez(path, root_orient=poses[:, :3], pose_body=poses[:, 3:66], **content)


def smpl_file(path: Path) -> None:
    """As motions from video come: SMPL, 72 values, the older name of the frame rate."""
    content = smpl_motion(width=72)
    content["mocap_framerate"] = content.pop("mocap_frame_rate")
    np.savez(path, **content)


DEEPMIMIC_JOINTS = (
    "chest neck right_hip right_knee right_ankle right_shoulder right_elbow left_hip left_knee left_ankle "
    "left_shoulder left_elbow"
).split()


def deepmimic_row(duration: float, x: float, knee: float) -> list[float]:
    """A frame of a person upright at x whose right knee is bent."""
    row = [duration, x, 0.9, 0.0, 1.0, 0.0, 0.0, 0.0]
    for name in DEEPMIMIC_JOINTS:
        hinge = name.endswith(("knee", "elbow"))
        row += [knee if name == "right_knee" else 0.0] if hinge else [1.0, 0.0, 0.0, 0.0]
    return row


def deepmimic(rows: list[list[float]], loop: str = "none") -> str:
    """The text of a DeepMimic clip."""
    return json.dumps({"Loop": loop, "Frames": rows})


def deepmimic_file(path: Path) -> None:
    """A DeepMimic clip of 12 frames at 30 a second."""
    path.write_text(deepmimic([deepmimic_row(1 / 30, 0.02 * k, -0.05 * k) for k in range(12)]))


def neutral_file(path: Path) -> None:
    """gmr-traj's own npz with everything it may have."""
    frames = 20
    positions = np.zeros((frames, 6, 3))
    positions[..., 2] = (0.95, 1.55, 0.9, 0.08, 0.9, 0.08)
    positions[:, (2, 3), 1], positions[:, (4, 5), 1] = 0.1, -0.1
    positions[..., 0] = np.linspace(0, 2, frames)[:, None]
    np.savez(
        path,
        joint_names=["Hips", "Head", "LeftHip", "LeftFoot", "RightHip", "RightFoot"],
        joint_parents=[-1, 0, 0, 2, 0, 4],
        positions=positions,
        quaternions=np.tile([1.0, 0, 0, 0], (frames, 6, 1)),
        fps=50,
        height=1.72,
        rig="mine",
        contact_names=["LeftFoot", "RightFoot"],
        contacts=np.arange(2 * frames).reshape(frames, 2) % 3 == 0,
    )


#: How a file of each kind is made, and its ending.
FILES: dict[str, tuple[Callable[[Path], None], str]] = {
    "bvh": (bvh_file, ".bvh"),
    "smplx": (smplx_file, ".npz"),
    "smplx-parts": (smplx_parts_file, ".npz"),
    "smpl": (smpl_file, ".npz"),
    "deepmimic": (deepmimic_file, ".txt"),
    "neutral": (neutral_file, ".npz"),
}
