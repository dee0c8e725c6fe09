"""Reading a human motion: the container by its first bytes, the format by what it holds, the rest by testing."""

from __future__ import annotations

import zipfile
from pathlib import Path

from gmr_traj.exceptions import ClipError, GmrTrajError
from gmr_traj.formats import npz_file
from gmr_traj.formats.file_bytes import read_bytes
from gmr_traj.formats.human import bvh, deepmimic, neutral_npz, smpl_npz
from gmr_traj.formats.human.body_model import load_body_model
from gmr_traj.formats.human.decide import decide
from gmr_traj.formats.human.raw import RawHuman
from gmr_traj.human_motion import HumanMotion

_START = 512  # bytes that are enough to tell a text format


def read_human(
    path: str | Path,
    *,
    fps: float | None = None,
    height: float | None = None,
    up: str | None = None,
    unit: str | None = None,
    body_model: str | Path | None = None,
    rig: str | None = None,
) -> HumanMotion:
    """Read a human motion: BVH, SMPL-X, SMPL-H or SMPL npz (AMASS), DeepMimic txt, or gmr-traj's neutral npz.

    Nothing is guessed silently: rig, unit, vertical axis, frame rate and height are fixed by the format or tested on
    the motion, ``HumanMotion.notes`` says what was decided and why, and a question that stays open is an error naming
    the option to set. No code in the file is run. Joint orientations are those of the file's own joint frames; a file
    with Y up is turned to Z up from the left.

    Args:
        path: the file.
        fps: frame rate [Hz] instead of the file's; a DeepMimic clip, whose frames last as long as each says, is
            resampled to it.
        height: how tall the person is [m], instead of what the skeleton says.
        up: vertical axis of the file (``y``, ``z``), whatever the tests say.
        unit: unit of length of the file (``m``, ``cm``, ``mm``, ``in``, ``cmu``), whatever the tests say.
        body_model: a SMPL family's model file (npz, pkl), for the exact skeleton of a SMPL motion.
        rig: name of the rig, whatever the names of the joints say.

    Raises:
        ClipError: the file cannot be read, is no human motion, or leaves a question open.
    """
    path = Path(path)
    try:
        raw = _read_raw(path, fps, body_model)
        return decide(raw, fps=fps, height=height, up=up, unit=unit, rig=rig)
    except GmrTrajError as error:
        raise type(error)(f"{path}: {error}") from error


def is_human(path: str | Path) -> bool:
    """Whether a file is a human motion, by its first bytes and the names of its fields; False if it cannot be opened.

    It does not say that the file is sound.
    """
    try:
        with Path(path).open("rb") as stream:
            start = stream.read(_START)
            if start.startswith(b"PK\x03\x04"):
                keys = [name.removesuffix(".npy") for name in zipfile.ZipFile(stream).namelist()]
                return neutral_npz.claims(keys) or smpl_npz.claims(keys)
    except (OSError, zipfile.BadZipFile, ValueError, NotImplementedError):
        return False
    return _is_bvh(start) or deepmimic.claims(start)


def _read_raw(path: Path, fps: float | None, body_model: str | Path | None) -> RawHuman:
    data = read_bytes(path)
    if data.startswith(b"PK\x03\x04"):
        keys = npz_file.names(data)
        if neutral_npz.claims(keys):
            content = npz_file.load(data, only=neutral_npz.KEYS)
            raw = neutral_npz.read(content)
        elif smpl_npz.claims(keys):
            content = npz_file.load(data, only=smpl_npz.KEYS)
            return smpl_npz.read(content, None if body_model is None else load_body_model(body_model))
        else:
            shown = f"{', '.join(keys[:8])}{', ...' if len(keys) > 8 else ''}"
            raise ClipError(f"no human motion: this npz holds {shown}; expected poses (SMPL) or positions")
    elif _is_bvh(data[:_START]):
        raw = bvh.read(data)
    elif deepmimic.claims(data[:_START]):
        raw = deepmimic.read(data, fps)
    elif data.startswith(b"\x80"):
        raise ClipError("a pickle, which is not read as a human motion; save it as npz (SMPL keys, or gmr-traj's own)")
    else:
        raise ClipError("no human motion that is known: neither BVH, DeepMimic's JSON, nor npz; convert it to BVH")
    if body_model is not None:
        raise ClipError("a body model is for SMPL motions, and this is none; leave --body-model out")
    return raw


def _is_bvh(start: bytes) -> bool:
    return start.removeprefix(b"\xef\xbb\xbf").lstrip()[:9].upper() == b"HIERARCHY"
