"""One promise of the certificate."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Promise:
    """Something the refined clip is held to: ``value <= bar``.

    Attributes:
        name: short name, the figure's where there is one.
        sentence: what is promised.
        held: whether it holds.
        value: the refined clip's figure.
        bar: the most it may be.
        unit: unit of value, bar and before; empty for a count or a ratio.
        where: the joint, sole, body or pair at fault or nearest to it; empty where there is none.
        before: the input's figure, where it has one.
    """

    name: str
    sentence: str
    held: bool
    value: float
    bar: float
    unit: str
    where: str = ""
    before: float | None = None

    def to_json(self) -> dict[str, Any]:
        """The promise's attributes, ready for ``json.dumps``."""
        return asdict(self)
