"""The record beside every output: what it was made from, by what, and what it measures; or why there is none."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

SUFFIX = ".record.json"
STATE = ".batch"  # the folder in the output folder that holds the lock and unfinished work
LAYOUT = 1  # of records; a record of another layout is not understood, and its clip is done again

Record = Mapping[str, Any]

_BULKY = ("contacts", "audit", "notes", "traceback")


def record_path(out: Path, name: str) -> Path:
    """The record of a clip."""
    return out / f"{name}{SUFFIX}"


def output_path(out: Path, name: str, file: str) -> Path:
    """An output file as a record names it, beside the record."""
    return (out / name).parent / file


def read_records(out: Path) -> dict[str, Record]:
    """The gist of every record in an output folder that can be understood, by name; none where there is no folder.

    A file that cannot be is passed over: its clip is done again, and the file replaced.
    """
    found: dict[str, Record] = {}
    for place, folders, files in os.walk(out):
        folders[:] = [name for name in folders if not name.startswith(".")]
        for file in files:
            if file.endswith(SUFFIX) and not file.startswith("."):
                path = Path(place) / file
                record = _read(path)
                if record is not None:
                    found[path.relative_to(out).as_posix().removesuffix(SUFFIX)] = record
    return found


def gist(record: Record) -> Record:
    """What of a record the plan and the summary need: a batch may have ten thousand."""
    kept = {key: value for key, value in record.items() if key not in _BULKY}
    if "solver" in kept:
        kept["solver"] = {key: kept["solver"][key] for key in ("status", "iterations")}
    if "certificate" in kept:
        kept["certificate"] = {key: kept["certificate"][key] for key in ("held", "promises", "before", "after")}
    return kept


def read_whole(out: Path, name: str) -> Record:
    """One record with everything in it."""
    record: Record = json.loads(record_path(out, name).read_text(encoding="utf-8"))
    return record


def to_text(record: Record) -> str:
    """The record as JSON; equal runs give equal bytes."""
    return json.dumps(record, indent=2, allow_nan=False) + "\n"


def _read(path: Path) -> Record | None:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    if not isinstance(content, dict) or content.get("layout") != LAYOUT:
        return None
    shape = {"status": str, "input": dict, "outputs": dict, "options": dict, "resources": dict, "versions": dict}
    if not all(isinstance(content.get(key), kind) for key, kind in shape.items()):
        return None
    return gist(content) if isinstance(content["input"].get("path"), str) else None
