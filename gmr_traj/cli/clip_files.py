"""Clips and folders of clips on the command line."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from gmr_traj.exceptions import ClipError
from gmr_traj.formats.clip import CLIP_SUFFIXES


def clip_files(paths: list[Path]) -> Iterator[Path]:
    """The files given, and those with a clip's suffix in the folders given and their subfolders.

    Raises:
        ClipError: a path does not exist, or a folder has no clips.
    """
    for path in paths:
        if path.is_dir():
            clips = sorted(p for p in path.rglob("*") if p.is_file() and p.suffix.lower() in CLIP_SUFFIXES)
            if not clips:
                raise ClipError(
                    f"{path}: no clips in this folder; looked for {', '.join('*' + s for s in CLIP_SUFFIXES)}"
                )
            yield from clips
        elif path.exists():
            yield path
        else:
            raise ClipError(f"{path}: no such file or folder")
