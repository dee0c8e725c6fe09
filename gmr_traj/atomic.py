"""Files that are either written whole or not at all."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from gmr_traj.exceptions import GmrTrajError


@contextmanager
def write(path: str | Path) -> Iterator[BinaryIO]:
    """Open a file that appears under its name only when the block ends without an exception.

    The bytes go to a temporary file in the same folder, which is flushed to the disk and then renamed; a rename
    within a folder is atomic, so a reader sees the old file or the new one and never half of it.  Any exception,
    ``KeyboardInterrupt`` too, removes the temporary file and leaves the target as it was.  A symbolic link is
    followed: the file it points to is replaced.

    Args:
        path: the file to write; its folder must exist.

    Raises:
        GmrTrajError: the folder does not exist, is not writable, or ``path`` is a folder.
    """
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise GmrTrajError(f"{path}: cannot write, it is a folder; name a file in it")
    temporary = target.parent / f".{target.name}.{secrets.token_hex(6)}.tmp"
    try:
        stream = temporary.open("xb")
    except OSError as error:
        reason = error.strerror or error
        raise GmrTrajError(f"{path}: cannot write: {reason}; name a file in an existing folder") from error
    try:
        with stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(temporary, target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    _sync_folder(target.parent)


def _sync_folder(folder: Path) -> None:
    """Make the rename itself survive a power cut, which needs the folder flushed as well."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
