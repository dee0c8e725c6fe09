"""What a worker of the cluster does with one order."""

from __future__ import annotations

import os
import secrets
import shutil
import socket
from dataclasses import replace
from pathlib import Path

from gmr_traj.batch.confined import run_confined
from gmr_traj.batch.work import Ended, Order

_WHY = "ended.txt"


def carry_out(order: Order) -> Ended:
    """Carry out one order, again where its process crashes.

    Every attempt has a folder in the run's, which the next one finds wherever it is made: a clip whose worker dies is
    given to another worker by the scheduler, and is counted all the same.

    Returns:
        How it ended; the files are in its folder.
    """
    ended = Ended(order.name, worker=f"{socket.gethostname()}:{os.getpid()}")
    while True:
        if not order.run.is_dir():
            return replace(ended, void=True)
        before = sorted(order.run.glob(f"{order.index}.*"))
        attempts = len(before)
        ended = replace(ended, attempts=attempts)
        if attempts > order.limits.retries:
            return replace(ended, failed=f"given up after {attempts} attempts: {_last_words(before)}")
        folder = order.run / f"{order.index}.{attempts}.{secrets.token_hex(4)}"
        folder.mkdir()
        watched = run_confined(order.work, folder, order.limits)
        ended = replace(ended, attempts=attempts + 1, seconds=watched.seconds, peak=watched.peak)
        if watched.how == "finished":
            return replace(ended, folder=folder)
        if watched.how == "killed":
            return replace(ended, failed=watched.why)
        if watched.how == "void":
            shutil.rmtree(folder, ignore_errors=True)  # it may have been made after the run's folder was removed
        elif order.run.is_dir():
            (folder / _WHY).write_text(watched.why, encoding="utf-8")


def _last_words(folders: list[Path]) -> str:
    """Why the last attempt ended that left a word; where none did, their workers were killed."""
    for folder in reversed(folders):
        try:
            return (folder / _WHY).read_text(encoding="utf-8")
        except FileNotFoundError:
            continue
    return "each time its worker died with it"
