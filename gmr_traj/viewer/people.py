"""The person a motion came from, and where the robot's bodies were meant to be."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from gmr_traj import colours
from gmr_traj.human_motion import HumanMotion
from gmr_traj.references import BodyTargets
from gmr_traj.viewer.motion_columns import placements
from gmr_traj.viewer.timelines import Clock

if TYPE_CHECKING:
    import rerun as rr

HUMAN, TARGETS, FRAME = "/world/human", "/world/targets", "human"
BONE, JOINT, TARGET = 0.012, 0.02, 0.022  # radii [m]


def log_human(stream: rr.RecordingStream, human: HumanMotion, clock: Clock) -> None:
    """Log the skeleton: a line from every joint to its parent, a point at every joint."""
    import rerun as rr

    seconds, root = np.arange(human.frames) / human.fps, human.positions[:, 0]
    placed = human.positions - root[:, None]  # about the root, so that the eye can follow its frame
    children = [j for j, parent in enumerate(human.parents) if parent >= 0]
    parents = [human.parents[j] for j in children]
    bones = np.stack([placed[:, parents], placed[:, children]], axis=2)  # (T, J - 1, 2, 3)
    clock.send(stream, "/tf/human", seconds, placements(root.astype(np.float32), None, FRAME))
    for path, look in (
        (f"{HUMAN}/bones", rr.LineStrips3D.from_fields(radii=[BONE], colors=[colours.HUMAN])),
        (f"{HUMAN}/joints", rr.Points3D.from_fields(radii=[JOINT], colors=[colours.HUMAN])),
    ):
        stream.log(path, rr.CoordinateFrame(FRAME), look, static=True)
    clock.send(stream, f"{HUMAN}/bones", seconds, _many(rr.LineStrips3D, "strips", bones))
    clock.send(stream, f"{HUMAN}/joints", seconds, _many(rr.Points3D, "positions", placed))


def log_targets(stream: rr.RecordingStream, targets: BodyTargets, seconds: np.ndarray, clock: Clock) -> None:
    """Log a point where each body was meant to be at the given times [s]."""
    import rerun as rr

    stream.log(
        TARGETS,
        rr.Points3D.from_fields(radii=[TARGET], colors=[colours.TARGET], labels=targets.names, show_labels=False),
        static=True,
    )
    clock.send(stream, TARGETS, seconds, _many(rr.Points3D, "positions", targets.positions))


def _many(
    archetype: type[rr.Points3D] | type[rr.LineStrips3D], name: str, values: np.ndarray
) -> Callable[[np.ndarray], rr.ComponentColumnList]:
    """Makes the columns of an archetype with as many instances in every row, values (T, K, ...)."""
    small = values.astype(np.float32)

    def columns(rows: np.ndarray) -> rr.ComponentColumnList:
        made = archetype.columns(**{name: small[rows].reshape(-1, *values.shape[2:])})
        return made.partition([values.shape[1]] * len(rows))

    return columns
