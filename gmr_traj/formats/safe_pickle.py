"""Pickles read without running anything they say.

``pickle.load`` and ``joblib.load`` call whatever a file names.  This reader admits NumPy arrays, scalars and numeric
types (as NumPy 1 and NumPy 2 name them), joblib's inlined arrays, and plain containers; it replaces every constructor
by its own and refuses all else by name.  It works on the pure Python unpickler, which, unlike the C one, allocates
nothing that the file does not hold (a memo index or a byte count of 2^40 costs nothing).
"""

from __future__ import annotations

import io
import math
import pickle
import re
import struct
from collections.abc import Callable, Collection
from typing import Any, ClassVar

import numpy as np

from gmr_traj.exceptions import ClipError
from gmr_traj.formats.decompress import compression, decompress

_MAX_DEPTH = 32
_MAX_ITEMS = 2_000_000
_NUMERIC = re.compile(r"[<>|=]?([?bhilqBHILQefd]|[biuf][0-9]{1,2}|[SU][0-9]{1,5})")


class Record:
    """Stands for an object of a class that is read as a record of its fields: it has a state and does nothing."""

    state: Any = None


def load(data: bytes, records: Collection[tuple[str, str]] = ()) -> tuple[Any, str | None]:
    """Read a pickle, plain or compressed, written by ``pickle`` or by ``joblib``.

    Args:
        data: content of the file.
        records: module and name of classes whose objects are read as a ``Record``; none of their code is looked for.

    Returns:
        The object (dicts, lists, tuples, text, numbers, arrays), and the name of the compression or None.

    Raises:
        ClipError: the file names anything else than arrays and plain containers, or is damaged.
    """
    packed = compression(data)
    if packed is not None:
        data = decompress(data, packed)
    unpickler = _SafeUnpickler(io.BytesIO(data), len(data), records)
    try:
        content = unpickler.load()
    except ClipError:
        raise
    except Exception as error:  # a damaged pickle can raise anything, its documentation says; no other code runs
        raise ClipError(f"not a readable pickle: {type(error).__name__}: {error}") from error
    _check_plain(content)
    return content, packed


class _NDArray:
    """Stands for ``numpy.ndarray`` where a pickle names it as a class."""


class _JoblibArray:
    """joblib's NumpyArrayWrapper: the array's bytes follow the wrapper in the file."""


class _SafeUnpickler(pickle._Unpickler):
    stack: list[Any]
    read: Callable[[int], bytes]
    append: Callable[[Any], None]
    dispatch: ClassVar[dict[int, Callable[[Any], None]]] = dict(pickle._Unpickler.dispatch)

    def __init__(self, stream: io.BytesIO, size: int, records: Collection[tuple[str, str]] = ()) -> None:
        super().__init__(stream, encoding="latin1")
        self._stream = stream
        self._size = size
        self._records = records

    def find_class(self, module: str, name: str) -> Any:
        """Our own constructor for an admitted name."""
        if (module, name) in self._records or (self._records and name == "object" and "builtin" in module):
            return Record  # protocols 0 and 1 name a class's base as well
        if (module, name) not in _ADMITTED:
            raise ClipError(
                f"the pickle names {module}.{name}, neither an array nor a plain container: nothing was run; "
                "save plain arrays"
            )
        return _ADMITTED[module, name]

    def load_build(self) -> None:
        """Give state to an array, a type or a joblib wrapper, and to nothing else."""
        state = self.stack.pop()
        instance = self.stack[-1]
        if isinstance(instance, np.ndarray):
            _set_array_state(instance, state)
        elif isinstance(instance, np.dtype):
            _set_dtype_state(instance, state)
        elif isinstance(instance, _JoblibArray):
            self.stack[-1] = _read_joblib_array(state, self._stream)
        elif isinstance(instance, Record):
            instance.state = state
        else:
            raise pickle.UnpicklingError(f"state for a {type(instance).__name__}")

    dispatch[pickle.BUILD[0]] = load_build

    def load_bytearray8(self) -> None:
        """As the original, but without allocating what the file does not hold."""
        (size,) = struct.unpack("<Q", self.read(8))
        if size > self._size:
            raise pickle.UnpicklingError(f"{size} bytes announced in a file of {self._size}")
        self.append(bytearray(self.read(size)))

    dispatch[pickle.BYTEARRAY8[0]] = load_bytearray8


def _dtype(code: Any, *_: Any) -> np.dtype[Any]:
    if not isinstance(code, str) or not _NUMERIC.fullmatch(code):
        raise pickle.UnpicklingError(f"type {code!r}; only numbers and text are read")
    return np.dtype(code, copy=True)


def _set_dtype_state(dtype: np.dtype[Any], state: Any) -> None:
    """Byte order; the rest of the state must say what the type already is (anything else could corrupt memory)."""
    if not isinstance(state, tuple) or len(state) != 8 or state[0] != 3 or state[1] not in ("<", ">", "|", "="):
        raise pickle.UnpicklingError("state of a numeric type")
    sizes = (dtype.itemsize, dtype.alignment) if dtype.kind in "SU" else (-1, -1)
    if state[2:] != (None, None, None, *sizes, dtype.flags):
        raise pickle.UnpicklingError("state of a numeric type")
    dtype.__setstate__((3, *state[1:]))  # type: ignore[attr-defined]


def _reconstruct(kind: Any, *_: Any) -> np.ndarray:
    if kind is not _NDArray:
        raise pickle.UnpicklingError("an array of a class that is not numpy.ndarray")
    return np.empty(0)


def _check_shape(shape: Any, dtype: Any) -> int:
    """Bytes an array of that shape and type takes."""
    if not isinstance(dtype, np.dtype) or not isinstance(shape, tuple) or len(shape) > 8:
        raise pickle.UnpicklingError("shape or type of an array")
    if any(not isinstance(k, int) or isinstance(k, bool) or k < 0 for k in shape):
        raise pickle.UnpicklingError(f"shape {shape} of an array")
    return math.prod(shape) * dtype.itemsize


def _check_size(shape: Any, dtype: Any, size: int) -> None:
    if _check_shape(shape, dtype) != size:
        raise pickle.UnpicklingError(f"an array of shape {shape} and type {dtype} with {size} bytes")


def _set_array_state(array: np.ndarray, state: Any) -> None:
    if not isinstance(state, tuple) or len(state) != 5:
        raise pickle.UnpicklingError("state of an array")
    _, shape, dtype, fortran, raw = state
    if isinstance(raw, str):  # Python 2 wrote text
        raw = raw.encode("latin1")
    if not isinstance(raw, bytes | bytearray):
        raise pickle.UnpicklingError("state of an array")
    _check_size(shape, dtype, len(raw))
    array.__setstate__((1, shape, dtype, bool(fortran), bytes(raw)))  # type: ignore[arg-type]


def _scalar(dtype: Any, raw: Any) -> Any:
    if not isinstance(raw, bytes):
        raise pickle.UnpicklingError("bytes of a scalar")
    _check_size((), dtype, len(raw))
    return np.frombuffer(raw, dtype, 1)[0] if raw else dtype.type()  # an empty text takes no bytes


def _from_buffer(raw: Any, dtype: Any, shape: Any, order: Any = "C", *_: Any) -> np.ndarray:
    if not isinstance(raw, bytes | bytearray) or order not in ("C", "F"):
        raise pickle.UnpicklingError("bytes of an array")
    _check_size(shape, dtype, len(raw))
    return np.frombuffer(bytes(raw), dtype).reshape(shape, order=order)


def _read_joblib_array(state: Any, stream: io.BytesIO) -> np.ndarray:
    """Bytes of an array in the stream, after padding to the alignment joblib (since 1.2) asks for."""
    if not isinstance(state, dict) or state.get("subclass") is not _NDArray or state.get("order") not in ("C", "F"):
        raise pickle.UnpicklingError("a joblib array that is not a plain numpy.ndarray")
    dtype, shape = state.get("dtype"), state.get("shape")
    size = _check_shape(shape, dtype)
    if state.get("numpy_array_alignment_bytes") is not None:
        stream.read(stream.read(1)[0])
    return _from_buffer(stream.read(size), dtype, shape, state["order"])


def _no_bytes() -> bytes:
    """What protocol 2 calls ``bytes`` for: nothing but the empty one."""
    return b""


def _reconstruct_record(kind: Any, *_: Any) -> Record:
    """What protocols 0 and 1 call for an object of a class."""
    if kind is not Record:
        raise pickle.UnpicklingError("an object of a class that is not read")
    return Record()


def _latin1(text: Any, encoding: Any) -> bytes:
    if not isinstance(text, str) or encoding not in ("latin1", "latin-1"):
        raise pickle.UnpicklingError(f"text encoded as {encoding!r}")
    return text.encode("latin1")


_ADMITTED: dict[tuple[str, str], Callable[..., Any]] = {
    ("numpy", "ndarray"): _NDArray,
    ("numpy", "dtype"): _dtype,
    ("_codecs", "encode"): _latin1,
    ("builtins", "bytes"): _no_bytes,
    ("__builtin__", "bytes"): _no_bytes,
    ("collections", "OrderedDict"): dict,
    ("copy_reg", "_reconstructor"): _reconstruct_record,
    ("copyreg", "_reconstructor"): _reconstruct_record,
    ("joblib.numpy_pickle", "NumpyArrayWrapper"): _JoblibArray,
    **{(f"{core}.multiarray", "_reconstruct"): _reconstruct for core in ("numpy.core", "numpy._core")},
    **{(f"{core}.multiarray", "scalar"): _scalar for core in ("numpy.core", "numpy._core")},
    **{(f"{core}.numeric", "_frombuffer"): _from_buffer for core in ("numpy.core", "numpy._core")},
}


def _check_plain(content: Any) -> None:
    """Nothing but values, no cycle, and not more items than a clip has (shared lists can unfold without end)."""
    items = 0
    todo: list[tuple[Any, int]] = [(content, 0)]
    while todo:
        value, depth = todo.pop()
        items += 1
        if depth > _MAX_DEPTH or items > _MAX_ITEMS:
            raise ClipError("the pickle is nested too deeply or has too many items to be a clip")
        if isinstance(value, dict):
            todo += [(v, depth + 1) for pair in value.items() for v in pair]
        elif isinstance(value, list | tuple | set | frozenset):
            todo += [(v, depth + 1) for v in value]
        elif isinstance(value, Record):
            todo.append((value.state, depth + 1))
        elif value is not None and not isinstance(
            value, bool | int | float | complex | str | bytes | bytearray | np.ndarray | np.generic
        ):
            raise ClipError(f"the pickle holds a {type(value).__name__} outside an array")
