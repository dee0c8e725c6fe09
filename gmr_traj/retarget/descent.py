"""Gradient descent step rules, with the constants of PyTorch's optimisers of the same names."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from gmr_traj.exceptions import ResourceError


class StepRule(Protocol):
    """Turns gradients into steps; remembers those it has seen."""

    def step(self, gradient: np.ndarray) -> np.ndarray:
        """The change of the variable for its gradient, both of one shape."""


class Adam:
    """Adam (Kingma and Ba, 2015) without weight decay.

        m <- 0.9 m + 0.1 g,   v <- 0.999 v + 0.001 g^2,
        step k = -rate (m / (1 - 0.9^k)) / (sqrt(v / (1 - 0.999^k)) + 1e-8)

    Args:
        rate: learning rate.
    """

    _FIRST, _SECOND, _EPSILON = 0.9, 0.999, 1e-8

    def __init__(self, rate: float) -> None:
        self._rate, self._count = rate, 0
        self._mean: np.ndarray | float = 0.0
        self._square: np.ndarray | float = 0.0

    def step(self, gradient: np.ndarray) -> np.ndarray:
        """The change of the variable for its gradient."""
        self._count += 1
        self._mean = self._FIRST * self._mean + (1.0 - self._FIRST) * gradient
        self._square = self._SECOND * self._square + (1.0 - self._SECOND) * gradient**2
        mean = self._mean / (1.0 - self._FIRST**self._count)
        square = self._square / (1.0 - self._SECOND**self._count)
        return -self._rate * mean / (np.sqrt(square) + self._EPSILON)


class Adadelta:
    """Adadelta (Zeiler, 2012).

        s <- 0.9 s + 0.1 g^2,   d = sqrt(u + 1e-6) / sqrt(s + 1e-6) g,   u <- 0.9 u + 0.1 d^2,   step = -rate d

    Gradients well below 1e-3 give ``d = g``: plain gradient descent with the learning rate.

    Args:
        rate: learning rate.
    """

    _DECAY, _EPSILON = 0.9, 1e-6

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._square: np.ndarray | float = 0.0
        self._moved: np.ndarray | float = 0.0

    def step(self, gradient: np.ndarray) -> np.ndarray:
        """The change of the variable for its gradient."""
        self._square = self._DECAY * self._square + (1.0 - self._DECAY) * gradient**2
        change = np.sqrt(self._moved + self._EPSILON) / np.sqrt(self._square + self._EPSILON) * gradient
        self._moved = self._DECAY * self._moved + (1.0 - self._DECAY) * change**2
        return -self._rate * change


def step_rule(name: str, rate: float) -> StepRule:
    """A step rule by name.

    Raises:
        ResourceError: there is none of that name.
    """
    rules: dict[str, type[Adam] | type[Adadelta]] = {"adam": Adam, "adadelta": Adadelta}
    if name not in rules:
        raise ResourceError(f"there is no optimiser {name!r}; there are {', '.join(rules)}")
    return rules[name](rate)
