"""What a run has to do: clips that are new, changed, without their outputs, or failed before."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gmr_traj.batch.fingerprint import sha256
from gmr_traj.batch.records import Record, output_path, record_path
from gmr_traj.exceptions import BatchError
from gmr_traj.formats.clip import SUFFIXES

NEW, FAILED, FORCED = "new", "failed before", "forced"


@dataclass(frozen=True)
class Expected:
    """What a clip's record must say for its result to be that of this run.

    Attributes:
        options: what decides the result, by name.
        resources: hashes of the files that do.
        versions: of the packages.
    """

    options: Mapping[str, Any]
    resources: Mapping[str, str]
    versions: Mapping[str, str]


@dataclass(frozen=True)
class Todo:
    """A clip to be done.

    Attributes:
        name: of its outputs.
        path: its input.
        why: ``new``, or what has changed.
    """

    name: str
    path: Path
    why: str


def make_plan(
    inputs: Mapping[str, Path],
    records: Mapping[str, Record],
    expected: Callable[[str, Path], Expected],
    out: Path,
    *,
    force: bool = False,
    retry_failed: bool = True,
    progress: Callable[[str, int, int], None] | None = None,
) -> list[Todo]:
    """Find the clips that are to be done.

    Args:
        inputs: paths of the inputs by name.
        records: records in the output folder by name.
        expected: what the record of a clip must say.
        out: the output folder.
        force: do all.
        retry_failed: do those that failed before, though nothing has changed.
        progress: called with the stage, clips looked at, and clips in all.

    Returns:
        The clips to do, in the order of ``inputs``.

    Raises:
        BatchError: an output exists that no record accounts for.
    """

    def why(name: str) -> str | None:
        record = records.get(name)
        if record is None:
            _check_free(out, name, force)
            return NEW
        return (
            FORCED if force else _outdated(record, name, inputs[name], expected(name, inputs[name]), out, retry_failed)
        )

    todo = []
    # Hashing waits for the disk and lets other threads run.
    with ThreadPoolExecutor(4) as pool:
        for count, (name, reason) in enumerate(zip(inputs, pool.map(why, inputs), strict=True), 1):
            if reason is not None:
                todo.append(Todo(name, inputs[name], reason))
            if progress is not None:
                progress("looking at what is there", count, len(inputs))
    return todo


def _outdated(record: Record, name: str, path: Path, expected: Expected, out: Path, retry_failed: bool) -> str | None:
    """What has changed since a record was written; None where nothing has."""
    for what, now in (
        ("options", expected.options),
        ("resources", expected.resources),
        ("versions", expected.versions),
    ):
        changed = _difference(record[what], now)
        if changed is not None:
            return f"{changed} changed"
    if record["status"] == "failed" and retry_failed:
        return FAILED
    # Without a hash the input was never read; it cannot be said to have changed.
    before = record["input"].get("sha256")
    if before is not None and _hash(path) != before:
        return "input changed"
    for output in record["outputs"].values():
        file = output_path(out, name, output["file"])
        if not file.is_file():
            return f"{output['file']} is missing"
        if _hash(file) != output["sha256"]:
            return f"{output['file']} is not what was written"
    return None


def _hash(path: Path) -> str:
    """The file's hash; empty where it cannot be read, which is for the clip's own record to tell."""
    try:
        return sha256(path)
    except OSError:
        return ""


def _difference(before: Mapping[str, Any], now: Mapping[str, Any]) -> str | None:
    """The first entry that differs."""
    missing = object()
    return next((key for key in sorted({*before, *now}) if before.get(key, missing) != now.get(key, missing)), None)


def _check_free(out: Path, name: str, force: bool) -> None:
    """Refuse to write over files that are not the batch's own."""
    target = out / name
    if force or not target.parent.is_dir():
        return
    record = record_path(out, name)
    for suffix in sorted(set(SUFFIXES.values())):
        path = target.with_name(target.name + suffix)
        if path.exists() and not record.exists():
            raise BatchError(
                f"{path}: this file exists, and no record says that it is a batch's; write to another folder, or "
                "overwrite it with --force"
            )
