"""The unknowns of one problem: a tangent step a frame, and what terms add."""

from __future__ import annotations

import numpy as np

#: Largest component of a step of the base's rotation [rad]; see :class:`Variables`.
HALF_TURN = np.pi


class Variables:
    """Numbers the unknowns.

    The first ``frames * tangent`` unknowns are the tangent steps, frame after frame; terms append blocks of their own
    (anchors, slacks) while the problem is built.  The components of the base's rotation vector stay within half a turn:
    that reaches every rotation, and keeps a large step of the solver from winding the base a full turn around, which
    looks the same in a frame and leaves a spin between it and its neighbours that no later step can undo.

    Args:
        frames: T.
        tangent: size of a tangent step, 6 + n.
    """

    def __init__(self, frames: int, tangent: int) -> None:
        self.frames = frames
        self.tangent = tangent
        self.steps = np.arange(frames * tangent).reshape(frames, tangent)  # (T, 6 + n) indices
        self._initial = [np.zeros(frames * tangent)]
        reach = np.full((frames, tangent), np.inf)
        reach[:, 3:6] = HALF_TURN
        self._lower = [-reach.ravel()]
        self._upper = [reach.ravel()]
        #: Number of unknowns so far.
        self.size = frames * tangent

    def add(self, initial: np.ndarray, lower: float = -np.inf, upper: float = np.inf) -> np.ndarray:
        """Append unknowns with their starting values; returns their indices, in the shape of ``initial``."""
        first = self.size
        self._initial.append(np.ravel(initial).astype(float))
        self._lower.append(np.full(initial.size, lower))
        self._upper.append(np.full(initial.size, upper))
        self.size += initial.size
        return first + np.arange(initial.size).reshape(initial.shape)

    def hold(self, frames: np.ndarray) -> None:
        """Keep the tangent steps of some frames at zero."""
        self._lower[0].reshape(self.frames, self.tangent)[frames] = 0.0
        self._upper[0].reshape(self.frames, self.tangent)[frames] = 0.0

    def initial(self) -> np.ndarray:
        """Starting values, ``(nx,)``."""
        return np.concatenate(self._initial)

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bounds, ``(nx,)`` each."""
        return np.concatenate(self._lower), np.concatenate(self._upper)
