"""The C compiler, where there is one, and where the user keeps what it makes."""

from __future__ import annotations

import os
import shutil
import stat
import sys
from pathlib import Path

#: Names the C compiler; ``none`` for none.
COMPILER = "GMR_TRAJ_CC"

# Tried in turn where the variable names none.
_COMPILERS = ("cc", "gcc", "clang")


def compiler() -> str | None:
    """The C compiler that is used, as a path; None for none."""
    given = os.environ.get(COMPILER)
    if given is not None:
        return None if given == "none" else shutil.which(given)
    return next(filter(None, map(shutil.which, _COMPILERS)), None)


def cache_folder() -> Path | None:
    """``$XDG_CACHE_HOME/gmr-traj``, or where the system has such things; None for a user without a home."""
    given = os.environ.get("XDG_CACHE_HOME", "")
    usual = "~/Library/Caches" if sys.platform == "darwin" else "~/.cache"
    base = Path(given if os.path.isabs(given) else os.path.expanduser(usual))  # which leaves an unknown ~
    return base / "gmr-traj" if base.is_absolute() else None


def ours(file: Path) -> bool:
    """Whether nobody else could have written a file.

    Raises:
        OSError: it is not there, or may not be looked at.
    """
    return all(
        found.st_uid in (os.getuid(), 0) and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
        for found in (file.stat(), file.parent.stat())
    )
