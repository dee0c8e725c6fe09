"""C sources as a shared library, compiled once and kept in the user's cache.

The file is named after a hash of all that decides what it is (sources, compiler, flags, processor) and after a hash of
what is in it, so that a file that was damaged is not loaded but made again.  It appears by a rename, whole or not at
all: processes that compile at the same time do not see each other's.
"""

from __future__ import annotations

import hashlib
import os
import platform
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from gmr_traj.c_compiler import cache_folder, compiler, ours

#: No contraction of a product and a sum into one rounding: NumPy does not do that either.
FLAGS = ("-O3", "-march=native", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math", "-shared", "-fPIC")

#: A compiler that takes longer is given up [s].
PATIENCE = 60.0


def cached(name: str, sources: Sequence[Path]) -> Path | None:
    """The compiled library, made where it is not in the cache yet; None where it cannot be made or kept.

    Args:
        name: what the file's name begins with.
        sources: C files.
    """
    command, folder = compiler(), cache_folder()
    if command is None or folder is None:
        return None
    try:
        key = _key(command, sources)
        for found in sorted(folder.glob(f"{name}-{key}-*.so")):
            if ours(found) and found.name == f"{name}-{key}-{_digest(found.read_bytes())}.so":
                return found
            found.unlink(missing_ok=True)
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        with tempfile.TemporaryDirectory(dir=folder, prefix=".building-") as space:
            made = Path(space) / "library.so"
            line = [command, *FLAGS, "-o", str(made), *map(str, sources), "-lm"]
            run = subprocess.run(line, capture_output=True, timeout=PATIENCE, stdin=subprocess.DEVNULL, check=False)
            if run.returncode != 0 or not made.is_file():
                return None
            target = folder / f"{name}-{key}-{_digest(made.read_bytes())}.so"
            os.replace(made, target)
            return target
    except (OSError, subprocess.TimeoutExpired):
        return None  # no room, no rights, no compiler after all: the same numbers are to be had without


def _key(command: str, sources: Sequence[Path]) -> str:
    whole = hashlib.sha256()
    state = os.stat(command)
    about = (command, str(state.st_size), str(state.st_mtime_ns), *FLAGS, platform.machine(), _processor())
    for part in (*(text.encode() for text in about), *(source.read_bytes() for source in sources)):
        whole.update(hashlib.sha256(part).digest())
    return whole.hexdigest()[:16]


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]


def _processor() -> str:
    """What tells processors with different instructions apart: a home folder may be shared between machines."""
    information = Path("/proc/cpuinfo")
    if information.is_file():
        lines = information.read_text(errors="replace").splitlines()
        return "\n".join(sorted({line for line in lines if line.startswith(("model name", "flags", "Features"))}))
    return platform.processor()
