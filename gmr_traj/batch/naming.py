"""What the outputs of each input are called, so that none overwrites another's."""

from __future__ import annotations

import hashlib
import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from gmr_traj.batch.collect import Input
from gmr_traj.exceptions import BatchError

RETARGETED = ".retargeted"  # between the name and the suffix of what the step `retarget` made for `refine`


def name_inputs(inputs: Sequence[Input], records: Mapping[str, Path]) -> dict[str, Input]:
    """A name for every input: a path relative to the output folder, without suffix.

    It is the input's relative path without its suffix.  Where several would be called the same, or a record of
    another input bears the name, all of these are told apart: by their suffixes (``walk_csv``), then by as many of
    their parent folders as it takes, at last by a hash of their paths.  An input that has a record keeps its name,
    whatever has been added since.

    Args:
        inputs: the inputs, each once.
        records: input of every record in the output folder, by name.

    Returns:
        Inputs by name, in the order given.

    Raises:
        BatchError: no name is left for an input.
    """
    named: dict[Path, str] = {}
    taken: set[str] = set()
    by_path = {path: name for name, path in records.items()}
    for one in inputs:
        if one.path in by_path:
            _take(one, by_path[one.path], named, taken)
    # A record whose input has gone (the data was moved) does not keep its name.
    occupied = {name for name, path in records.items() if name not in taken and os.path.exists(path)}
    waiting = {one.path: (one, _candidates(one)) for one in inputs if one.path not in named}
    while waiting:
        proposed: dict[Path, str] = {}
        for path, (one, candidates) in waiting.items():
            name = next(candidates, None)
            if name is None:
                raise BatchError(f"{path}: no name is left for its output; write it to another folder")
            if name in occupied and os.path.samefile(records[name], one.path):
                occupied.discard(name)  # the same file by another path
            proposed[path] = name
        wanted = Counter(claim for name in proposed.values() for claim in _claims(name))
        for path, name in proposed.items():
            claims = _claims(name)
            if not any(wanted[claim] > 1 or claim in taken or claim in occupied for claim in claims):
                _take(waiting.pop(path)[0], name, named, taken)
    return {named[one.path]: one for one in inputs}


def _take(one: Input, name: str, named: dict[Path, str], taken: set[str]) -> None:
    named[one.path] = name
    taken.update(_claims(name))


def _claims(name: str) -> tuple[str, str]:
    """What no other output may be called."""
    return name, name + RETARGETED


def _candidates(one: Input) -> Iterator[str]:
    relative = one.relative
    yield relative.with_suffix("").as_posix()
    told = relative.with_name(relative.name.replace(".", "_"))
    yield told.as_posix()
    above = one.path.parts[1 : len(one.path.parts) - len(relative.parts)]
    for count in range(1, len(above) + 1):
        yield Path(*above[-count:], told).as_posix()
    yield f"{told.as_posix()}_{hashlib.sha256(str(one.path).encode()).hexdigest()[:12]}"
