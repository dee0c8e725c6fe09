"""The clocks of a recording: `time` [s], `frame` at the first clip's rate, and `highlight` around what it opens at."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import rerun as rr

TIME, FRAME, HIGHLIGHT = "time", "frame", "highlight"


@dataclass(frozen=True)
class Clock:
    """Puts rows on the timelines.

    A blueprint cannot say where the cursor stands when a recording opens: it stands at the beginning of a timeline.
    So what is to be seen first has a timeline of its own, ``highlight``, which holds the rows of ``window`` once more.

    Attributes:
        fps: frames per second of the timeline ``frame`` [Hz].
        window: begin and end of the timeline ``highlight`` [s]; None for none.
    """

    fps: float
    window: tuple[float, float] | None = None

    def send(
        self,
        stream: rr.RecordingStream,
        path: str,
        seconds: np.ndarray,
        columns: Callable[[np.ndarray], rr.ComponentColumnList],
    ) -> None:
        """Log columns of one entity.

        Rows of a clip with another rate belong to the frame that has begun at their time, so that clips of different
        rates run side by side on either clock.

        Args:
            stream: the recording.
            path: the entity.
            seconds: time of each row, ascending [s].  # (N,)
            columns: makes the columns of the rows whose indices it is given.
        """
        import rerun as rr

        frames = np.floor(seconds * self.fps + 1e-6).astype(np.int64)
        index = [rr.TimeColumn(TIME, duration=seconds), rr.TimeColumn(FRAME, sequence=frames)]
        stream.send_columns(path, indexes=index, columns=columns(np.arange(len(seconds))))
        if self.window is None:
            return
        begin, end = self.window
        rows = np.flatnonzero((seconds >= begin) & (seconds <= end))
        if not rows.size or seconds[rows[0]] > begin:  # what held before goes on to hold
            rows = np.append(np.flatnonzero(seconds < begin)[-1:], rows)
        if rows.size:
            index = [rr.TimeColumn(HIGHLIGHT, duration=np.maximum(seconds[rows], begin))]
            stream.send_columns(path, indexes=index, columns=columns(rows))
