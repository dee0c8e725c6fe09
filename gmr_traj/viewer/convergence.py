"""How Ipopt got there: objective and infeasibilities by iteration."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from gmr_traj.colours import RGB

if TYPE_CHECKING:
    import rerun as rr

SMALLEST = 1e-12  # what the logarithm of nothing is taken as that of
#: Of what Ipopt records, what tells how it went, with its name for people and its colour.
SHOWN: Mapping[str, tuple[str, RGB]] = {
    "obj": ("objective", (120, 170, 230)),
    "inf_pr": ("constraint violation", (230, 150, 70)),
    "inf_du": ("dual infeasibility", (120, 190, 130)),
}


def log(stream: rr.RecordingStream, trace: Mapping[str, tuple[float, ...]]) -> None:
    """Log one chart of bars each, ``/solver/<key>``: the power of ten by iteration.

    Iterations are no time of the clip, and curves are always drawn over the timeline the viewer is on; bars are not.
    """
    import rerun as rr

    for key in shown(trace):
        exponents = np.log10(np.maximum(np.abs(np.array(trace[key], dtype=float)), SMALLEST))
        stream.log(
            f"/solver/{key}",
            rr.BarChart(exponents, abscissa=np.arange(exponents.size), color=SHOWN[key][1]),
            static=True,
        )


def shown(trace: Mapping[str, tuple[float, ...]]) -> dict[str, str]:
    """What is logged of a trace, by its key in it, with a title."""
    return {key: f"log10 of the {name}, by iteration" for key, (name, _) in SHOWN.items() if trace.get(key)}
