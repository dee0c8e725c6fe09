"""The one interface of all terms."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from gmr_traj.residuals import Residual
from gmr_traj.terms.context import Context
from gmr_traj.variables import Variables


@dataclass(frozen=True)
class Term(ABC):
    """A term of the problem; its fields are what a problem file can set, all with their units in the name's text.

    Residuals are divided by a *scale*: a cost is ``1/2 int (r / scale)^2 dt`` over the clip, so that scales read as
    "a deviation of this size, kept up for the whole clip, costs one half a second", whatever the frame rate.
    """

    uses: ClassVar[tuple[str, ...]] = ("cost", "hard", "soft")
    #: Whether it is about forces: then every frame in which the robot does not fall freely needs a stance.
    dynamic: ClassVar[bool] = False

    def complaint(self) -> str:
        """What is wrong with the fields taken together, in words; empty if nothing is."""
        near, clearance = (getattr(self, name, None) for name in ("near", "clearance"))
        if near is None or clearance is None or near > clearance:
            return ""
        return f"near is {near:g}, not above clearance, {clearance:g}: rows that are violated are not built"

    @abstractmethod
    def residuals(self, context: Context, variables: Variables) -> list[Residual]:
        """The term's residuals about the context's centre motion."""
