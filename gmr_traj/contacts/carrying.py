"""Stances that height and speed do not show: unless a robot falls freely, something carries it.

A retargeted foot hovers over the floor and skates, so that a stance is missed, begins late or ends early.  The vertical
acceleration of the centre of mass c says when the floor must press:

    load = 1 + c_z'' / g

is near zero in flight only.  Frames with a load and no point that could bear it are *gaps*.  They are closed by
holding the stance before a gap longer and the one after it from earlier on, and by the points that are lowest and
slowest there, with thresholds widened step by step; where that would take a point far from where it stands the gap
remains.  Then stances of different points are made to overlap where the load would pass from one to the other at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from gmr_traj.constants import GRAVITY
from gmr_traj.contacts.detect import placed_sole_points
from gmr_traj.contacts.headings import headings
from gmr_traj.contacts.held_longer import Standing
from gmr_traj.contacts.mask import from_mask, limbs_to_mask, owners, to_mask
from gmr_traj.contacts.rest import DetectionSettings, rest_runs
from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot
from gmr_traj.runs import runs

_SHORTEST = 3  # frames: a point that bears a load stands in the frame before and in the frame after


@dataclass(frozen=True)
class CarryingSettings:
    """When a stance is added.

    Attributes:
        spread: standard deviation of the Gaussian that smooths the height of the centre of mass [s].
        loaded: load from which on something must carry the robot [-].
        widened: factors of the thresholds of height, tried in turn,
        hastened: and those of speed.
        farthest: largest distance of a point from where it stands, in frames that are added to a stance [m].
        handover: time for which two stances overlap when one takes over from the other [s],
        nearby: where that takes a point no farther than this from where it stands [m].
    """

    spread: float = 0.05
    loaded: float = 0.3
    widened: tuple[float, ...] = (1.5, 2.0, 3.0)
    hastened: tuple[float, ...] = (1.2, 1.5, 2.0)
    farthest: float = 0.06
    handover: float = 0.1
    nearby: float = 0.04


def carrying(
    schedule: ContactSchedule,
    motion: RobotMotion,
    robot: Robot,
    detection: DetectionSettings | None = None,
    settings: CarryingSettings | None = None,
) -> ContactSchedule:
    """A schedule with the stances added that must carry the robot.

    Args:
        schedule: detected stances.
        motion: the clip they were detected on.
        robot: its robot.
        detection: thresholds they were detected with; by default those of detection.
        settings: how far to go.
    """
    detection, settings = detection or DetectionSettings(), settings or CarryingSettings()
    placed = placements(robot, motion.qpos)
    points = placed_sole_points(robot, placed)
    resting = to_mask(schedule, robot)
    parts: dict[tuple[str, str], list[int]] = {}
    for k, (sole, _, part) in enumerate(owners(robot)):
        parts.setdefault((sole, part), []).append(k)
    above = points[..., 2] + schedule.height
    facing = np.repeat(headings(points, robot), [len(sole.points) for sole in robot.soles], axis=1)
    standing = Standing(resting, points, above, facing, list(parts.values()), settings.farthest)
    height = centre_height(robot, *placed)
    loaded = load(height, motion.fps, settings.spread) > settings.loaded
    loaded &= ~bearing(limbs_to_mask(schedule, robot)).any(axis=1)  # hands or knees bear it
    _hold(standing, loaded)
    for wide, fast in zip(settings.widened, settings.hastened, strict=True):
        easier = replace(
            detection,
            enter_height=wide * detection.enter_height,
            leave_height=wide * detection.leave_height,
            enter_speed=fast * detection.enter_speed,
            leave_speed=fast * detection.leave_speed,
        )
        _find(standing, loaded, rest_runs(points, standing.height, motion.fps, easier))
        _hold(standing, loaded)
    _hand_over(standing, round(settings.handover * motion.fps), settings.nearby)
    return from_mask(schedule, robot, resting)


def load(height: np.ndarray, fps: float, spread: float) -> np.ndarray:
    """Vertical force from outside over the weight, ``1 + c_z'' / g``, of a smoothed height c_z [m].  # (T,)"""
    if len(height) < 3:
        return np.ones(len(height))
    smooth = gaussian_filter1d(height, spread * fps, mode="nearest")
    inner = np.diff(smooth, 2) * fps**2 / GRAVITY
    return 1.0 + np.concatenate([inner[:1], inner, inner[-1:]])


def bearing(resting: np.ndarray) -> np.ndarray:
    """Frames in which a point can bear a load: it stands there and in both neighbours, so it is at rest.  # (T, K)"""
    able = resting.copy()
    able[1:] &= resting[:-1]
    able[:-1] &= resting[1:]
    return able


def centre_height(robot: Robot, positions: np.ndarray, rotations: np.ndarray) -> np.ndarray:
    """Height of the centre of mass [m], ``(T,)``, from the placements of the bodies."""
    body = [robot.model.body(name).id for name in robot.body_names]
    mass = robot.model.body_mass[body]
    height = positions[..., 2] + np.einsum("tbj,bj->tb", rotations[..., 2, :], robot.model.body_ipos[body])
    return np.asarray(height @ (mass / mass.sum()))


def _gaps(standing: Standing, loaded: np.ndarray) -> list[tuple[int, int]]:
    """Runs of loaded frames without a point that can bear a load, first and last frame."""
    gap = loaded & ~bearing(standing.resting).any(axis=1)
    return [(start, stop - 1) for start, stop in runs(gap)]


def _find(standing: Standing, loaded: np.ndarray, resting: Sequence[Sequence[tuple[int, int]]]) -> None:
    """Put points in stance that rest, by wider thresholds, in a gap."""
    for k, own in enumerate(resting):
        for first, last in _gaps(standing, loaded):
            for run in own:
                if run[1] <= first - 2:
                    continue
                if run[0] >= last + 3:
                    break  # they are in order
                start, stop = max(run[0], first - 2), min(run[1], last + 3)
                if stop - start >= _SHORTEST:
                    start, stop = standing.near(k, start, stop)
                if stop - start >= _SHORTEST:
                    standing.add([k], start, stop)


def _hold(standing: Standing, loaded: np.ndarray) -> None:
    """Hold the stance before each gap longer, and the one after it from earlier on, until they meet."""
    frames = len(loaded)
    for first, last in _gaps(standing, loaded):
        before, until = standing.neighbours(first, last, first, -1)
        after, since = standing.neighbours(first, last, last, +1)
        # Bear up to `split` on what was there and from then on on what comes; the farther of the two ends counts.
        choices = []
        for split in range(first - 1, last + 1):
            held = until[min(split + 1, frames - 1)] if split >= first else 0.0
            early = since[max(split, 0)] if split < last else 0.0
            choices.append((max(held, early), split))
        far, split = min(choices)
        if far > standing.farthest:
            continue
        if split >= first:
            standing.add(before, max(0, first - 1), min(split + 2, frames))
        if split < last:
            standing.add(after, max(0, split), min(last + 2, frames))


def _hand_over(standing: Standing, wanted: int, nearby: float) -> None:
    """Let stances overlap by ``wanted`` frames in which both bear, where the load passes from one to the other.

    A load that jumps from foot to foot is a jump of the joints' torques.  Frame by frame, the stance that ends is held
    longer or the one that begins starts earlier, whichever moves a point less.
    """
    for ending, last, coming, first in list(standing.changes(bearing(standing.resting), reach=wanted + 1)):
        # The toe of a foot may have been seen to already when it is its heel's turn.
        last, first = standing.run(ending[0], last, last + 1)[1] - 1, standing.run(coming[0], first, first + 1)[0]
        while last - first + 1 < wanted + 2:
            longer = standing.away(ending, last, last + 1)
            earlier = standing.away(coming, first, first - 1)
            if min(longer, earlier) > nearby:
                break
            if longer <= earlier:
                if not standing.add(ending, last, last + 2):
                    break
                last += 1
            else:
                if not standing.add(coming, first - 1, first + 1):
                    break
                first -= 1
