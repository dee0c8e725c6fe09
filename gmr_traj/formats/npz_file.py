"""NumPy archives: read without running or allocating what they only claim, written the same every time."""

from __future__ import annotations

import io
import math
import zipfile
from collections.abc import Container, Mapping
from typing import Any, BinaryIO

import numpy as np

from gmr_traj.exceptions import ClipError
from gmr_traj.formats.size_limit import check_size

_EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest date a zip file can hold


def names(data: bytes) -> tuple[str, ...]:
    """Names of an npz file's entries, in the file's order, without reading any.

    Raises:
        ClipError: the archive is damaged.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            return tuple(name.removesuffix(".npy") for name in archive.namelist())
    except Exception as error:  # as in load
        raise ClipError(f"not a readable npz file: {type(error).__name__}: {error}") from error


def load(data: bytes, only: Container[str] | None = None) -> dict[str, np.ndarray]:
    """Arrays of an npz file by name, in the file's order.

    Args:
        data: content of the file.
        only: the entries to read, None for all; others may hold anything (AMASS files have a pickled dict among them).

    Raises:
        ClipError: the archive is damaged, an entry holds Python objects (``allow_pickle`` is never on), or one claims
            more than it holds.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            wanted = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
            if only is not None:
                wanted = {name: info for name, info in wanted.items() if name in only}
            check_size(sum(info.file_size for info in wanted.values()), "the archive's content")
            return {name: _entry(archive, info) for name, info in wanted.items()}
    except ClipError:
        raise
    except (
        Exception
    ) as error:  # damaged bytes make zipfile and the array's header raise anything; nothing else runs here
        raise ClipError(f"not a readable npz file: {type(error).__name__}: {error}") from error


def _entry(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> np.ndarray:
    raw = archive.read(info)
    stream = io.BytesIO(raw)
    version = np.lib.format.read_magic(stream)
    header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = header(stream)
    if dtype.hasobject:
        raise ClipError(f"entry {info.filename!r} holds Python objects, which are not read; save plain arrays")
    if any(k < 0 for k in shape) or math.prod(shape) * dtype.itemsize != len(raw) - stream.tell():
        raise ClipError(
            f"entry {info.filename!r} claims shape {shape} of {dtype} but holds {len(raw) - stream.tell()} bytes"
        )
    stream.seek(0)
    array: np.ndarray = np.lib.format.read_array(stream, allow_pickle=False)
    return array


def save(stream: BinaryIO, arrays: Mapping[str, Any]) -> None:
    """Write arrays as an uncompressed npz file.

    The bytes depend on the arrays alone: entries carry no clock time, and their order is the mapping's.

    Args:
        stream: where to write.
        arrays: what ``numpy.asarray`` takes, by name; object arrays are refused by ``numpy.lib.format``.
    """
    with zipfile.ZipFile(stream, "w") as archive:
        for name, value in arrays.items():
            array = np.ascontiguousarray(value) if np.ndim(value) else np.asarray(value)
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, array, allow_pickle=False)
            archive.writestr(zipfile.ZipInfo(f"{name}.npy", _EPOCH), buffer.getvalue())
