"""What is compared: figures by name, with unit and the direction that is better."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Metric:
    """One row of a comparison.

    Attributes:
        key: its name in JSON.
        title: what it is called in tables.
        unit: unit of its values; empty for a count or a ratio.
        better: whether ``less`` or ``more`` of it is better.
    """

    key: str
    title: str
    unit: str
    better: Literal["less", "more"] = "less"


@dataclass(frozen=True)
class Measure:
    """One cell of a comparison.

    Attributes:
        value: the figure, None where there is none (no stance, nothing to compare with).
        where: the joint, sole, body or pair it was found at; empty where there is none.
    """

    value: float | None
    where: str = ""
