"""From the robot's default standing posture into a clip, in steps that it can take.

The joints, the height and the turn of the base follow quintic blends (:mod:`~gmr_traj.lead.blend`), the feet step where
they have to (:mod:`~gmr_traj.lead.steps`), the centre of mass goes where the floor can carry it
(:mod:`~gmr_traj.lead.centre_path`), and the legs follow from base and feet.  Where the robot stands first is chosen
among a few places: with one of its feet where the clip has it, below the base, or as far behind as it needs to get
going.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.contacts.schedule import ContactSchedule, Stance
from gmr_traj.exceptions import ClipError
from gmr_traj.kinematics.mujoco_kinematics import centres_of_mass
from gmr_traj.lead.arrival import Arrival, arrival
from gmr_traj.lead.blend import blend, blend_rotation
from gmr_traj.lead.feet import Foot, FootPath, feet_of, standing_feet
from gmr_traj.lead.legs import bend_legs
from gmr_traj.lead.steps import REST, shortest
from gmr_traj.lead.ways import Way, places, ways_from
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot
from gmr_traj.trust import NONE, trust

# Rounds in which base, centre of mass and legs are brought together.
ROUNDS = 4
# So many of the best ways are tried, until the joints can follow one.
BEST = 3
# How many longer leads are tried to tell how long it has to be, each so much longer than the one before.
TRIES = 4
LONGER = 1.5


@dataclass(frozen=True)
class Lead:
    """What leads into a clip.

    Attributes:
        qpos: configurations, the last one a frame before the clip's frame ``replaced``.  # (N, 7 + n)
        replaced: how many of the clip's own frames they replace: a transient that says nothing of the motion.
        stances: of its frames; those that last into the clip stop at N.
    """

    qpos: np.ndarray
    replaced: int
    stances: tuple[Stance, ...]


@dataclass(frozen=True)
class _Short:
    """Why a lead cannot be done in the time it has, and the least time that it takes, where that is known [s]."""

    why: str
    least: float | None = None


def lead_in(motion: RobotMotion, robot: Robot, schedule: ContactSchedule, seconds: float, option: str) -> Lead:
    """Lead into a clip.

    Args:
        motion: the clip, on the floor at z = 0.
        robot: its robot.
        schedule: its stances.
        seconds: length of the lead [s].
        option: what the user calls that length, for messages.

    Raises:
        ClipError: there is no time for the steps, or a joint would have to be faster than it can be.
    """
    found = _lead(motion, robot, schedule, seconds)
    if isinstance(found, Lead):
        return found
    longer, short = seconds, found
    for _ in range(TRIES):
        longer = np.ceil(10.0 * (short.least or LONGER * longer)) / 10.0
        tried = _lead(motion, robot, schedule, longer)
        if isinstance(tried, Lead):
            raise ClipError(f"{option} {seconds:g} s is too short: {found.why}; give it {longer:g} s")
        short = tried
    raise ClipError(
        f"{option} {seconds:g} s cannot be done: {found.why}"
        + (f"; nor in {longer:g} s" if short.why == found.why else f"; in {longer:g} s, {short.why}")
    )


def _lead(motion: RobotMotion, robot: Robot, schedule: ContactSchedule, seconds: float) -> Lead | _Short:
    """The lead, or what there is no time for."""
    fps, replaced = motion.fps, spoiled(motion)
    frames = max(REST, round(seconds * fps)) + replaced
    rest = motion.with_qpos(motion.qpos[replaced:])
    state = arrival(rest, robot)
    stances = tuple(
        replace(s, start=0, stop=s.stop - replaced) for s in schedule.stances if s.start <= replaced < s.stop
    )
    feet = feet_of(state, rest, robot, stances)
    times = (np.arange(frames + 1) - frames) / fps
    starts = places(state, feet, robot)
    ways = [way for q in starts for way in ways_from(q, state, feet, robot, times, fps)]
    if not ways:
        least = min(shortest(feet, standing_feet(feet, robot, q)) for q in starts) + REST / fps
        return _Short(f"it takes {least:.2f} s at least to get the feet there", least)
    faults = []
    for way in sorted(ways, key=lambda way: way.cost)[:BEST]:
        qpos = _configurations(way, state, feet, rest, robot, times)
        fast = _too_fast(np.concatenate([qpos[:-1], rest.qpos[:2]]), robot, fps)
        if not fast:
            return Lead(qpos[:-1], replaced, _stances(feet, way.paths, times))
        faults.append(fast)
    return _Short(faults[0])


def spoiled(motion: RobotMotion) -> int:
    """How many of a clip's first frames are a transient that says nothing of the motion."""
    return int(np.argmax(trust(motion) > NONE))


def _configurations(
    way: Way, state: Arrival, feet: tuple[Foot, ...], rest: RobotMotion, robot: Robot, times: np.ndarray
) -> np.ndarray:
    """The robot on its way, the clip's first frame last.  # (N + 1, 7 + n)"""
    q, active = way.q, way.steps.active
    qpos = np.tile(q, (len(times), 1))
    joints = state.joints
    qpos[:, 7:] = blend(times, active, q[7:], joints.value, joints.velocity, joints.acceleration)
    qpos[:, 7:] = np.clip(qpos[:, 7:], robot.position_lower, robot.position_upper)
    upright = Rotation.from_quat(q[3:7], scalar_first=True)
    turned = blend_rotation(times, active, upright, state.turned, state.turning.velocity, state.turning.acceleration)
    qpos[:, 3:7] = turned.as_quat(scalar_first=True)
    z = state.base.value[2], state.base.velocity[2], state.base.acceleration[2]
    qpos[:, 2] = blend(times, active, np.asarray(q[2]), *map(np.asarray, z))
    qpos[:REST], qpos[-1] = q, rest.qpos[0]
    away = np.array([state.centre.value[:2] - state.base.value[:2]])
    blended = qpos.copy()
    for _ in range(ROUNDS):
        blended[REST:-1, :2] = (way.centre.at - away)[REST:-1]
        qpos[REST:-1] = bend_legs(robot, blended[:-1], feet, way.paths)[REST:]
        away = centres_of_mass(robot, qpos)[:, :2] - qpos[:, :2]
    return qpos


def _too_fast(qpos: np.ndarray, robot: Robot, fps: float) -> str:
    """Which joint would have to be faster than it can be, and when; empty if none."""
    rates = (("speed", "rad/s", 1, robot.velocity_limit), ("acceleration", "rad/s^2", 2, robot.acceleration_limit))
    for name, unit, order, limit in rates:
        rate = np.abs(np.diff(qpos[:, 7:], order, axis=0)) * fps**order
        ratio = rate / limit
        if ratio.max(initial=0.0) > 1.0:
            t, j = np.unravel_index(int(ratio.argmax()), ratio.shape)
            return f"{robot.joint_names[j]} would need a {name} of {rate[t, j]:.1f} {unit}, its limit is {limit[j]:g}"
    return ""


def _stances(feet: tuple[Foot, ...], paths: tuple[FootPath, ...], times: np.ndarray) -> tuple[Stance, ...]:
    """When the sole points are at rest on the way."""

    def frame(time: float) -> int:
        """The first frame at or after a time."""
        return int(np.searchsorted(times, time - 1e-9))

    out = []
    for foot, path in zip(feet, paths, strict=True):
        for point, part in enumerate(foot.sole.parts):
            stays = len(times) - 1 if point in foot.resting else frame(path.settles)
            spans = [(0, stays if path.lifts is None else frame(path.lifts))]
            if path.lands is not None:
                spans.append((frame(path.lands), stays))
            out += [Stance(foot.sole.name, point, part, a, b) for a, b in spans if b > a]
    return tuple(out)
