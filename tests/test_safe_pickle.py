"""The pickle reader: everything clips consist of, nothing that runs, nothing that only claims to be large."""

from __future__ import annotations

import collections
import io
import pickle
import struct
import zlib
from pathlib import Path
from typing import Any

import joblib
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from gmr_traj.exceptions import ClipError
from gmr_traj.formats import pickle_writer, safe_pickle, size_limit

CLIP: dict[str, Any] = {
    "fps": np.float64(29.9),
    "count": np.int64(3),
    "root_pos": np.arange(12.0).reshape(4, 3),
    "dof": np.arange(8, dtype=np.float32).reshape(4, 2),
    "fortran": np.asfortranarray(np.arange(6.0).reshape(2, 3)),
    "big_endian": np.arange(3, dtype=">f8"),
    "again": np.arange(3, dtype=">f8"),
    "mask": np.array([True, False]),
    "text": np.array(["left", "right"]),
    "names": ["pelvis", "torso"],
    "nothing": None,
    "nested": {"a": (1, 2.5, b"x", {3})},
}

ARRAYS = npst.arrays(
    dtype=st.sampled_from(["<f8", ">f8", "<f4", "<i8", "<i2", "|u1", "|b1", "<U3"]),
    shape=npst.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4),
)


def equal(a: Any, b: Any) -> bool:
    if isinstance(a, dict):
        return isinstance(b, dict) and list(a) == list(b) and all(equal(a[k], b[k]) for k in a)
    if isinstance(a, np.ndarray):
        native = a.dtype.newbyteorder("=")  # the order of bytes may change on the way, as in pickle itself
        same = isinstance(b, np.ndarray) and b.dtype.newbyteorder("=") == native and b.shape == a.shape
        return same and a.astype(native).tobytes() == b.astype(native).tobytes()
    return type(a) is type(b) and bool(a == b)


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_what_clips_consist_of(protocol: int) -> None:
    content = dict(CLIP, nested={"a": (1, 2.5, "x")}) if protocol < 4 else CLIP  # older ones call builtins for sets
    loaded, packed = safe_pickle.load(pickle.dumps(content, protocol=protocol))
    assert equal(loaded, content)
    assert packed is None


@pytest.mark.parametrize("compress", [0, ("zlib", 3), ("gzip", 3), ("bz2", 3), ("xz", 3), ("lzma", 3)])
def test_joblib(compress: Any, tmp_path: Path) -> None:
    joblib.dump(CLIP, tmp_path / "x", compress=compress)
    loaded, packed = safe_pickle.load((tmp_path / "x").read_bytes())
    assert equal(loaded, CLIP)
    assert packed == (compress[0] if compress else None)


def test_numpy_1_names() -> None:
    data = pickle.dumps(CLIP, protocol=4)
    old = data.replace(b"\x8c\x16numpy._core.multiarray", b"\x8c\x15numpy.core.multiarray")
    frame = struct.unpack("<Q", old[3:11])[0]
    old = old[:3] + struct.pack("<Q", frame - (len(data) - len(old))) + old[11:]
    assert old != data
    assert equal(safe_pickle.load(old)[0], CLIP)


@given(ARRAYS)
def test_any_array(array: np.ndarray) -> None:
    for protocol in (2, 4, 5):
        assert equal(safe_pickle.load(pickle.dumps(array, protocol=protocol))[0], array)
    stream = io.BytesIO()
    joblib.dump(array, stream)
    assert equal(safe_pickle.load(stream.getvalue())[0], array)


@given(ARRAYS)
def test_written_for_numpy_1_and_2(array: np.ndarray) -> None:
    stream = io.BytesIO()
    pickle_writer.dump({"a": array, "b": array[()], "c": array}, stream)
    assert b"numpy._core" not in stream.getvalue()
    loaded = pickle.loads(stream.getvalue())
    assert equal(loaded["a"], array)
    assert equal(safe_pickle.load(stream.getvalue())[0]["c"], array)


def test_bytes_depend_on_values_alone() -> None:
    """Two equal strings that are one object, or two."""
    streams = [io.BytesIO(), io.BytesIO()]
    name = "".join(["pel", "vis"])
    pickle_writer.dump([name, name], streams[0])
    pickle_writer.dump([name, "".join(["pel", "vis"])], streams[1])
    assert streams[0].getvalue() == streams[1].getvalue()


class _Evil:
    def __init__(self, call: Any, *args: Any) -> None:
        self.call = (call, args)

    def __reduce__(self) -> Any:
        return self.call


@pytest.mark.parametrize(
    ("evil", "name"),
    [
        (_Evil(eval, "1+1"), "builtins.eval"),
        (_Evil(print, "x"), "builtins.print"),
        (_Evil(getattr, 1, "real"), "builtins.getattr"),
        (_Evil(bytearray, 2**40), "builtins.bytearray"),
        (_Evil(np.load, "x.npy"), "numpy.load"),
        (_Evil(Path, "x"), "pathlib"),
        (collections.Counter("ab"), "collections.Counter"),
    ],
)
@pytest.mark.parametrize("protocol", [0, 2, 4])
def test_nothing_is_run(evil: Any, name: str, protocol: int) -> None:
    with pytest.raises(ClipError, match=f"names .*{name.split('.')[-1]}.*nothing was run|names {name}"):
        safe_pickle.load(pickle.dumps({"root_pos": evil}, protocol=protocol))


def test_object_arrays_are_refused(tmp_path: Path) -> None:
    array = np.array([{"a": 1}], dtype=object)
    joblib.dump(array, tmp_path / "x")
    for data in (pickle.dumps(array), (tmp_path / "x").read_bytes()):
        with pytest.raises(ClipError, match="type 'O8'"):
            safe_pickle.load(data)


def test_claims_cost_nothing() -> None:
    """A size, a memo index or a shape beyond all memory is refused without taking any."""
    huge = struct.pack("<Q", 2**50)
    claims = [
        pickle.BINBYTES8 + huge,
        pickle.BYTEARRAY8 + huge,
        pickle.BINUNICODE8 + huge,
        pickle.FRAME + huge,
        pickle.LONG4 + struct.pack("<i", 2**31 - 1),
    ]
    for claim in claims:
        with pytest.raises(ClipError):
            safe_pickle.load(b"\x80\x04" + claim + b"x.")
    loaded, _ = safe_pickle.load(b"\x80\x04K\x01" + pickle.LONG_BINPUT + struct.pack("<I", 2**32 - 1) + b".")
    assert loaded == 1
    shape = pickle.dumps(np.zeros(3), protocol=4).replace(b"K\x03\x85", b"J\xff\xff\xff\x7f\x85")
    with pytest.raises(ClipError, match="bytes"):
        safe_pickle.load(shape)


def test_bombs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gmr_traj.formats.decompress.MAX_BYTES", 2**16)
    monkeypatch.setattr(size_limit, "MAX_BYTES", 2**16)
    with pytest.raises(ClipError, match="MiB"):
        safe_pickle.load(zlib.compress(b"\x00" * 2**20))
    monkeypatch.setattr(safe_pickle, "_MAX_ITEMS", 10_000)
    laughs: list[Any] = ["ha"]
    for _ in range(30):
        laughs = [laughs] * 10
    with pytest.raises(ClipError, match="too deeply or has too many"):
        safe_pickle.load(pickle.dumps(laughs))
    cycle: list[Any] = []
    cycle.append(cycle)
    with pytest.raises(ClipError, match="too deeply"):
        safe_pickle.load(pickle.dumps(cycle))
    with pytest.raises(ClipError, match="contain themselves"):
        pickle_writer.dump(cycle, io.BytesIO())


@given(st.binary(max_size=60))
def test_noise(data: bytes) -> None:
    """Arbitrary opcodes end in plain content or in one error."""
    for start in (b"", b"\x80\x04", b"x\x9c"):
        try:
            safe_pickle.load(start + data)
        except ClipError:
            continue
