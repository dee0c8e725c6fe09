"""The bytes of a motion file."""

from __future__ import annotations

from pathlib import Path

from gmr_traj.exceptions import ClipError
from gmr_traj.formats.size_limit import check_size


def read_bytes(path: Path) -> bytes:
    """Content of a file that is not larger than any clip.

    Raises:
        ClipError: it cannot be read, or is larger.
    """
    try:
        check_size(path.stat().st_size, "the file")
        return path.read_bytes()
    except OSError as error:
        raise ClipError(f"cannot read: {error.strerror or error}") from error
