"""A function of one frame in all frames, an instruction at a time over many frames.

CasADi's virtual machine runs a frame's instructions one number at a time, 5 to 10 ns each.  The same list run by NumPy
on vectors of frames costs 1 to 2 ns a number: the interpreter's share is divided by the length of the vector.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

# Frames at a time: enough to spread the interpreter's overhead, few enough for the registers to stay in the cache.
_CHUNK = 4096

_UNARY: dict[int, Callable[..., Any]] = {
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
_BINARY: dict[int, Callable[..., Any]] = {
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
    ca.OP_IF_ELSE_ZERO: lambda condition, value, out: np.copyto(out, np.where(condition != 0, value, 0.0)),
}


@dataclass(frozen=True)
class Instructions:
    """A function as a list of operations on registers.

    Attributes:
        steps: (NumPy's function, sources, target); a register, or (input or output, entry).
        constants: (register, value).
        registers: how many there are.
    """

    steps: tuple[tuple[Any, ...], ...]
    constants: tuple[tuple[int, float], ...]
    registers: int


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
    return Instructions(tuple(steps), filled, work + len(constants))


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
            self._calls.append(([(rows[register], value) for register, value in program.constants], []))
            calls = self._calls[-1][1]
            for function, *sources, target in program.steps:
                out = outputs[target[0]][target[1], here] if isinstance(target, tuple) else rows[target]
                of = [inputs[s[0]][s[1], here] if isinstance(s, tuple) else rows[s] for s in sources]
                calls.append((function, *of, out))

    def run(self) -> None:
        """Compute the outputs."""
        for constants, calls in self._calls:
            for register, value in constants:
                register[:] = value
            for function, *arguments in calls:
                function(*arguments)
