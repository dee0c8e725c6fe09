"""What a retargeting method is given beside motion, robot and map, and what it gives back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gmr_traj.exceptions import GmrTrajError
from gmr_traj.references import BodyTargets

#: ``(stage, done, total)``, called as the work goes on.
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Options:
    """Choices that every method understands.

    Attributes:
        velocity_limit: no joint moves faster than this factor times its velocity limit; None for no limit.
        progress: is told how far the work is.

    Raises:
        GmrTrajError: the factor is not a positive number.
    """

    velocity_limit: float | None = None
    progress: Progress | None = None

    def __post_init__(self) -> None:
        factor = self.velocity_limit
        if factor is not None and not (np.isfinite(factor) and factor > 0):
            raise GmrTrajError(f"the velocity limit is {factor:g} times the joints' own; expected a positive factor")


@dataclass(frozen=True)
class Solved:
    """What a method found.

    Attributes:
        qpos: configurations.  # (T, 7 + n)
        targets: what it followed, in the same world as ``qpos``.
        raised: by how much the clip was raised as a whole [m].
        steps: inverse kinematics steps, all frames together.
        notes: what the user should know, one sentence each.
        fps: frames per second, where the method does not keep the person's [Hz].
    """

    qpos: np.ndarray
    targets: BodyTargets
    raised: float = 0.0
    steps: int = 0
    notes: tuple[str, ...] = ()
    fps: float | None = None
