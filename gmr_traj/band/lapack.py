"""BLAS and LAPACK routines on blocks of one large array, without the interpreter's lock.

SciPy exports the routines of the library that it brings along, for C code (``scipy.linalg.cython_blas`` and
``cython_lapack``).  Called through ctypes they run side by side in threads, and their arguments are made once for all
factorisations of a pattern; SciPy's own wrappers hold the lock and look at every argument again.

Matrices are given by the address of their first entry and their leading dimension, in Fortran's order.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache, lru_cache
from typing import Any

from scipy.linalg import cython_blas, cython_lapack

from gmr_traj.exceptions import SolverError

#: A routine and its arguments.
Call = tuple[Callable[..., None], tuple[int, ...]]

_ARGUMENTS = {"dpotrf": 5, "dtrsm": 11, "dsyrk": 10, "dtrsv": 8, "dgemv": 11}
_CONSTANTS: list[Any] = []


@cache
def _address(name: str) -> int:
    """Where SciPy has a routine."""
    exported = (cython_lapack if name == "dpotrf" else cython_blas).__pyx_capi__[name]
    name_of, pointer_of = ctypes.pythonapi.PyCapsule_GetName, ctypes.pythonapi.PyCapsule_GetPointer
    name_of.restype, name_of.argtypes = ctypes.c_char_p, [ctypes.py_object]
    pointer_of.restype, pointer_of.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
    signature: bytes = name_of(exported)
    if b"int *" not in signature:
        raise SolverError(f"SciPy's {name} does not count in C's int, as it always has: {signature.decode()}")
    address: int = pointer_of(exported, signature)
    return address


@cache
def _routine(name: str) -> Callable[..., None]:
    return ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * _ARGUMENTS[name])(_address(name))


@cache
def addresses() -> int:
    """The address of a list of the routines' addresses, in the order of ``Routines`` in band.c."""
    names = ("dpotrf", "dtrsm", "dsyrk", "dtrsv", "dgemv")
    _CONSTANTS.append((ctypes.c_void_p * len(names))(*map(_address, names)))
    return ctypes.addressof(_CONSTANTS[-1])


@lru_cache(maxsize=None, typed=True)
def _at(value: int | float | str) -> int:
    """The address of a constant, which is kept."""
    kind: Any = {str: ctypes.c_char, int: ctypes.c_int, float: ctypes.c_double}[type(value)]
    _CONSTANTS.append(kind(value.encode() if isinstance(value, str) else value))
    return ctypes.addressof(_CONSTANTS[-1])


def cholesky(n: int, a: int, lda: int, info: int) -> Call:
    """``A = L L'``: the lower triangle of A becomes L; at address ``info``, a positive int where A is not definite."""
    return _routine("dpotrf"), (_at("L"), _at(n), a, _at(lda), info)


def solve_right(m: int, n: int, factor: int, ldf: int, b: int, ldb: int) -> Call:
    """``B := B L^-T``, B of m rows and n columns."""
    flags = (_at("R"), _at("L"), _at("T"), _at("N"))
    return _routine("dtrsm"), (*flags, _at(m), _at(n), _at(1.0), factor, _at(ldf), b, _at(ldb))


def downdate(n: int, k: int, x: int, ldx: int, c: int, ldc: int) -> Call:
    """``C := C - X X'``, the lower triangle of C; X is n by k."""
    return _routine("dsyrk"), (_at("L"), _at("N"), _at(n), _at(k), _at(-1.0), x, _at(ldx), _at(1.0), c, _at(ldc))


def solve_triangle(n: int, factor: int, ldf: int, x: int, transposed: bool) -> Call:
    """``x := L^-1 x`` or ``L^-T x``."""
    return _routine("dtrsv"), (_at("L"), _at("T" if transposed else "N"), _at("N"), _at(n), factor, _at(ldf), x, _at(1))


def subtract_product(m: int, n: int, a: int, lda: int, x: int, y: int, transposed: bool) -> Call:
    """``y := y - A x`` or ``y - A' x``; A is m by n."""
    flag = _at("T" if transposed else "N")
    return _routine("dgemv"), (flag, _at(m), _at(n), _at(-1.0), a, _at(lda), x, _at(1), _at(1.0), y, _at(1))
