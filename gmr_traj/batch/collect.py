"""Which motions a batch is about: folders, patterns, files, and lists of these."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from gmr_traj.exceptions import BatchError
from gmr_traj.formats.clip import CLIP_SUFFIXES
from gmr_traj.formats.human import is_human

# Suffixes of human motion; npz is a clip's as well, and txt is taken where the content is a motion.
HUMAN_SUFFIXES = (".bvh",)
_LOOKED_FOR = ", ".join(f"*{suffix}" for suffix in (*HUMAN_SUFFIXES, *CLIP_SUFFIXES, ".txt"))


@dataclass(frozen=True)
class Input:
    """One motion.

    Attributes:
        path: absolute path of the file, symbolic links not followed.
        relative: its place within the folder, pattern or list it was found by; its output is called after it.
    """

    path: Path
    relative: Path


def collect(given: Sequence[str], out: Path) -> tuple[Input, ...]:
    """Find every motion, each once, sorted by path.

    A folder is searched with its subfolders, and a pattern (``*``, ``?``, ``[...]``, ``**``) for what looks like a
    motion: by suffix, and ``.txt`` by content; hidden files and the output folder are left out.  A file is taken
    whatever it is called.  ``@list.txt`` holds one of these a line, relative to the working folder; empty lines and
    those that begin with ``#`` are skipped.

    Args:
        given: what the user named.
        out: the output folder.

    Raises:
        BatchError: something does not exist, a folder, pattern or list has no motions, or an input is in ``out``.
    """
    home = _absolute(out)
    found: dict[Path, Input] = {}
    for name in given:
        inputs = _from_list(Path(name[1:]), home) if name.startswith("@") else _from_name(name, home)
        for one in inputs:
            found.setdefault(one.path, one)
    return tuple(found[path] for path in sorted(found))


def _from_list(path: Path, home: Path) -> list[Input]:
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise BatchError(
            f"@{path}: cannot be read: {error.strerror}; expected a text file with one path a line"
        ) from error
    except UnicodeDecodeError:
        raise BatchError(f"@{path}: this is not text; expected one path a line") from None
    inputs: list[Input] = []
    files: list[Path] = []
    for number, line in enumerate(lines, 1):
        name = line.strip()
        if not name or name.startswith("#"):
            continue
        try:
            if Path(name).is_dir() or glob.has_magic(name):
                inputs += _from_name(name, home)
            else:
                files += [one.path for one in _from_name(name, home)]
        except BatchError as error:
            raise BatchError(f"{path}: line {number}: {error}") from error
    if files:
        # Called after their places below the folder that all of them are in, as if that had been named.
        base = Path(os.path.commonpath([file.parent for file in files]))
        inputs += [Input(file, file.relative_to(base)) for file in files]
    if not inputs:
        raise BatchError(f"{path}: this list names no motions; expected one path a line")
    return inputs


def _from_name(name: str, home: Path) -> list[Input]:
    path = _absolute(Path(name))
    if path.is_dir():
        return _from_folder(path, name, home)
    if path.exists():
        if path.is_relative_to(home):
            raise BatchError(f"{name}: this is in the output folder {home}; write the batch to another one")
        return [Input(path, Path(path.name))]
    if glob.has_magic(name):
        return _from_pattern(name, home)
    raise BatchError(f"{name}: no such file or folder")


def _from_folder(folder: Path, name: str, home: Path) -> list[Input]:
    if folder.is_relative_to(home):
        raise BatchError(f"{name}: this is the output folder or in it; write the batch to another one with --out")
    inputs = [Input(path, path.relative_to(folder)) for path in _search(folder, home)]
    if not inputs:
        raise BatchError(f"{name}: no motions in this folder; looked for {_LOOKED_FOR}")
    return inputs


def _from_pattern(pattern: str, home: Path) -> list[Input]:
    fixed = []
    for part in Path(pattern).parts[:-1]:
        if glob.has_magic(part):
            break
        fixed.append(part)
    base = _absolute(Path(*fixed))
    inputs = []
    for match in sorted(glob.glob(pattern, recursive=True)):
        path = _absolute(Path(match))
        if path.is_relative_to(home):
            continue
        found = _search(path, home) if path.is_dir() else [path] * _looks_like_motion(path)
        inputs += [Input(file, file.relative_to(base)) for file in found]
    if not inputs:
        raise BatchError(f"{pattern}: this pattern matches no motions; looked for {_LOOKED_FOR}")
    return inputs


def _search(folder: Path, home: Path) -> Iterator[Path]:
    """Motions in a folder and its subfolders, links to folders too, none twice."""
    entered = set()
    for place, folders, files in os.walk(folder, followlinks=True):
        real = os.path.realpath(place)
        if real in entered or Path(place) == home:
            folders.clear()
            continue
        entered.add(real)
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        for name in sorted(files):
            path = Path(place) / name
            if not name.startswith(".") and _looks_like_motion(path):
                yield path


def _looks_like_motion(path: Path) -> bool:
    """By suffix and, for txt, by content; only regular files, because others may never end."""
    if not path.is_file():
        return False
    suffix = path.suffix.lower()
    return suffix in (*HUMAN_SUFFIXES, *CLIP_SUFFIXES) or (suffix == ".txt" and is_human(path))


def _absolute(path: Path) -> Path:
    return Path(os.path.abspath(path.expanduser()))
