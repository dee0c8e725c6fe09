"""Lanes of a state timeline: what holds from when to when."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from gmr_traj.colours import RGB
from gmr_traj.viewer.timelines import Clock

if TYPE_CHECKING:
    import rerun as rr


def log_lane(
    stream: rr.RecordingStream,
    path: str,
    states: np.ndarray,
    labels: Mapping[int, str],
    colours: Mapping[int, RGB],
    fps: float,
    clock: Clock,
) -> None:
    """Log one lane: a row where the state changes, and the look of every state.

    Args:
        stream: the recording.
        path: entity of the lane; its last part is what the lane is called.
        states: the state in every frame, -1 for none.  # (T,)
        labels: what each state is called.
        colours: and its colour.
        fps: frames per second of ``states`` [Hz].
        clock: of the recording.
    """
    import rerun as rr

    # One more frame at the end, without a state, so that the last one ends with the clip.
    padded = np.append(states, -1)
    change = np.flatnonzero(np.diff(padded, prepend=-2))
    values = {state: f"{state}" for state in labels}
    stream.log(
        path,
        rr.StateConfiguration(
            values=list(values.values()),
            labels=[labels[state] for state in values],
            colors=[(*colours[state], 255) for state in values],
        ),
        static=True,
    )
    texts = [values.get(int(padded[t]), "") for t in change]
    clock.send(stream, path, change / fps, lambda rows: rr.StateChange.columns(state=[texts[row] for row in rows]))
