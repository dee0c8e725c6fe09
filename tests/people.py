"""A person made of a few joints, who walks on a straight line: for the tests of retargeting methods."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.human_motion import HumanMotion

# LAFAN1's joints; offsets of the joints from their parents when standing with hanging arms, facing x, z up [m].
_OFFSETS: dict[str, tuple[str | None, tuple[float, float, float]]] = {
    "Hips": (None, (0.0, 0.0, 0.93)),
    "LeftUpLeg": ("Hips", (0.0, 0.1, 0.0)),
    "LeftLeg": ("LeftUpLeg", (0.0, 0.0, -0.43)),
    "LeftFoot": ("LeftLeg", (0.0, 0.0, -0.42)),
    "LeftToe": ("LeftFoot", (0.15, 0.0, -0.06)),
    "RightUpLeg": ("Hips", (0.0, -0.1, 0.0)),
    "RightLeg": ("RightUpLeg", (0.0, 0.0, -0.43)),
    "RightFoot": ("RightLeg", (0.0, 0.0, -0.42)),
    "RightToe": ("RightFoot", (0.15, 0.0, -0.06)),
    "Spine": ("Hips", (0.0, 0.0, 0.1)),
    "Spine1": ("Spine", (0.0, 0.0, 0.12)),
    "Spine2": ("Spine1", (0.0, 0.0, 0.12)),
    "Neck": ("Spine2", (0.0, 0.0, 0.2)),
    "Head": ("Neck", (0.0, 0.0, 0.12)),
    "LeftShoulder": ("Spine2", (0.0, 0.05, 0.15)),
    "LeftArm": ("LeftShoulder", (0.0, 0.12, 0.0)),
    "LeftForeArm": ("LeftArm", (0.0, 0.05, -0.29)),
    "LeftHand": ("LeftForeArm", (0.05, 0.0, -0.25)),
    "RightShoulder": ("Spine2", (0.0, -0.05, 0.15)),
    "RightArm": ("RightShoulder", (0.0, -0.12, 0.0)),
    "RightForeArm": ("RightArm", (0.0, -0.05, -0.29)),
    "RightHand": ("RightForeArm", (0.05, 0.0, -0.25)),
}
_STRIDE, _PERIOD = 0.35, 1.0  # amplitude of the thighs [rad], time of two steps [s]
SPEED = 0.8  # [m/s]


def walker(frames: int = 60, fps: float = 30.0, heading: float = 0.0, speed: float = SPEED) -> HumanMotion:
    """A person who walks along ``heading`` [rad], arms and legs swinging, the feet not quite at rest.

    All joint frames are the heading turned about the vertical: a person of whom orientations say little.
    """
    names = tuple(_OFFSETS)
    parents = tuple(-1 if above is None else names.index(above) for above, _ in _OFFSETS.values())
    time = np.arange(frames) / fps
    swing = _STRIDE * np.sin(2.0 * np.pi * time / _PERIOD)
    bend = {  # [rad] about the person's left, of each joint's offset
        "LeftLeg": -swing,
        "RightLeg": swing,
        "LeftFoot": -swing + 0.25 + 0.2 * np.cos(2.0 * np.pi * time / _PERIOD),
        "RightFoot": swing + 0.25 - 0.2 * np.cos(2.0 * np.pi * time / _PERIOD),
        "LeftForeArm": swing,
        "RightForeArm": -swing,
    }
    bend["LeftHand"], bend["RightHand"] = bend["LeftForeArm"] - 0.3, bend["RightForeArm"] - 0.3
    positions = np.zeros((frames, len(names), 3))
    for j, (name, (_, offset)) in enumerate(_OFFSETS.items()):
        turn = Rotation.from_euler("y", bend.get(name, np.zeros(frames))[:, None])
        if parents[j] < 0:
            positions[:, j] = np.array(offset) + np.outer(speed * time, [1.0, 0.0, 0.0])
        else:
            positions[:, j] = positions[:, parents[j]] + turn.apply(np.array(offset))
    turn = Rotation.from_euler("z", heading)
    quaternions = np.tile(turn.as_quat(scalar_first=True), (frames, len(names), 1))
    feet = ("LeftFoot", "RightFoot", "LeftToe", "RightToe")
    contacts = {name: np.sin(2.0 * np.pi * time / _PERIOD) * (1 if "Left" in name else -1) > -0.1 for name in feet}
    placed = turn.apply(positions.reshape(-1, 3)).reshape(positions.shape)
    return HumanMotion("lafan1", names, parents, placed, quaternions, fps, 1.7, contacts)
