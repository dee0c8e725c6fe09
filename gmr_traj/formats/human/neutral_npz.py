"""gmr-traj's own npz of a human motion: for motions of any source, once they are placements of named joints.

| key | shape | meaning |
|---|---|---|
| ``joint_names`` | (J,) text | names of the joints, the root first |
| ``joint_parents`` | (J,) whole numbers, optional | index of each joint's parent, -1 for none, parents first |
| ``positions`` | (T, J, 3) | joint positions in the world [m], Z up |
| ``quaternions`` | (T, J, 4) | joint orientations in the world, wxyz |
| ``fps`` | one number | frames per second [Hz] |
| ``height`` | one number, optional | how tall the person is [m] |
| ``rig`` | text, optional | name of the rig; by the joints' names where it is missing |
| ``contact_names`` | (C,) text, optional | joints that may touch the floor |
| ``contacts`` | (T, C) true or false, optional | whether they do; detected where it is missing |
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from gmr_traj import atomic
from gmr_traj.exceptions import ClipError
from gmr_traj.formats import npz_file
from gmr_traj.formats.human.raw import RawHuman
from gmr_traj.formats.raw import names, number, table
from gmr_traj.formats.size_limit import check_size
from gmr_traj.human_motion import HumanMotion

_REQUIRED = ("joint_names", "positions", "quaternions", "fps")
KEYS = (*_REQUIRED, "joint_parents", "height", "rig", "contact_names", "contacts")
_LENGTHS = (0.9, 1.1)  # lengths of quaternions that were interpolated component by component


def claims(keys: Iterable[str]) -> bool:
    """Whether an npz file with these entries is such a motion."""
    return {"joint_names", "positions"} <= set(keys)


def read(content: Mapping[str, np.ndarray]) -> RawHuman:
    """What the file says.

    Raises:
        ClipError: an entry is missing, or has another shape or type.
    """
    missing = [key for key in _REQUIRED if key not in content]
    if missing:
        raise ClipError(f"the file has no {missing[0]}; a human motion needs {', '.join(_REQUIRED)}")
    joints = names(content["joint_names"], "joint_names")
    if not joints:
        raise ClipError("joint_names is empty; expected the names of the joints")
    positions = table(content["positions"], "positions", len(joints), 3)
    quaternions = table(content["quaternions"], "quaternions", len(joints), 4)
    if len(positions) != len(quaternions) or not len(positions):
        raise ClipError(f"{len(positions)} frames of positions and {len(quaternions)} of quaternions; expected as many")
    lengths = np.linalg.norm(quaternions, axis=2, keepdims=True)
    off = np.argwhere((lengths[..., 0] < _LENGTHS[0]) | (lengths[..., 0] > _LENGTHS[1]))
    if off.size:
        t, j = off[0]
        raise ClipError(f"frame {t}: the quaternion of {joints[j]!r} has length {lengths[t, j, 0]:.4f}, not 1")
    return RawHuman(
        joints,
        _parents(content, len(joints)),
        positions,
        quaternions / lengths,
        number(content["fps"], "fps"),
        rig=_rig(content),
        unit="m",
        up="z",
        height=number(content["height"], "height") if "height" in content else None,
        contacts=_contacts(content, joints, len(positions)),
    )


def write_human_npz(human: HumanMotion, path: str | Path) -> None:
    """Write a human motion, whole or not at all, the same motion to the same bytes.

    Raises:
        GmrTrajError: the file cannot be written.
    """
    content = {
        "joint_names": np.array(human.names),
        "joint_parents": np.array(human.parents),
        "positions": human.positions,
        "quaternions": human.quaternions,
        "fps": human.fps,
        "height": human.height,
        "rig": np.array(human.rig),
    }
    if human.contacts:
        content["contact_names"] = np.array(list(human.contacts))
        content["contacts"] = np.stack(list(human.contacts.values()), axis=1)
    check_size(human.positions.nbytes + human.quaternions.nbytes, "the motion")
    with atomic.write(path) as stream:
        npz_file.save(stream, content)


def _parents(content: Mapping[str, np.ndarray], joints: int) -> tuple[int, ...]:
    if "joint_parents" not in content:
        return (-1,) * joints
    value = content["joint_parents"]
    if value.shape != (joints,) or value.dtype.kind not in "iu":
        raise ClipError(f"joint_parents is {value.dtype} of shape {value.shape}; expected {joints} whole numbers")
    parents = tuple(int(k) for k in value)
    wrong = [k for k, parent in enumerate(parents) if not -1 <= parent < k]
    if wrong:
        raise ClipError(f"joint_parents[{wrong[0]}] is {parents[wrong[0]]}; expected -1 or an earlier joint's index")
    return parents


def _rig(content: Mapping[str, np.ndarray]) -> str | None:
    value = content.get("rig")
    if value is None:
        return None
    if value.ndim or value.dtype.kind != "U" or not str(value):
        raise ClipError("rig is not text; expected the name of a rig")
    return str(value)


def _contacts(content: Mapping[str, np.ndarray], joints: tuple[str, ...], frames: int) -> dict[str, np.ndarray]:
    if "contacts" not in content and "contact_names" not in content:
        return {}
    if "contacts" not in content or "contact_names" not in content:
        raise ClipError("contacts and contact_names belong together; one of them is missing")
    touching = names(content["contact_names"], "contact_names")
    value = content["contacts"]
    if value.shape != (frames, len(touching)) or value.dtype.kind not in "biuf":
        raise ClipError(f"contacts has shape {value.shape}; expected {(frames, len(touching))}, true or false")
    strange = [name for name in touching if name not in joints]
    if strange:
        raise ClipError(f"contact_names has {strange[0]!r}, which is no joint of the motion")
    if not np.isin(value, (0, 1)).all():
        raise ClipError("contacts has values other than true and false")
    return {name: value[:, k].astype(bool) for k, name in enumerate(touching)}
