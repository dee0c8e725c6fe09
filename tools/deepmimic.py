"""DeepMimic motion clips: reading, forward kinematics, resampling.

A clip is JSON with `Loop` and `Frames`; a frame is a row of 44 numbers: duration [s], root position, root quaternion
(wxyz), then local joint rotations, wxyz for spherical joints and one angle for hinges.  The file's axes are x forward,
y up, z to the right; everything returned here is x forward, y left, z up.  Bone lengths come from `humanoid.urdf`,
which the same package ships and which is four times as large as life.
"""

from __future__ import annotations

import json
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

URDF_SCALE = 4.0
HINGES = ("right_knee", "right_elbow", "left_knee", "left_elbow")
COLUMNS = (
    "chest", "neck", "right_hip", "right_knee", "right_ankle", "right_shoulder", "right_elbow",
    "left_hip", "left_knee", "left_ankle", "left_shoulder", "left_elbow",
)  # fmt: skip
Z_UP = Rotation.from_matrix([[1, 0, 0], [0, 0, -1], [0, 1, 0]])  # (x, y, z) -> (x, -z, y)


@dataclass(frozen=True)
class HumanMotion:
    """World placements of a human's joints at a constant frame rate, z up.

    Attributes:
        names: joints; the first is the root.  # J
        positions: [m].  # (T, J, 3)
        quaternions: wxyz; identity for every joint when standing upright, facing x, arms hanging.  # (T, J, 4)
        fps: frame rate [Hz].
    """

    names: tuple[str, ...]
    positions: np.ndarray
    quaternions: np.ndarray
    fps: float


def read_bones(urdf: Path) -> dict[str, tuple[str, np.ndarray]]:
    """Parent and offset [m] of every joint below the root, parents first, in the file's y-up axes."""
    bones = {}
    for joint in ElementTree.fromstring(urdf.read_text().rstrip("\0")).iter("joint"):  # the file ends in a zero byte
        name, parent = joint.attrib["name"], joint.find("parent")
        origin = joint.find("origin")
        if parent is None or origin is None:
            raise ValueError(f"{urdf}: joint {name} has no parent or no origin")
        if parent.attrib["link"] != "base":
            offset = np.array([float(x) for x in origin.attrib["xyz"].split()]) / URDF_SCALE
            bones[name] = (parent.attrib["link"], offset)
    return bones


def read_clip(path: Path, bones: dict[str, tuple[str, np.ndarray]], fps: float, cycles: int = 1) -> HumanMotion:
    """Read a clip, play it ``cycles`` times, resample it to ``fps`` and run its forward kinematics.

    A clip whose `Loop` is `wrap` is meant to be played in cycles: each one starts where the last one ended, that is,
    the root's horizontal displacement accumulates.

    Raises:
        ValueError: if the clip is not meant to be cycled and ``cycles`` is more than one.
    """
    content = json.loads(path.read_text())
    frames = np.array(content["Frames"], dtype=float)  # (T, 44)
    if cycles > 1 and content["Loop"] != "wrap":
        raise ValueError(f"{path.name} is not a cycle (Loop is {content['Loop']!r})")
    span = frames[:-1, 0].sum()
    times = np.concatenate([[0.0], np.cumsum(frames[:-1, 0])])
    stride = (frames[-1, 1:4] - frames[0, 1:4]) * [1, 0, 1]
    sources = [(times + c * span)[: None if c == cycles - 1 else -1] for c in range(cycles)]
    rows = [(frames + np.pad(c * stride, (1, 40)))[: len(s)] for c, s in enumerate(sources)]
    times, frames = np.concatenate(sources), np.concatenate(rows)
    target = np.arange(0.0, times[-1] + 1e-9, 1.0 / fps)

    def slerp(quaternions: np.ndarray) -> Rotation:
        return Slerp(times, Rotation.from_quat(quaternions, scalar_first=True))(target)

    root = np.column_stack([np.interp(target, times, column) for column in frames[:, 1:4].T])
    local, column = {}, 8
    for name in COLUMNS:
        if name in HINGES:
            angle = np.interp(target, times, frames[:, column])
            local[name] = Rotation.from_rotvec(angle[:, None] * [0.0, 0.0, 1.0])
            column += 1
        else:
            local[name] = slerp(frames[:, column : column + 4])
            column += 4
    placements = {"root": (root, slerp(frames[:, 4:8]))}
    for name, (parent, offset) in bones.items():
        position, rotation = placements[parent]
        placements[name] = (position + rotation.apply(offset), rotation * local.get(name, Rotation.identity()))
    positions = np.stack([Z_UP.apply(p) for p, _ in placements.values()], axis=1)
    quaternions = np.stack([(Z_UP * r * Z_UP.inv()).as_quat(scalar_first=True) for _, r in placements.values()], axis=1)
    return HumanMotion(tuple(placements), positions, quaternions, fps)
