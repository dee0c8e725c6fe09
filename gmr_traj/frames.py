"""Functions of one frame, evaluated in many frames into arrays that stay where they are."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from gmr_traj.kernels.frame_program import CompiledMachine
from gmr_traj.kernels.library import kernels
from gmr_traj.vector_machine import VectorMachine, compiled_machine, instructions

# From so many frames on an operation on all of them is cheaper than all operations on each.
_WORTHWHILE = 150

# With compiled kernels that is always so, once a function has been read, which takes as long as so many evaluations.
_WORTHWHILE_COMPILED = 300


class Frames:
    """A function of (z, p) in K frames.

    Args:
        function: (z, p) -> outputs.
        columns: indices of each frame's unknowns.  # (K, nz)
        parameters: p of each frame.  # (np, K)
        evaluations: how often it will be evaluated, about: more than once is worth some preparation.

    Attributes:
        outputs: nonzeros of each output in all frames.  # (nnz, K) each
    """

    def __init__(
        self, function: ca.Function, columns: np.ndarray, parameters: np.ndarray, evaluations: int = 1
    ) -> None:
        count, many = len(columns), len(columns) >= _WORTHWHILE
        self._machine: CompiledMachine | None = None
        sizes = [function.nnz_out(k) for k in range(function.n_out())]
        read = many or (count * evaluations >= _WORTHWHILE_COMPILED and kernels() is not None)
        program = instructions(function) if read else None
        if program is not None:
            self.outputs = [np.zeros((size, count)) for size in sizes]
            parameters = np.ascontiguousarray(parameters, float)
            self._machine = compiled_machine(program, columns.T, parameters, self.outputs, many)
            if self._machine is not None:
                return
            if many:
                self._columns = np.ascontiguousarray(columns.T)
                self._unknowns = np.zeros(self._columns.shape)
                self._run = VectorMachine(program, [self._unknowns, parameters], self.outputs).run
                return
        # CasADi keeps a frame's numbers together.
        self._columns = columns
        self._unknowns = np.zeros(columns.shape)
        parameters = np.ascontiguousarray(parameters.T, float)
        outputs = [np.zeros((count, size)) for size in sizes]
        self.outputs = [output.T for output in outputs]
        buffer: Any  # CasADi's stubs ask for a size that its binding takes from the array
        buffer, self._run = function.map(count).buffer()
        self._kept = (buffer, parameters, outputs)  # the buffer holds addresses alone
        for k, array in enumerate((self._unknowns, parameters)):
            buffer.set_arg(k, array.data)
        for k, array in enumerate(outputs):
            buffer.set_res(k, array.data)

    def at(self, x: np.ndarray) -> None:
        """Evaluate at the unknowns of a program."""
        if self._machine is not None:
            self._machine.run(x)
            return
        np.take(x, self._columns, out=self._unknowns)
        self._run()


def evaluated(function: ca.Function, columns: np.ndarray, parameters: np.ndarray, x: np.ndarray) -> np.ndarray:
    """A function with one column as output, at one point only; see :class:`Frames`.

    Returns:
        a column a frame, structural zeros filled in.  # (m, K)
    """
    frames = Frames(function, columns, parameters)
    frames.at(x)
    return filled(function, frames.outputs[0])


def filled(function: ca.Function, nonzeros: np.ndarray) -> np.ndarray:
    """The first output's nonzeros with its structural zeros among them.

    Args:
        function: whose output is a column of m.
        nonzeros: of all frames.  # (nnz, K)
    """
    m = function.size1_out(0)
    if len(nonzeros) == m:
        return nonzeros
    out = np.zeros((m, nonzeros.shape[1]))
    out[function.sparsity_out(0).row()] = nonzeros
    return out
