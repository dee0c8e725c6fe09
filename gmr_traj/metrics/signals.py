"""The signals of a clip over its frames whose extremes and means are its figures: what the plots show."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.metrics import joints
from gmr_traj.metrics.observation import Observation
from gmr_traj.metrics.self_collision import clearance
from gmr_traj.metrics.stances import stance_tracks

REACH = 0.05  # [m] capsules farther apart than this are as good as free


@dataclass(frozen=True)
class Signal:
    """One quantity over the frames of one clip.

    Attributes:
        name: e.g. ``joint_speed``; what it is called in files.
        title: what it is, for people.
        unit: unit of the values.
        values: one a frame, NaN where there is none (a foot's slide while it swings).  # (T,)
        bar: a value that must not be passed, None where there is none.
        artefacts: kinds of artefact (of :class:`gmr_traj.metrics.Artefact`) that show in it.
    """

    name: str
    title: str
    unit: str
    values: np.ndarray
    bar: float | None = None
    artefacts: tuple[str, ...] = ()


def signals(observation: Observation, schedule: ContactSchedule) -> tuple[Signal, ...]:
    """The signals of a clip as it is, over the stances given.

    - Joint speed: ``max_j |q_j[t] - q_j[t-1]| / (dt v_j)`` with v_j the joint's velocity limit; none in frame 0.
    - Joint acceleration: ``max_j |q_j[t+1] - 2 q_j[t] + q_j[t-1]| / dt^2``; none in the first and last frame.
    - Soles: least height of the points and outlines of all soles.
    - Stance: largest height of a sole point in stance.
    - Slide: largest ``||f_xy[t] - f_xy[t-1]|| / dt`` of a sole point in stance.
    - Base: its height.
    - Clearance: distance of the two closest collision shapes, negative where they overlap, at most 50 mm.

    Raises:
        ScheduleError: where the schedule does not fit the clip or the robot.
    """
    motion, robot = observation.motion, observation.robot
    speed, acceleration = np.full(motion.frames, np.nan), np.full(motion.frames, np.nan)
    speed[1:] = (np.abs(joints.velocities(motion)) / robot.velocity_limit).max(axis=1)
    if motion.frames > 2:
        acceleration[1:-1] = np.abs(joints.accelerations(motion)).max(axis=1)
    radii = np.array([capsule.radius for capsule in robot.capsules])
    free = clearance(observation.starts, observation.ends, radii, robot.collision_pairs, REACH)
    jumps = ("jump", "transient")
    found = [
        Signal("joint_speed", "Fastest joint", "% of its limit", 100.0 * speed, 100.0, (*jumps, "velocity")),
        Signal(
            "joint_acceleration",
            "Largest joint acceleration",
            "rad/s\u00b2",
            acceleration,
            artefacts=(*jumps, "acceleration_spike"),
        ),
    ]
    if robot.soles:
        lowest = 1e3 * sole_heights(observation).min(axis=1)
        height, slide = _in_stance(observation, schedule)
        found += [
            Signal("sole_height", "Lowest point of the soles", "mm", lowest, 0.0, ("sole_penetration",)),
            Signal("stance_height", "Highest point of a foot in stance", "mm", height, 0.0, ("float",)),
            Signal("slide", "Slide of the feet in stance", "mm/s", slide, artefacts=("slide",)),
        ]
    found += [
        Signal("clearance", "Clearance between limbs", "mm", 1e3 * free, 0.0, ("self_collision",)),
        Signal("base_height", "Height of the base", "m", motion.qpos[:, 2].copy()),
    ]
    return tuple(found)


def sole_heights(observation: Observation) -> np.ndarray:
    """Least height of the points and the outline of each sole (T, S) [m]."""
    return np.stack(
        [
            np.concatenate([points, outline], axis=1)[..., 2].min(axis=1)
            for points, outline in zip(observation.soles, observation.outlines, strict=True)
        ],
        axis=1,
    )


def _in_stance(observation: Observation, schedule: ContactSchedule) -> tuple[np.ndarray, np.ndarray]:
    """Largest height [mm] and horizontal speed [mm/s] of a sole point in stance, NaN in frames where none is.

    Each (T,); the speed of a step belongs to the frame it leads to.
    """
    height, slide = np.full((2, observation.motion.frames), np.nan)
    for track in stance_tracks(observation, schedule):
        span, steps = slice(track.stance.start, track.stance.stop), slice(track.stance.start + 1, track.stance.stop)
        height[span] = np.fmax(height[span], 1e3 * track.height)
        slide[steps] = np.fmax(slide[steps], 1e3 * track.speed)
    return height, slide
