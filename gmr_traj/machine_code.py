"""CasADi functions as machine code, where there is a C compiler: the same results in a tenth of the time.

CasADi's virtual machine takes 3 to 4 ns for a number of a function that is evaluated once at a time; the same list of
operations as C takes a tenth.  Results are the same bit for bit: the same operations in the same order, none of them
contracted, with the same mathematical library.

A function is compiled once.  Its library lies in the user's cache folder (``$XDG_CACHE_HOME/gmr-traj/functions``, or
``~/.cache``) under the hash of all that it is made from, so it cannot be out of date, and the folder may be deleted at
any time.  The compiler, ``$GMR_TRAJ_CC`` or the system's ``cc``, works in the background on its own: nobody waits for
it, and until it is done, or where there is none or ``GMR_TRAJ_CC=none`` is set, the virtual machine does the work.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shlex
import subprocess
import time
from functools import lru_cache
from pathlib import Path

import casadi as ca
import numpy as np

from gmr_traj.c_compiler import cache_folder, compiler, ours

# No contraction of a product and a sum into one operation, which would round once instead of twice.
_OPTIONS = ("-O1", "-fPIC", "-shared", "-ffp-contract=off", "-w")
_NAME = "gmr_traj_function"
_GIVEN_UP = 600.0  # a compiler that has not come back after so long was killed [s]


def compiled(function: ca.Function) -> ca.Function:
    """The function as machine code if its library is there; itself otherwise, and its library will be there some day.

    Args:
        function: of numbers, all outputs dense.
    """
    command, folder = compiler(), _folder()
    if command is None or folder is None:
        return function
    stem = folder / _hash(function, command)
    library = stem.with_suffix(".so")
    if not os.path.exists(library):  # also False where the folder cannot be looked into
        _start(function, command, stem)
        return function
    try:
        made = _loaded(str(library)) if ours(library) else None
    except (RuntimeError, OSError):
        # Made on another machine that shares the folder, and which has newer libraries than this; or deleted just now.
        return function
    return made if made is not None and _agree(function, made) else function


@lru_cache(maxsize=64)
def _loaded(library: str) -> ca.Function:
    return ca.external(_NAME, library)


@lru_cache(maxsize=64)
def _agree(function: ca.Function, made: ca.Function) -> bool:
    """Whether two functions give the same, bit for bit, at one point."""
    rng = np.random.default_rng(0)
    point = [rng.normal(size=function.size_in(k)) for k in range(function.n_in())]
    return all(np.array_equal(a.full(), b.full()) for a, b in zip(function.call(point), made.call(point), strict=True))


def wait(seconds: float = 300.0) -> None:
    """Until the compilers that work in the background are done; no longer than so many seconds."""
    folder, until = _folder(), time.monotonic() + seconds
    if compiler() is None or folder is None:
        return
    while time.monotonic() < until and any(map(_in_work, folder.glob("*.lock"))):
        time.sleep(0.05)


def _folder() -> Path | None:
    """Where the libraries are; None for a user without a home."""
    base = cache_folder()
    return None if base is None else base / "functions"


@lru_cache(maxsize=64)
def _hash(function: ca.Function, command: str) -> str:
    """Of the operations and of what makes a library from them."""
    made_by = (command, *_OPTIONS, platform.machine(), platform.system(), ca.CasadiMeta.version())
    return hashlib.sha256("\0".join((function.serialize(), *made_by)).encode()).hexdigest()[:32]


def _start(function: ca.Function, command: str, stem: Path) -> None:
    """Compile in the background; do nothing where another process does, or where the folder cannot be written."""
    code, lock, failed = stem.with_suffix(".c"), stem.with_suffix(".lock"), stem.with_suffix(".failed")
    try:
        stem.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        if failed.exists() or _in_work(lock):
            return
        lock.unlink(missing_ok=True)
        lock.touch(exist_ok=False)
    except OSError:  # not ours to write, or another process was faster
        return
    made, said = stem.with_suffix(f".{os.getpid()}.tmp"), stem.with_suffix(f".{os.getpid()}.said")
    line = shlex.join([command, *_OPTIONS, "-x", "c", str(code), "-o", str(made), "-lm"])
    library, names = stem.with_suffix(".so"), [shlex.quote(str(path)) for path in (code, made, said, lock)]
    # What the compiler says against the code stays in a file, whose being there says not to try again.
    script = (
        f"umask 077; if nice {line} 2>{names[2]}; then mv {names[1]} {shlex.quote(str(library))}; "
        f"else mv {names[2]} {shlex.quote(str(failed))}; fi; rm -f {' '.join(names)}"
    )
    try:
        code.write_text(_as_c(function), encoding="ascii")
        # Twice removed, so that it belongs to no command of ours and goes on when that ends.
        quiet = f"({script}) </dev/null >/dev/null 2>&1 &"
        subprocess.run(["/bin/sh", "-c", quiet], start_new_session=True, check=False)
    except OSError:  # the disk is full, or no process can be started
        code.unlink(missing_ok=True)
        lock.unlink(missing_ok=True)


def _in_work(lock: Path) -> bool:
    """Whether some compiler is at work on what a lock belongs to."""
    try:
        return time.time() - lock.stat().st_mtime < _GIVEN_UP
    except OSError:
        return False


def _as_c(function: ca.Function) -> str:
    generator = ca.CodeGenerator(_NAME)
    arguments = [ca.MX.sym(f"i{k}", function.sparsity_in(k)) for k in range(function.n_in())]
    generator.add(ca.Function(_NAME, arguments, function.call(arguments)))
    text: str = generator.dump()
    return text
