"""A robot clip and the human motion that it is a retarget of, brought together: in time, and in the world.

Files hold no common clock and no common world.  Both are taken to begin at the same moment; the person is turned about
the vertical by one angle and shifted by one vector, so that the bodies are where the clip has them in the least squares
of all frames (vertically: in the median, because feet in swing differ).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.exceptions import ClipError
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.metrics.faithfulness import planar_alignment
from gmr_traj.motion import RobotMotion
from gmr_traj.references import BodyTargets
from gmr_traj.resampling import resample_schedule, resample_targets, same_rate
from gmr_traj.robot import Robot

#: Frames by which a clip and its source may differ in length: retargeters drop the first, resamplers the last.
FRAMES = 2

#: Farther apart than this in the mean, seen from the base, the two are no retarget of each other [m].
ALIKE = 0.35


@dataclass(frozen=True)
class Joined:
    """A source as it belongs to a clip.

    Attributes:
        targets: in the clip's world and frames.
        stances: in the clip's frames; None where the source's contacts are not known.
        notes: what was done to bring the two together, one sentence each.
    """

    targets: BodyTargets
    stances: ContactSchedule | None
    notes: tuple[str, ...]


def join(
    name: str,
    targets: BodyTargets,
    fps: float,
    motion: RobotMotion,
    robot: Robot,
    stances: ContactSchedule | None = None,
) -> Joined:
    """Bring a source to a clip.

    Args:
        name: what to call the source.
        targets: where the scaled person has the robot's bodies.
        fps: the person's frame rate [Hz].
        motion: the clip.
        robot: its robot.
        stances: the person's contacts, in frames of the person; None where they are not known.

    Raises:
        ClipError: the two differ in length by more than ``FRAMES``, or in what they do.
    """
    notes = []
    targets = resample_targets(targets.of(robot.body_names), fps, motion.fps)
    if not targets.names:
        raise ClipError(f"{name}: the map has no target for any body of {robot.name}")
    if not same_rate(fps, motion.fps):
        notes.append(f"{name} is resampled from {fps:g} Hz to the clip's {motion.fps:g} Hz")
    if abs(targets.frames - motion.frames) > FRAMES:
        raise ClipError(
            f"{name} lasts {targets.frames / motion.fps:.2f} s, the clip {motion.duration:.2f} s; they must be "
            "the same seconds of the same motion: cut the longer one"
        )
    at = np.minimum(np.arange(motion.frames), targets.frames - 1)
    targets = replace(targets, positions=targets.positions[at], quaternions=targets.quaternions[at])
    reached = targets.reached(robot.body_names, *placements(robot, motion.qpos))
    turn, shift = _to_the_clip(targets, reached)
    if abs(turn) > np.radians(1.0) or np.linalg.norm(shift) > 0.01:
        notes.append(
            f"{name} is turned by {np.degrees(turn):.0f} degrees and shifted by {np.linalg.norm(shift):.2f} m "
            "to where the clip is"
        )
    yaw = Rotation.from_euler("z", turn)
    turned = yaw * Rotation.from_quat(targets.quaternions.reshape(-1, 4), scalar_first=True)
    targets = replace(
        targets,
        positions=targets.positions @ yaw.as_matrix().T + shift,
        quaternions=turned.as_quat(scalar_first=True).reshape(targets.quaternions.shape),
    )
    _check(targets, reached, robot.body_names[0], name)
    if stances is not None:
        stances = resample_schedule(stances, motion.fps, motion.frames)
    return Joined(targets, stances, tuple(notes))


def _to_the_clip(targets: BodyTargets, reached: np.ndarray) -> tuple[float, np.ndarray]:
    """The turn about the vertical [rad] and the shift [m] that bring the targets to what the clip reached."""
    placed = targets.position_weights > 0
    there, here = reached[:, placed], targets.positions[:, placed]
    turn, shift = planar_alignment(here, there)
    shift[2] = np.median(there[..., 2] - here[..., 2]) if here.size else 0.0
    return turn, shift


def _check(targets: BodyTargets, reached: np.ndarray, base: str, name: str) -> None:
    """Refuse a source whose bodies, seen from the base, are nowhere near the clip's."""
    if base not in targets.names:
        return
    b = targets.names.index(base)
    away = reached - targets.positions
    apart = float(np.linalg.norm(away - away[:, [b]], axis=-1).mean())
    if apart > ALIKE:
        raise ClipError(
            f"{name} does not do what the clip does: seen from the base, bodies are {100 * apart:.0f} cm apart in the "
            "mean; is it the right file, and the right map?"
        )
