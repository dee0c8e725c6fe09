"""A function of one frame in all frames, an instruction at a time over many frames.

CasADi's virtual machine runs a frame's instructions one number at a time, 5 to 10 ns each.  The same list run by NumPy
on vectors of frames costs 1 to 2 ns a number: the interpreter's share is divided by the length of the vector.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np

from gmr_traj.kernels.frame_program import IF_ELSE_ZERO, CompiledMachine, Listing
from gmr_traj.kernels.library import kernels

# Frames at a time: enough to spread the interpreter's overhead, few enough for the registers to stay in the cache.
_CHUNK = 4096

_UNARY: dict[int, Any] = {
    ca.OP_ASSIGN: np.positive,
    ca.OP_NEG: np.negative,
    ca.OP_EXP: np.exp,
    ca.OP_LOG: np.log,
    ca.OP_SQRT: np.sqrt,
    ca.OP_SQ: np.square,
    ca.OP_SIN: np.sin,
    ca.OP_COS: np.cos,
    ca.OP_TAN: np.tan,
    ca.OP_ASIN: np.arcsin,
    ca.OP_ACOS: np.arccos,
    ca.OP_ATAN: np.arctan,
    ca.OP_TANH: np.tanh,
    ca.OP_FABS: np.fabs,
    ca.OP_SIGN: np.sign,
    ca.OP_INV: np.reciprocal,
    ca.OP_NOT: np.logical_not,
    ca.OP_FLOOR: np.floor,
    ca.OP_CEIL: np.ceil,
}
_BINARY: dict[int, Any] = {
    ca.OP_ADD: np.add,
    ca.OP_SUB: np.subtract,
    ca.OP_MUL: np.multiply,
    ca.OP_DIV: np.divide,
    ca.OP_POW: np.power,
    ca.OP_CONSTPOW: np.power,
    ca.OP_LT: np.less,
    ca.OP_LE: np.less_equal,
    ca.OP_EQ: np.equal,
    ca.OP_NE: np.not_equal,
    ca.OP_AND: np.logical_and,
    ca.OP_OR: np.logical_or,
    ca.OP_FMIN: np.fmin,
    ca.OP_FMAX: np.fmax,
    ca.OP_ATAN2: np.arctan2,
    ca.OP_COPYSIGN: np.copysign,
    ca.OP_IF_ELSE_ZERO: IF_ELSE_ZERO,
}


@dataclass(frozen=True)
class Instructions:
    """A function as a list of operations on registers.

    Attributes:
        steps: (NumPy's function, sources, target); each the index of a vector: the registers come first, then the
            entries of all inputs, then those of all outputs.
        constants: (register, value).
        registers: how many there are.
    """

    steps: tuple[tuple[Any, ...], ...]
    constants: tuple[tuple[int, float], ...]
    registers: int

    @cached_property
    def _listings(self) -> dict[bool, Listing | None]:
        return {}

    def listing(self, library: ctypes.CDLL, numpy: bool) -> Listing | None:
        """The same for the compiled kernels, with NumPy's functions or with CasADi's; None where there are none."""
        if numpy not in self._listings:
            try:
                made = Listing(self.steps, self.constants, self.registers, library, numpy)
            except LookupError:
                made = None
            self._listings[numpy] = made
        return self._listings[numpy]


@lru_cache(maxsize=4096)
def instructions(function: ca.Function) -> Instructions | None:
    """The list of an SX function; None where it has an operation that is not known here.

    CasADi reuses a register once its value is no longer needed.  Constants get registers of their own, which are
    filled once, and inputs are read where they are.
    """
    work = int(function.sz_w())
    constants: dict[float, int] = {}
    alias: dict[int, int | tuple[int, int]] = {}  # a register of CasADi's that is a constant or an input
    steps: list[tuple[Any, ...]] = []
    for k in range(function.n_instructions()):
        op = function.instruction_id(k)
        sources, targets = function.instruction_input(k), function.instruction_output(k)
        if op == ca.OP_CONST:
            alias[targets[0]] = constants.setdefault(function.instruction_constant(k), work + len(constants))
            continue
        if op == ca.OP_INPUT:
            alias[targets[0]] = (sources[0], sources[1])
            continue
        named = [alias.get(source, source) for source in sources]
        if op == ca.OP_OUTPUT:
            steps.append((np.positive, named[0], (targets[0], targets[1])))
            continue
        alias.pop(targets[0], None)
        if op in _BINARY:
            steps.append((_BINARY[op], *named[:2], targets[0]))
        elif op in _UNARY:
            steps.append((_UNARY[op], named[0], targets[0]))
        elif op == ca.OP_TWICE:
            steps.append((np.add, named[0], named[0], targets[0]))
        else:
            return None
    filled = tuple((register, value) for value, register in constants.items())
    registers = work + len(constants)
    sizes = [function.nnz_in(k) for k in range(function.n_in())]
    first_input = registers + np.concatenate([[0], np.cumsum(sizes)])
    sizes = [function.nnz_out(k) for k in range(function.n_out())]
    first_output = first_input[-1] + np.concatenate([[0], np.cumsum(sizes)])

    def vector(named: int | tuple[int, int], first: np.ndarray) -> int:
        return int(first[named[0]]) + named[1] if isinstance(named, tuple) else named

    numbered = tuple(
        (operation, *(vector(source, first_input) for source in sources), vector(target, first_output))
        for operation, *sources, target in steps
    )
    return Instructions(numbered, filled, registers)


_SPACE = [np.zeros(0)]


def _registers(count: int, width: int) -> np.ndarray:
    """Space to compute in, one for all functions: every use overwrites it.  # (count, width)"""
    if _SPACE[0].size < count * width:
        _SPACE[0] = np.zeros(count * width)
    return _SPACE[0][: count * width].reshape(count, width)


class VectorMachine:
    """A list of instructions on given arrays.

    Args:
        program: the list.
        inputs: a column a frame.  # (n, K) each
        outputs: nonzeros of the outputs, written in place.  # (nnz, K) each
    """

    def __init__(self, program: Instructions, inputs: list[np.ndarray], outputs: list[np.ndarray]) -> None:
        self._calls: list[tuple[list[tuple[np.ndarray, float]], list[tuple[Any, ...]]]] = []
        count = inputs[0].shape[1]
        for first in range(0, count, _CHUNK):
            here = slice(first, min(first + _CHUNK, count))
            rows = list(_registers(program.registers, here.stop - first))
            constants = [(rows[register], value) for register, value in program.constants]
            rows += [row for array in (*inputs, *outputs) for row in array[:, here]]
            calls: list[tuple[Any, ...]] = []
            for function, *vectors in program.steps:
                calls.append((_if_else_zero if function is IF_ELSE_ZERO else function, *(rows[k] for k in vectors)))
            self._calls.append((constants, calls))

    def run(self) -> None:
        """Compute the outputs."""
        for constants, calls in self._calls:
            for register, value in constants:
                register[:] = value
            for function, *arguments in calls:
                function(*arguments)


def _if_else_zero(condition: np.ndarray, value: np.ndarray, out: np.ndarray) -> None:
    np.copyto(out, np.where(condition != 0, value, 0.0))


def compiled_machine(
    program: Instructions,
    columns: np.ndarray,
    parameters: np.ndarray,
    outputs: list[np.ndarray],
    numpy: bool,
) -> CompiledMachine | None:
    """The same with the compiled kernels; None where there are none.

    Args:
        program: the list.
        columns: which of the unknowns the entries of the first input are.  # (n, K)
        parameters: the second input.  # (m, K)
        outputs: as above.  # (nnz, K) each
        numpy: whether sines and the like are NumPy's, or those that CasADi calls; they differ in the last bit.
    """
    library = kernels()
    listing = None if library is None else program.listing(library, numpy)
    if library is None or listing is None:
        return None
    return CompiledMachine(library, listing, columns, [parameters, *outputs])
