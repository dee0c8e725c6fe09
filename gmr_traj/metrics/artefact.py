"""One fault of a clip: what, where, when and how bad."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from gmr_traj.metrics.intervals import intervals
from gmr_traj.metrics.settings import Settings


@dataclass(frozen=True)
class Artefact:
    """One fault in one place over one stretch of frames.

    Attributes:
        kind: ``velocity``, ``jump``, ``transient``, ``acceleration_spike``, ``joint_limit``, ``slide``, ``float``,
            ``sole_penetration``, ``floor_penetration``, ``self_collision`` or ``height``.
        where: the joint, sole, body or pair of shapes.
        start, stop: frames, half open.
        begin, end: the same in seconds from the clip's start.
        peak: the frame where it is worst.
        value: how bad there, in ``unit``.
        unit: unit of ``value``.
        score: ``value`` relative to what counts as severe in its kind (1 is severe); comparable between kinds.
    """

    kind: str
    where: str
    start: int
    stop: int
    begin: float
    end: float
    peak: int
    value: float
    unit: str
    score: float

    def to_json(self) -> dict[str, Any]:
        """The artefact's attributes, ready for ``json.dumps``."""
        return asdict(self)


@dataclass(frozen=True)
class Collector:
    """Turns signals over the frames of one clip into artefacts.

    Attributes:
        fps: frames per second of the clip.
        settings: ``configs/inspect.toml``.
    """

    fps: float
    settings: Settings

    def frames(self, table: str, key: str) -> int:
        """A duration of the settings in whole frames, at least 1."""
        return max(1, round(self.settings(table, key) * self.fps))

    def artefact(
        self,
        kind: str,
        where: str,
        stretch: tuple[int, int],
        peak: int,
        value: float,
        unit: str = "mm",
        scale: float = 1e3,
    ) -> Artefact:
        """One artefact of ``value`` (in the settings' unit; shown times ``scale`` in ``unit``)."""
        start, stop = stretch
        score = value / self.settings(kind, "severe")
        return Artefact(kind, where, start, stop, start / self.fps, stop / self.fps, peak, value * scale, unit, score)

    def collect(
        self,
        kind: str,
        names: Sequence[str],
        signal: np.ndarray,
        unit: str = "mm",
        scale: float = 1e3,
        flagged: np.ndarray | None = None,
    ) -> list[Artefact]:
        """Artefacts of a signal, one column a place: the stretches where it is above what its kind reports.

        Args:
            kind: kind of artefact, a table of the settings.
            names: the places.  # n
            signal: the signal in the settings' unit.  # (T, n)
            unit: unit of the reported value.
            scale: reported value over the settings' unit.
            flagged: where given, these frames instead of those above the threshold.  # (T, n)
        """
        if flagged is None:
            flagged = signal > self.settings(kind, "report")
        gap = self.frames("merge", "gap")
        found = []
        for column in np.flatnonzero(flagged.any(axis=0)).tolist():
            for start, stop in intervals(flagged[:, column], gap):
                peak = start + int(signal[start:stop, column].argmax())
                value = float(signal[peak, column])
                found.append(self.artefact(kind, names[column], (start, stop), peak, value, unit, scale))
        return found
