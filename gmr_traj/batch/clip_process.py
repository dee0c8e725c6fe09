"""The process of one clip: does the work, leaves `result.json`, and never returns.

It is forked from :mod:`~gmr_traj.batch.clip_server`, which watches it, so that all a clip takes can be ended at once.
"""

from __future__ import annotations

import json
import os
import traceback
from pathlib import Path
from typing import Any, NoReturn

from gmr_traj.batch.fingerprint import sha256, versions
from gmr_traj.batch.work import Work
from gmr_traj.exceptions import BatchError, GmrTrajError
from gmr_traj.interrupts import end_with

RESULT = "result.json"
LOG = "log.txt"
_NO_MEMORY = "it needs more memory than there is"


def clip_process(work: Work, folder: Path, parent: int) -> NoReturn:
    """Carry out the work in a process that was forked for it, and exit."""
    os.setpgid(0, 0)
    end_with(parent)
    _redirect(folder / LOG)
    content = _attempt(work, folder)
    staged = folder / f"{RESULT}.part"
    staged.write_text(json.dumps(content, allow_nan=False), encoding="utf-8")
    os.replace(staged, folder / RESULT)
    os._exit(0)


def _attempt(work: Work, folder: Path) -> dict[str, Any]:
    """The result, or why there is none."""
    digest: str | None = None
    content: dict[str, Any] = {}
    try:
        _check_versions(work)
        digest = sha256(work.path)
        result = work.carry_out(folder)
        outputs = {
            what: {"file": name, "sha256": sha256(folder / name), "bytes": (folder / name).stat().st_size}
            for what, name in result.outputs.items()
        }
        json.dumps(dict(result.content), allow_nan=False)
        return {"failed": result.failed, "sha256": digest, "outputs": outputs, "content": dict(result.content)}
    except MemoryError:
        failed = _NO_MEMORY
    except GmrTrajError as error:
        failed = str(error)
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        failed = f"{where}{error.strerror or error}"
    except Exception as error:
        failed = f"internal error: {type(error).__name__}: {error}"
        if "bad_alloc" in failed:
            failed = _NO_MEMORY
        content = {"traceback": traceback.format_exc().splitlines()}
    return {"failed": " ".join(failed.split()), "sha256": digest, "outputs": {}, "content": content}


def _check_versions(work: Work) -> None:
    here = versions()
    for name, wanted in work.versions.items():
        if here.get(name) != wanted:
            raise BatchError(
                f"this worker has {name} {here.get(name, 'not at all')}, the batch was begun with {wanted}; "
                "install the same versions everywhere"
            )


def _redirect(log: Path) -> None:
    """Nothing to read, and everything printed into a file."""
    for flags, path, targets in ((os.O_RDONLY, os.devnull, (0,)), (os.O_WRONLY | os.O_CREAT, str(log), (1, 2))):
        handle = os.open(path, flags, 0o644)
        for target in targets:
            os.dup2(handle, target)
        os.close(handle)
