"""DeepMimic's motion clips: JSON with ``Loop`` and ``Frames``.

A frame is a row of 44 numbers: how long it lasts [s], the root's position [m] and quaternion (wxyz), then local joint
rotations: wxyz for spherical joints, one angle [rad] about z for hinges.  x is to the front, y up, z to the right.
The clip holds no skeleton: ``configs/deepmimic_skeleton.toml`` has the one that its figures are made for.
"""

from __future__ import annotations

import json
import re
import tomllib
from functools import cache
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from gmr_traj import resources
from gmr_traj.exceptions import ClipError, ResourceError
from gmr_traj.formats.human.frame_rate import check_rate
from gmr_traj.formats.human.kinematics import world_placements
from gmr_traj.formats.human.raw import RawHuman
from gmr_traj.formats.raw import table
from gmr_traj.formats.size_limit import check_size
from gmr_traj.toml_table import Table

HINGES = ("right_knee", "right_elbow", "left_knee", "left_elbow")
#: Joints in the order of the columns behind the root's.
COLUMNS = (
    "chest", "neck", "right_hip", "right_knee", "right_ankle", "right_shoulder", "right_elbow",
    "left_hip", "left_knee", "left_ankle", "left_shoulder", "left_elbow",
)  # fmt: skip
_WIDTH = 8 + sum(1 if name in HINGES else 4 for name in COLUMNS)
_LENGTHS = (0.5, 1.5)  # published clips have quaternions of length 0.85 to 1.12, interpolated component by component
_SHORTEST, _LONGEST = 1e-4, 10.0  # [s] that a frame may last


def claims(start: bytes) -> bool:
    """Whether a file that starts so is a DeepMimic clip."""
    return re.match(rb'(\xef\xbb\xbf)?\s*\{\s*"(Loop|Frames|RightJoints|LeftJoints)"\s*:', start) is not None


def read(data: bytes, fps: float | None = None, cycles: int = 1) -> RawHuman:
    """A clip at a constant frame rate.

    Frames last as long as each says; positions and hinge angles are interpolated linearly, rotations by slerp, at the
    times ``k / fps`` from the first frame to the last.  What the last frame lasts is not used.

    Args:
        data: content of the file.
        fps: frame rate to resample to [Hz]; None for the whole number nearest to the clip's own, by its median frame.
        cycles: how often to play it.  A clip whose ``Loop`` is ``wrap`` is meant to be played in cycles: each starts
            where the last one ended, that is, the root's horizontal displacement accumulates.

    Raises:
        ClipError: it is not such a clip, or is not meant to be cycled and ``cycles`` is more than one.
    """
    frames, loop, notes = _parse(data)
    if cycles > 1 and loop != "wrap":
        raise ClipError(f"the clip is not a cycle (Loop is {loop!r}); it can be played once only")
    lasts = frames[:-1, 0]
    own = float(np.median(lasts))
    rate = float(max(1, round(1.0 / own))) if fps is None else fps
    check_rate(rate)
    check_size(int(cycles * lasts.sum() * rate + 1) * len(COLUMNS) * 400, "the clip at this frame rate")
    times, rows = _played(frames, cycles)
    names, parents, offsets = _skeleton()
    target = np.arange(0.0, times[-1] + 1e-9, 1.0 / rate)
    rotations = np.zeros((len(target), len(names), 4))
    rotations[..., 0] = 1.0
    rotations[:, 0] = _slerp(times, rows[:, 4:8], target)
    column = 8
    for name in COLUMNS:
        width = 1 if name in HINGES else 4
        value, column = rows[:, column : column + width], column + width
        if width == 1:
            half = np.interp(target, times, value[:, 0]) / 2
            local = np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=1)
        else:
            local = _slerp(times, value, target)
        rotations[:, names.index(name)] = local
    translations = np.repeat(offsets[None], len(target), axis=0)
    translations[:, 0] = np.column_stack([np.interp(target, times, axis) for axis in rows[:, 1:4].T])
    positions, quaternions = world_placements(parents, translations, rotations)
    even = np.ptp(lasts) < 1e-3 * own and abs(rate * own - 1) < 1e-3
    every = f"{lasts.min():.4g} to {lasts.max():.4g}" if np.ptp(lasts) > 1e-3 * own else f"{own:.4g}"
    notes.append(f"{len(frames)} frames every {every} s" + ("" if even else f", resampled to {rate:g} frames/s"))
    return RawHuman(names, parents, positions, quaternions, rate, rig="deepmimic", unit="m", up="y", notes=tuple(notes))


def _parse(data: bytes) -> tuple[np.ndarray, Any, list[str]]:
    """The rows, their quaternions of unit length, ``Loop``, and what is to be said about the quaternions."""
    try:
        content = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise ClipError(f"not readable as JSON, the file may be cut: {error}") from error
    if not isinstance(content, dict) or not isinstance(content.get("Frames"), list):
        raise ClipError('the JSON has no list "Frames"; expected a DeepMimic clip')
    rows = content["Frames"]
    for k, row in enumerate(rows):
        if not isinstance(row, list) or len(row) != _WIDTH:
            size = f"{len(row)} values" if isinstance(row, list) else f"{row!r:.40}"
            raise ClipError(f"frame {k} has {size}; expected {_WIDTH}: duration, root, joints of the humanoid")
    if len(rows) < 2:
        raise ClipError(f"the clip has {len(rows)} frames; expected two or more")
    frames = table(rows, "Frames", _WIDTH)
    lasts = frames[:-1, 0]
    bad = np.flatnonzero(~((lasts >= _SHORTEST) & (lasts <= _LONGEST)))
    if bad.size:
        raise ClipError(f"frame {bad[0]} lasts {lasts[bad[0]]:g} s; expected {_SHORTEST:g} to {_LONGEST:g}")
    column, rough = 4, []
    for name in ("root", *COLUMNS):
        if name in HINGES:
            column += 1
            continue
        lengths = np.linalg.norm(frames[:, column : column + 4], axis=1)
        bad = np.flatnonzero(~((lengths > _LENGTHS[0]) & (lengths < _LENGTHS[1])))
        if bad.size:
            raise ClipError(f"frame {bad[0]}: the quaternion of {name} has length {lengths[bad[0]]:.4f}, not 1")
        if (np.abs(lengths - 1.0) > 1e-2).any():
            rough.append(name)
        frames[:, column : column + 4] /= lengths[:, None]
        column += 4
    notes = [f"quaternions of {', '.join(rough)} scaled to unit length"] if rough else []
    return frames, content.get("Loop"), notes


def _played(frames: np.ndarray, cycles: int) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and rows of the clip played in cycles; the last frame of one is the first of the next."""
    times = np.concatenate([[0.0], np.cumsum(frames[:-1, 0])])
    stride = (frames[-1, 1:4] - frames[0, 1:4]) * [1, 0, 1]
    all_times, all_rows = [], []
    for cycle in range(cycles):
        stop = None if cycle == cycles - 1 else -1
        rows = frames[:stop].copy()
        rows[:, 1:4] += cycle * stride
        all_times.append((times + cycle * times[-1])[:stop])
        all_rows.append(rows)
    return np.concatenate(all_times), np.concatenate(all_rows)


def _slerp(times: np.ndarray, quaternions: np.ndarray, target: np.ndarray) -> np.ndarray:
    turned = Slerp(times, Rotation.from_quat(quaternions, scalar_first=True))(np.minimum(target, times[-1]))
    found: np.ndarray = turned.as_quat(scalar_first=True)
    return found


@cache
def _skeleton() -> tuple[tuple[str, ...], tuple[int, ...], np.ndarray]:
    """Names, parents and offsets [m] of all joints, the root first."""
    path = resources.find("configs", "deepmimic_skeleton")
    top = Table(path, "", tomllib.loads(path.read_text(encoding="utf-8")), ResourceError)
    names, parents, offsets = ["root"], [-1], [np.zeros(3)]
    for bone in top.tables("bone"):
        parent = bone.text("parent")
        if parent not in names:
            raise bone.error(f"has the parent {parent!r}, which no earlier bone is")
        names.append(bone.text("joint"))
        parents.append(names.index(parent))
        offsets.append(bone.point("offset"))
    return tuple(names), tuple(parents), np.array(offsets)
