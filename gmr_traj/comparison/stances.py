"""The one contact schedule by which the feet of all clips are judged."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.contacts.detect import detect
from gmr_traj.contacts.rest import DetectionSettings, rest_runs
from gmr_traj.contacts.schedule import LIMB, ContactSchedule, Stance
from gmr_traj.metrics.intervals import intervals
from gmr_traj.motion import RobotMotion
from gmr_traj.references import BodyTargets
from gmr_traj.robot import Robot


def from_targets(targets: BodyTargets, robot: Robot, fps: float) -> ContactSchedule | None:
    """Stances of the soles where the scaled person has them, by the thresholds of ``contacts.detect``.

    The sole points are carried along by the target placement of their body.

    Returns:
        The schedule; None where the targets lack position or orientation of a body with a sole.
    """
    settings = DetectionSettings()
    points, owners = [], []
    for sole in robot.soles:
        if sole.body not in targets.names:
            return None
        b = targets.names.index(sole.body)
        if not (targets.position_weights[b] > 0.0 and targets.orientation_weights[b] > 0.0):
            return None
        turn = Rotation.from_quat(targets.quaternions[:, b], scalar_first=True).as_matrix()  # (T, 3, 3)
        local = sole.points - targets.points[b]
        points.append(targets.positions[:, b, None] + local @ turn.transpose(0, 2, 1))
        owners += [(sole.name, k, part) for k, part in enumerate(sole.parts)]
    placed = np.concatenate(points, axis=1)  # (T, K, 3)
    height = placed[..., 2] - np.quantile(placed[..., 2].min(axis=1), settings.level_quantile)
    runs = rest_runs(placed, height, fps, settings)
    stances = [Stance(*owner, *run) for owner, own in zip(owners, runs, strict=True) for run in own]
    return ContactSchedule(targets.frames, fps, tuple(sorted(stances)))


def by_vote(motions: Sequence[RobotMotion], robot: Robot) -> ContactSchedule:
    """Stances of the soles that at least half of the clips have, each found on its own clip by ``contacts.detect``.

    A point that half of the clips have at rest is in stance for all, so no clip gets better by being airborne.
    Stances shorter than ``DetectionSettings.shortest`` are dropped.

    Args:
        motions: clips of the same frames and frame rate.
        robot: their robot.
    """
    frames, fps = motions[0].frames, motions[0].fps
    slots = [(sole.name, k, part) for sole in robot.soles for k, part in enumerate(sole.parts)]
    votes = np.zeros((frames, len(slots)))
    for motion in motions:
        for s in (s for s in detect(motion, robot).stances if s.part != LIMB):
            votes[s.start : s.stop, slots.index((s.sole, s.point, s.part))] += 1.0
    shortest = max(3, round(DetectionSettings().shortest * fps))
    stances = [
        Stance(*slot, start, stop)
        for column, slot in enumerate(slots)
        for start, stop in intervals(votes[:, column] >= 0.5 * len(motions), 1)
        if stop - start >= shortest
    ]
    return ContactSchedule(frames, fps, tuple(sorted(stances)))
