"""The output folder while a run works in it: locked, with a folder of its own for what is not finished."""

from __future__ import annotations

import fcntl
import os
import secrets
import shutil
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gmr_traj.batch.records import STATE
from gmr_traj.exceptions import BatchError

_LOCK = "lock"


@contextmanager
def locked(out: Path) -> Iterator[Path]:
    """Make the output folder, have it alone, and remove at the end what is not finished.

    The lock goes with the process, however that ends.  What a run that was killed has left behind is removed.

    Args:
        out: the folder; it is made where it does not exist.

    Yields:
        A new folder for unfinished work, in the same file system. Workers give up what they do when it is gone.

    Raises:
        BatchError: another batch is writing to the folder, or it cannot be made.
    """
    if out.exists() and not out.is_dir():
        raise BatchError(f"--out {out}: this is a file; name a folder")
    state = out / STATE
    try:
        state.mkdir(parents=True, exist_ok=True)
        handle = os.open(state / _LOCK, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise BatchError(f"--out {out}: cannot write there: {error.strerror}; name another folder") from error
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            owner = os.read(handle, 200).decode(errors="replace").strip()
            raise BatchError(
                f"--out {out}: another batch is writing there ({owner}); wait for it, or name another folder"
            ) from None
        os.ftruncate(handle, 0)
        os.write(handle, f"process {os.getpid()} on {socket.gethostname()}\n".encode())
        for stale in state.iterdir():
            if stale.is_dir():
                shutil.rmtree(stale)
        run = state / f"run-{secrets.token_hex(6)}"
        run.mkdir()
        try:
            yield run
        finally:
            remove(run)
    finally:
        os.close(handle)


def remove(run: Path) -> None:
    """Remove a run's folder, which voids the orders that are still being carried out."""
    # Renamed first: workers that look for it stop at once, and make nothing in it while it is being emptied.
    gone = run.with_name(f"{run.name}.gone")
    try:
        run.rename(gone)
    except FileNotFoundError:
        return
    shutil.rmtree(gone, ignore_errors=True)  # a worker that has just seen it may be writing; the next run removes it
