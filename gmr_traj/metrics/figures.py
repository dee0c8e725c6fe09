"""The figures of one clip: plain numbers, each with its equation."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np

from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.metrics import joints
from gmr_traj.metrics.observation import Observation, observe
from gmr_traj.metrics.stances import StanceTrack, stance_tracks
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot

JUMP_STEP = 0.3  # [rad] a joint that moves further in one frame has jumped
DEEP = 1e-3  # [m] shapes that overlap by less only touch


@dataclass(frozen=True)
class Figures:
    """What a clip measures.  q: joints [rad], f: sole points [m], dt = 1/fps; lengths in **millimetres**.

    A place (``..._joint``, ``..._sole``, ``..._body``, ``..._pair``) is where the extreme value beside it was found,
    empty where there is none.  Over an empty set (no stance, a clip of one frame) a figure is 0.

    Attributes:
        frames, fps, seconds: number of frames T, frames per second, T / fps.
        speed_max: ``max |q[t+1] - q[t]| / dt`` [rad/s].
        speed_ratio: the same relative to each joint's velocity limit; above 1 is over it.
        speed_joint: the joint of ``speed_ratio``.
        over_frames: steps t -> t+1 in which any joint is above its velocity limit.
        limit_frames: frames with a joint outside its range by more than 1e-4 rad.
        limit_excess: largest distance outside the range [rad].
        limit_joint: the joint of ``limit_excess``.
        jumps: steps in which any joint moves by more than 0.3 rad.
        acceleration_rms: root mean square of ``(q[t+1] - 2 q[t] + q[t-1]) / dt^2`` over frames and joints [rad/s^2].
        acceleration_max: the largest of them [rad/s^2].
        acceleration_ratio: the largest relative to each joint's acceleration limit.
        acceleration_joint: the joint of ``acceleration_ratio``.
        jerk_rms: root mean square of the third difference times 50^3, after linear resampling to 50 Hz [rad/s^3].
        stances: number of stances measured.
        drift_p95, drift_max: per stance ``max_t ||f_xy[t] - f_xy[start]||``; 95th percentile and maximum over
            stances [mm].
        drift_sole: the sole of ``drift_max``.
        slide_mean, slide_p95: ``||f_xy[t+1] - f_xy[t]|| / dt`` over all steps within stances [mm/s].
        float_p95: 95th percentile of ``f_z`` over all stance frames [mm].
        sole_lowest: least ``f_z`` of any sole point or outline point in the clip [mm], negative below the floor.
        sole_name: the sole of ``sole_lowest``.
        floor_lowest: ``min(0, least height of any point of any collision shape)`` [mm].
        floor_body: the body of ``floor_lowest``.
        self_depth: deepest overlap of two collision shapes, ``max(0, r_i + r_j - d_ij)`` [mm].
        self_pair: the two shapes.
        self_share: share of frames with an overlap deeper than 1 mm [0, 1].
    """

    frames: int
    fps: float
    seconds: float
    speed_max: float
    speed_ratio: float
    speed_joint: str
    over_frames: int
    limit_frames: int
    limit_excess: float
    limit_joint: str
    jumps: int
    acceleration_rms: float
    acceleration_max: float
    acceleration_ratio: float
    acceleration_joint: str
    jerk_rms: float
    stances: int
    drift_p95: float
    drift_max: float
    drift_sole: str
    slide_mean: float
    slide_p95: float
    float_p95: float
    sole_lowest: float
    sole_name: str
    floor_lowest: float
    floor_body: str
    self_depth: float
    self_pair: str
    self_share: float

    def to_json(self) -> dict[str, Any]:
        """The figures by name, ready for ``json.dumps``."""
        return asdict(self)

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """The figures' names, in order."""
        return tuple(field.name for field in fields(cls))


def measure(motion: RobotMotion, robot: Robot, schedule: ContactSchedule) -> Figures:
    """The figures of a clip as it is (not raised to the floor), over the stances given.

    Raises:
        ClipError: where the clip's joints are not the robot's.
        ScheduleError: where the schedule does not fit the clip or the robot.
    """
    return figures(observe(motion, robot), schedule)


def figures(observation: Observation, schedule: ContactSchedule) -> Figures:
    """The same as :func:`measure`, from a clip observed before."""
    motion = observation.motion
    return Figures(
        frames=motion.frames,
        fps=motion.fps,
        seconds=motion.duration,
        **_joint_figures(motion, observation.robot),
        **_stance_figures(stance_tracks(observation, schedule)),
        **_floor_figures(observation),
        **_self_figures(observation),
    )


def _joint_figures(motion: RobotMotion, robot: Robot) -> dict[str, Any]:
    speed, acceleration = np.abs(joints.velocities(motion)), np.abs(joints.accelerations(motion))
    excess, jerk = joints.range_excess(motion, robot), joints.jerks(motion)
    speed_ratio, speed_joint = _worst(speed / robot.velocity_limit, robot.joint_names)
    acceleration_ratio, acceleration_joint = _worst(acceleration / robot.acceleration_limit, robot.joint_names)
    limit_excess, limit_joint = _worst(excess, robot.joint_names)
    return dict(
        speed_max=_max(speed),
        speed_ratio=speed_ratio,
        speed_joint=speed_joint,
        over_frames=int((speed > robot.velocity_limit).any(axis=1).sum()),
        limit_frames=int((excess > 0.0).any(axis=1).sum()),
        limit_excess=limit_excess,
        limit_joint=limit_joint,
        jumps=int((speed > JUMP_STEP * motion.fps).any(axis=1).sum()),
        acceleration_rms=_rms(acceleration),
        acceleration_max=_max(acceleration),
        acceleration_ratio=acceleration_ratio,
        acceleration_joint=acceleration_joint,
        jerk_rms=_rms(jerk),
    )


def _stance_figures(tracks: tuple[StanceTrack, ...]) -> dict[str, Any]:
    drift = np.array([track.drift.max() for track in tracks])
    speed = np.concatenate([track.speed for track in tracks]) if tracks else np.zeros(0)
    height = np.concatenate([track.height for track in tracks]) if tracks else np.zeros(0)
    return dict(
        stances=len(tracks),
        drift_p95=1e3 * _quantile(drift, 0.95),
        drift_max=1e3 * _max(drift),
        drift_sole=tracks[int(drift.argmax())].stance.sole if tracks else "",
        slide_mean=1e3 * float(speed.mean()) if speed.size else 0.0,
        slide_p95=1e3 * _quantile(speed, 0.95),
        float_p95=1e3 * _quantile(height, 0.95),
    )


def _floor_figures(observation: Observation) -> dict[str, Any]:
    robot = observation.robot
    soles = [
        float(np.concatenate([points, outline], axis=1)[..., 2].min())
        for points, outline in zip(observation.soles, observation.outlines, strict=True)
    ]
    shape = int(observation.lowest.min(axis=0).argmin()) if robot.capsules else -1
    below = min(0.0, float(observation.lowest[:, shape].min())) if robot.capsules else 0.0
    return dict(
        sole_lowest=1e3 * min(soles, default=0.0),
        sole_name=robot.soles[int(np.argmin(soles))].name if soles else "",
        floor_lowest=1e3 * below,
        floor_body=robot.capsules[shape].body if below < 0.0 else "",
    )


def _self_figures(observation: Observation) -> dict[str, Any]:
    found = observation.overlaps
    deepest = int(found.depth.argmax()) if found.depth.size else -1
    return dict(
        self_depth=1e3 * float(found.depth[deepest]) if found.depth.size else 0.0,
        self_pair=pair_name(observation.robot, int(found.pair[deepest])) if found.depth.size else "",
        self_share=float((found.by_frame() > DEEP).mean()),
    )


def pair_name(robot: Robot, pair: int) -> str:
    """The names of the two shapes of a collision pair."""
    i, j = robot.collision_pairs[pair]
    return f"{robot.capsules[i].name} - {robot.capsules[j].name}"


def _worst(values: np.ndarray, names: tuple[str, ...]) -> tuple[float, str]:
    """The largest value of a (T, n) array and the name of its column; 0 and no name where nothing is above 0."""
    if not values.size or values.max() <= 0.0:
        return 0.0, ""
    column = int(values.max(axis=0).argmax())
    return float(values[:, column].max()), names[column]


def _max(values: np.ndarray) -> float:
    return float(values.max()) if values.size else 0.0


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else 0.0


def _quantile(values: np.ndarray, level: float) -> float:
    return float(np.quantile(values, level)) if values.size else 0.0
