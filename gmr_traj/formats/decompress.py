"""Compressed pickles (joblib's zlib, gzip, bz2, xz and lzma), inflated with a bound on their size."""

from __future__ import annotations

import bz2
import lzma
import zlib

from gmr_traj.exceptions import ClipError
from gmr_traj.formats.size_limit import MAX_BYTES, check_size

_MAGIC = (
    (b"\x1f\x8b", "gzip"),
    (b"BZh", "bz2"),
    (b"\xfd7zXZ", "xz"),
    (b"\x5d\x00", "lzma"),
    (b"\x04\x22\x4d\x18", "lz4"),
)


def compression(data: bytes) -> str | None:
    """Name of the compression the bytes start with, None where they are not compressed."""
    for magic, name in _MAGIC:
        if data.startswith(magic):
            return name
    # zlib (RFC 1950): deflate with a window of at most 32 KiB, and a header that is a multiple of 31.
    if len(data) > 2 and data[0] == 0x78 and (data[0] * 256 + data[1]) % 31 == 0:
        return "zlib"
    return None


def decompress(data: bytes, name: str) -> bytes:
    """Inflate bytes, at most ``MAX_BYTES`` of them.

    Raises:
        ClipError: the data are damaged, inflate to more than any clip, or ``name`` is a compression without a reader.
    """
    try:
        if name in ("zlib", "gzip"):
            out = zlib.decompressobj(wbits=31 if name == "gzip" else 15).decompress(data, MAX_BYTES + 1)
        elif name == "bz2":
            out = bz2.BZ2Decompressor().decompress(data, MAX_BYTES + 1)
        elif name in ("xz", "lzma"):
            out = lzma.LZMADecompressor(memlimit=MAX_BYTES).decompress(data, MAX_BYTES + 1)
        else:
            raise ClipError(f"compressed with {name}, which is not read; write the file uncompressed or with zlib")
    except (zlib.error, lzma.LZMAError, OSError, EOFError, MemoryError) as error:
        raise ClipError(f"damaged {name} data: {error}") from error
    check_size(len(out), "the decompressed pickle")
    return out
