"""A list of instructions for frames.c, and the vectors it runs on."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import partial

import numpy as np

from gmr_traj.kernels.library import address, arguments
from gmr_traj.kernels.numpy_loops import Loop, loop
from gmr_traj.threads import parts, side_by_side

#: The operation ``condition != 0 ? value : 0``, which NumPy has no function for.
IF_ELSE_ZERO = "if_else_zero"

# In the order of the operations of frames.c.
_PLAIN = (
    np.positive,
    np.negative,
    np.square,
    np.sqrt,
    np.fabs,
    np.reciprocal,
    np.logical_not,
    np.add,
    np.subtract,
    np.multiply,
    np.divide,
    np.less,
    np.less_equal,
    np.equal,
    np.not_equal,
    np.logical_and,
    np.logical_or,
    IF_ELSE_ZERO,
)
_CODES: dict[object, int] = {operation: code for code, operation in enumerate(_PLAIN)}

# So many frames are worth a thread.
_MANY = 512


class Listing:
    """Instructions as numbers, for any frames.

    Args:
        steps: a ufunc or ``IF_ELSE_ZERO``, its sources and its target; each the index of a vector.
        constants: (register, value).
        registers: how many vectors are registers; those of inputs and outputs come after them.
        library: the kernels.
        numpy: whether functions are NumPy's, else the C library's, which CasADi calls.

    Raises:
        LookupError: a ufunc has no loop that can be called from C.
    """

    def __init__(
        self,
        steps: Sequence[tuple[object, ...]],
        constants: Sequence[tuple[int, float]],
        registers: int,
        library: ctypes.CDLL,
        numpy: bool,
    ) -> None:
        loops: list[Loop] = []
        codes = dict(_CODES)
        rows = []
        for operation, *vectors in steps:
            if operation not in codes:
                assert isinstance(operation, np.ufunc)
                found = loop(operation) if numpy else _of_the_c_library(operation, library)
                if found is None:
                    raise LookupError(operation.__name__)
                codes[operation] = len(_PLAIN) + len(loops)
                loops.append(found)
            rows.append((codes[operation], vectors[0], vectors[-2], vectors[-1]))
        self.list = np.array(rows, np.int32).reshape(-1, 4)
        self.constant = np.array([register for register, _ in constants], np.int32)
        self.value = np.array([value for _, value in constants], float)
        self.registers = registers
        self.loops = (Loop * len(loops))(*loops)


def _of_the_c_library(ufunc: np.ufunc, library: ctypes.CDLL) -> Loop | None:
    function = getattr(library, f"libm_{ufunc.__name__}", None)
    return None if function is None else Loop(ctypes.cast(function, ctypes.c_void_p), None, ufunc.nin)


class _Program(ctypes.Structure):
    """What ``Program`` is in frames.c."""

    _fields_ = (
        *((name, ctypes.c_int64) for name in ("count", "constants", "registers", "unknowns", "vectors")),
        *((name, ctypes.c_void_p) for name in ("list", "constant", "value", "vector", "columns")),
        ("frames", ctypes.c_int64),
        ("loops", ctypes.c_void_p),
    )


class CompiledMachine:
    """A listing on given arrays.

    Args:
        library: the kernels.
        listing: the instructions.
        columns: which of the unknowns the entries of the first input are.  # (n, K)
        arrays: the other inputs, and the outputs, a column a frame.  # (n, K) each
    """

    def __init__(
        self, library: ctypes.CDLL, listing: Listing, columns: np.ndarray, arrays: Sequence[np.ndarray]
    ) -> None:
        vectors = np.concatenate([address(a) + a.strides[0] * np.arange(len(a)) for a in arrays])
        columns = np.ascontiguousarray(columns, np.int64)
        self._kept = listing, arrays, vectors, columns
        self._run, self._count = library.frames_run, columns.shape[1]
        near = listing.registers + len(columns)
        self._space = near * int(library.frames_width()), near + len(vectors)
        self._program = _Program(
            len(listing.list),
            len(listing.constant),
            listing.registers,
            len(columns),
            len(vectors),
            *map(address, (listing.list, listing.constant, listing.value, vectors, columns)),
            self._count,
            ctypes.addressof(listing.loops),
        )

    def run(self, x: np.ndarray) -> None:
        """Compute the outputs at some unknowns."""
        x = np.ascontiguousarray(x, float)
        side_by_side([partial(self._part, x, *frames) for frames in parts(self._count, _MANY)])

    def _part(self, x: np.ndarray, begin: int, end: int) -> None:
        space, table = np.empty(self._space[0]), np.empty(self._space[1], np.int64)
        self._run(ctypes.byref(self._program), *arguments(x, begin, end, space, table))
