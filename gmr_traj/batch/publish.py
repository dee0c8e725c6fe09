"""Putting a clip's files in place: its record first, so that no output is ever without it."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gmr_traj import atomic
from gmr_traj.batch.clip_process import RESULT
from gmr_traj.batch.fingerprint import sha256
from gmr_traj.batch.plan import Expected
from gmr_traj.batch.records import LAYOUT, Record, gist, output_path, record_path, to_text
from gmr_traj.batch.work import Ended

RECORDING = ".rrd"


def publish(
    ended: Ended, path: Path, expected: Expected, out: Path, run: Path, index: int, old: Record | None
) -> Record:
    """Write the record of a clip and move its outputs to their places.

    Everything is moved within one file system by renaming, so a reader sees the old file or the new one.  A run that
    is stopped between record and output leaves a record whose output is missing, which the next run finds.  What the
    clip's last record accounts for and this one does not is removed, unless it was changed since.

    Args:
        ended: how the clip ended.
        path: its input.
        expected: what decided the result.
        out: the output folder.
        run: the run's folder for unfinished work; the clip's attempts in it are removed.
        index: of the clip in the run.
        old: the clip's last record.

    Returns:
        The gist of the record.
    """
    result = _result(ended)
    outputs = {} if result["failed"] else result["outputs"]
    record: dict[str, Any] = {
        "layout": LAYOUT,
        "clip": ended.name,
        "status": "failed" if result["failed"] else "done",
        "reason": result["failed"] or None,
        "input": {"path": str(path), "sha256": result["sha256"]},
        "outputs": outputs,
        "options": expected.options,
        "resources": expected.resources,
        "versions": expected.versions,
        **result["content"],
    }
    target = record_path(out, ended.name)
    target.parent.mkdir(parents=True, exist_ok=True)
    staged = run / f"record of {index}"  # not beside the target, where a killed run would leave it
    with atomic.write(staged) as stream:
        stream.write(to_text(record).encode())
    os.replace(staged, target)
    for output in outputs.values():
        assert ended.folder is not None
        os.replace(ended.folder / output["file"], output_path(out, ended.name, output["file"]))
    _remove_old(old, outputs, ended.name, out)
    for attempt in run.glob(f"{index}.*"):
        shutil.rmtree(attempt)
    return gist(record)


def _result(ended: Ended) -> dict[str, Any]:
    if ended.folder is None:
        return {"failed": ended.failed, "sha256": None, "outputs": {}, "content": {}}
    content: dict[str, Any] = json.loads((ended.folder / RESULT).read_text(encoding="utf-8"))
    return content


def _remove_old(old: Record | None, outputs: Mapping[str, Any], name: str, out: Path) -> None:
    now = {output["file"] for output in outputs.values()}
    for output in (old or {}).get("outputs", {}).values():
        file = output_path(out, name, output["file"])
        if output["file"] not in now and file.is_file() and sha256(file) == output["sha256"]:
            file.unlink()
    # A recording shows the clip as it was.
    output_path(out, name, Path(name).name + RECORDING).unlink(missing_ok=True)
