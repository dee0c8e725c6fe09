"""Motions of SMPL, SMPL-H and SMPL-X as npz: AMASS and what follows its keys.

``poses`` (T, 72, 156 or 165), or the parts ``root_orient`` (T, 3), ``pose_body`` (T, 63 or 69) and, where there are,
``pose_jaw``, ``pose_eye``, ``pose_hand``; ``trans`` (T, 3); ``betas``; ``mocap_frame_rate`` or ``mocap_framerate``;
``surface_model_type``.  Axis-angle in radians, metres, Z up.  ``gender`` is not looked at: it is the body model's.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.exceptions import ClipError
from gmr_traj.formats.human import smpl_joints
from gmr_traj.formats.human.body_model import BodyModel
from gmr_traj.formats.human.kinematics import world_placements
from gmr_traj.formats.human.mean_skeleton import mean_joints, stature
from gmr_traj.formats.human.raw import RawHuman
from gmr_traj.formats.raw import number, table

_TRANSLATION = ("trans", "transl")
_ROOT = ("root_orient", "global_orient")
_POSE = ("pose_body", "body_pose")
_RATE = ("mocap_frame_rate", "mocap_framerate", "fps", "frame_rate")
#: Entries that are read; AMASS files have others, some of which only Python can read.
KEYS = (
    *("poses", *_TRANSLATION, *_ROOT, *_POSE, "pose_jaw", "pose_eye", "pose_hand"),
    *("betas", "surface_model_type", *_RATE),
)
_WIDTHS = {72: "smpl", 156: "smplh", 165: "smplx"}
_NAMES = {"smpl": "SMPL", "smplh": "SMPL-H", "smplx": "SMPL-X"}
_MOST_BETAS = 400


def claims(keys: Iterable[str]) -> bool:
    """Whether an npz file with these entries is a SMPL motion."""
    return bool({"poses", *_POSE} & set(keys))


def read(content: Mapping[str, np.ndarray], body: BodyModel | None) -> RawHuman:
    """What a SMPL motion says.

    The pelvis is at its place in the T-pose plus ``trans``; the other joints follow by their axis-angle rotations.
    Without a body model that place is not known (some centimetres up and some tenths of a metre to the side, the same
    in all frames); the origin is taken for it.

    Args:
        content: entries of the file.
        body: the model that has the exact skeleton; None for a person's mean proportions, as tall as
            ``betas[0]`` says, without fingers, jaw and eyes.

    Raises:
        ClipError: an entry is missing, has another width or length, or contradicts another or the body model.
    """
    model, pose = _pose(content, body)
    translation = table(_first(content, _TRANSLATION, "the position of the person"), "trans", 3)
    if len(translation) != len(pose):
        raise ClipError(f"{len(pose)} frames of poses and {len(translation)} of trans; expected as many of both")
    if not len(pose):
        raise ClipError("the motion has no frames")
    betas, notes = _betas(content)
    height = stature(betas)
    if body is not None:
        offsets = body.joints(betas)
        notes.append(
            f"skeleton of the body model ({_NAMES[body.model]}, {min(len(betas), body.directions.shape[2])} betas); "
            f"its mesh is {body.height(betas):.3f} m tall"
        )
    else:
        offsets = mean_joints(model, betas)
        notes.append(
            f"skeleton: {len(offsets)} joints at a person's mean proportions, as tall as betas[0] says, the pelvis at "
            "trans; give the model's file (--body-model) for the exact one"
        )
    notes.append(f"height {height:.3f} m by 1.66 + 0.1 betas[0], as GMR takes it")
    joints = len(offsets)
    rotations = np.zeros((len(pose), joints, 4))
    rotations[..., 0] = 1.0
    turned = min(pose.shape[1] // 3, joints)
    vectors = pose[:, : 3 * turned].reshape(-1, 3)
    rotations[:, :turned] = Rotation.from_rotvec(vectors).as_quat(scalar_first=True).reshape(-1, turned, 4)
    translations = np.repeat(offsets[None], len(pose), axis=0)
    translations[:, 0] += translation
    parents = smpl_joints.parents(model)[:joints]
    positions, quaternions = world_placements(parents, translations, rotations)
    rate = next((number(content[key], key) for key in _RATE if key in content), None)
    return RawHuman(
        smpl_joints.JOINTS[model][:joints],
        parents,
        positions,
        quaternions,
        rate,
        rig="smpl" if model == "smpl" else "smplx",
        unit="m",
        usual_up="z",
        height=height,
        notes=tuple(notes),
    )


def _pose(content: Mapping[str, np.ndarray], body: BodyModel | None) -> tuple[str, np.ndarray]:
    """The model, and the axis-angle vectors of its joints as far as the file has them.  # (T, 3 J)"""
    claimed = _claimed(content)
    if "poses" in content:
        pose = table(content["poses"], "poses", None)
    else:
        parts = [table(_first(content, _ROOT, "the orientation of the root"), "root_orient", 3)]
        parts.append(table(_first(content, _POSE, "the pose of the body"), "pose_body", None))
        face = [key for key in ("pose_jaw", "pose_eye") if key in content]
        if "pose_hand" in content and parts[1].shape[1] == 63:
            if face:
                parts += [table(content[key], key, 3 if key == "pose_jaw" else 6) for key in face]
            elif claimed == "smplx":
                parts.append(np.zeros((len(parts[1]), 9)))
            parts.append(table(content["pose_hand"], "pose_hand", 90))
        if len({len(part) for part in parts}) > 1:
            raise ClipError(f"the parts of the pose have {' and '.join(str(len(p)) for p in parts)} frames")
        pose = np.hstack(parts)
    width = pose.shape[1]
    if width == 3 * smpl_joints.BODY:
        model = claimed or (body.model if body is not None else "smplx")
    elif width in _WIDTHS:
        model = _WIDTHS[width]
    else:
        raise ClipError(f"the poses are {width} wide; expected 72 (SMPL), 156 (SMPL-H), 165 (SMPL-X) or 66 (body only)")
    if claimed not in (None, model):
        raise ClipError(
            f"surface_model_type says {_NAMES[claimed]}, but the poses are {width} wide as of {_NAMES[model]}"
        )
    if body is not None and body.model != model:
        raise ClipError(
            f"the motion is of {_NAMES[model]} and the body model is {_NAMES[body.model]}; give one of its kind"
        )
    return model, pose


def _claimed(content: Mapping[str, np.ndarray]) -> str | None:
    """The model the file names, None where it names none."""
    if "surface_model_type" not in content:
        return None
    value = content["surface_model_type"]
    text = value.reshape(-1)[0] if value.dtype.kind in "US" and value.size == 1 else value
    name = (text.decode("latin-1") if isinstance(text, bytes) else str(text)).strip().lower()
    kind = next((model for model in ("smplx", "smplh", "smpl") if name.startswith(model)), None)
    if kind is None:
        raise ClipError(f"surface_model_type is {name[:40]!r}; smpl, smplh and smplx are read")
    return kind


def _betas(content: Mapping[str, np.ndarray]) -> tuple[np.ndarray, list[str]]:
    if "betas" not in content:
        return np.zeros(0), ["no betas: the mean shape"]
    value = content["betas"]
    rows = table(np.atleast_2d(value), "betas", None) if value.ndim <= 2 else None
    if rows is None or not 1 <= rows.shape[1] <= _MOST_BETAS or not len(rows):
        raise ClipError(f"betas has shape {value.shape}; expected one shape of up to {_MOST_BETAS} numbers")
    if not (np.abs(rows) < 100).all():
        raise ClipError("betas has values of 100 and more; a shape's are within 10 or so")
    if not (rows == rows[0]).all():
        return rows[0], ["betas change from frame to frame; the first frame's are taken"]
    return rows[0], []


def _first(content: Mapping[str, np.ndarray], keys: tuple[str, ...], what: str) -> np.ndarray:
    """The entry under the first key that is there."""
    for key in keys:
        if key in content:
            return content[key]
    raise ClipError(f"the file has no {' or '.join(keys)} ({what}); expected the keys of AMASS")
