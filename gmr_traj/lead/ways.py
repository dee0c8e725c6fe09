"""The ways into a clip that a lead chooses from: where the robot stands first, how it steps, and what that costs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.constants import GRAVITY
from gmr_traj.kinematics.mujoco_kinematics import centres_of_mass
from gmr_traj.lead.arrival import Arrival, standing, yaw
from gmr_traj.lead.blend import blend
from gmr_traj.lead.centre_path import CentrePath, centre_path
from gmr_traj.lead.feet import Foot, FootPath, foot_path, standing_feet
from gmr_traj.lead.legs import leg_length
from gmr_traj.lead.steps import REST, Steps, pressed_at, step_plans
from gmr_traj.robot import Robot

# Places to begin at, behind the base by its velocity times so much [s].
BEHIND = (0.0, 0.12, 0.25, 0.5)
# A foot that is turned farther than this from the base says nothing of where the robot should look.
TURN = np.radians(45.0)
# A step at this speed costs as much as the centre of mass at its own scales [m/s].
SWING_SPEED = 2.0
# Legs may be stretched to this share of their length; so much farther [m] costs as much as the centre of mass.
STRETCH = 0.97
BEYOND = 0.01


@dataclass(frozen=True)
class Way:
    """One way into the clip, before the legs are known.

    Attributes:
        q: where the robot stands first.  # (7 + n,)
        steps: which feet step when.
        paths: of the feet, in the order of ``robot.soles``.
        centre: the way of the centre of mass.
        cost: the lower the better [-].
    """

    q: np.ndarray
    steps: Steps
    paths: tuple[FootPath, ...]
    centre: CentrePath
    cost: float


def places(state: Arrival, feet: tuple[Foot, ...], robot: Robot) -> list[np.ndarray]:
    """Configurations to stand in: below the clip's base, behind it, and with each foot where the clip has it.

    Args:
        state: the clip's first frame.
        feet: its feet.
        robot: the robot.
    """
    heading, base = yaw(state.turned.as_matrix()), state.base
    behind = BEHIND if np.linalg.norm(base.velocity[:2]) > 0.1 else BEHIND[:1]
    out = [standing(robot, base.value[:2] - after * base.velocity[:2], heading) for after in behind]
    plain = standing_feet(feet, robot, standing(robot, np.zeros(2), 0.0))
    for foot, stands in zip(feet, plain, strict=True):
        turn = foot.heading - yaw(stands.turned.as_matrix())
        if abs(np.arctan2(np.sin(turn - heading), np.cos(turn - heading))) <= TURN:
            arm = Rotation.from_euler("z", turn).apply(stands.at)
            out.append(standing(robot, foot.place - arm[:2], turn))
    return out


def ways_from(
    q: np.ndarray, state: Arrival, feet: tuple[Foot, ...], robot: Robot, times: np.ndarray, fps: float
) -> list[Way]:
    """The ways into the clip from one place; none where there is no time for the steps.

    Args:
        q: where the robot stands first.  # (7 + n,)
        state: the clip's first frame.
        feet: its feet.
        robot: the robot.
        times: of the frames, 0 the clip's first [s].  # (T,)
        fps: frames per second.
    """
    stands = standing_feet(feet, robot, q)
    mass = centres_of_mass(robot, q[None])[0]
    found = []
    for steps in step_plans(feet, stands, -times[REST - 1]):
        paths, speeds = [], []
        for k, foot in enumerate(feet):
            swing = steps.of(k)
            lifts, lands = (None, None) if swing is None else (swing.lifts, swing.lands)
            paths.append(foot_path(foot, stands[k], times, lifts, lands))
            if lifts is not None:
                far = float(np.linalg.norm(foot.at.value - stands[k].at))
                speeds.append(far / ((0.0 if lands is None else lands) - lifts))
        height = _heights(mass[2], state, steps, times, fps)
        at, end = height[len(times) - 1], state.centre
        zmp = end.value[:2] - at / (GRAVITY + end.acceleration[2]) * end.acceleration[:2]
        pressed = pressed_at(steps, feet, stands, zmp, times)
        flat = type(end)(end.value[:2], end.velocity[:2], end.acceleration[:2])
        centre = centre_path(mass[:2], flat, height, pressed, fps)
        cost = centre.cost + float(np.sum(np.square(speeds))) / SWING_SPEED**2
        cost += _overstretched(q, state, feet, steps, paths, centre.at - mass[:2], robot, times)
        found.append(Way(q, steps, tuple(paths), centre, cost))
    return found


def _overstretched(
    q: np.ndarray,
    state: Arrival,
    feet: tuple[Foot, ...],
    steps: Steps,
    paths: list[FootPath],
    moved: np.ndarray,
    robot: Robot,
    times: np.ndarray,
) -> float:
    """What it costs that feet are farther from the base than the legs are long, in the units of the cost.

    Args:
        q: where the robot stands first.  # (7 + n,)
        state: where the clip has it.
        feet: its feet.
        steps: when they step.
        paths: on which ways.
        moved: how far the centre of mass, and about as far the base, is from there [m].  # (T, 2)
        robot: the robot.
        times: of the frames [s].  # (T,)
    """
    z = (np.asarray(rate[2]) for rate in (state.base.value, state.base.velocity, state.base.acceleration))
    base = np.column_stack([q[:2] + moved, blend(times, steps.active, np.asarray(q[2]), *z)])
    cost = 0.0
    for foot, path in zip(feet, paths, strict=True):
        ankle = path.at - path.turned.apply(foot.pivot)
        beyond = np.linalg.norm(ankle - base, axis=1) - STRETCH * leg_length(robot, foot)
        cost += float(np.mean(np.square(np.maximum(0.0, beyond)))) / BEYOND**2
    return cost


def _heights(start: float, state: Arrival, steps: Steps, times: np.ndarray, fps: float) -> np.ndarray:
    """Height of the centre of mass, two frames into the clip.  # (T + 2,)"""
    z = [np.asarray(value[2]) for value in (state.centre.value, state.centre.velocity, state.centre.acceleration)]
    ahead = np.array([1.0, 2.0]) / fps
    before = blend(times, steps.active, np.asarray(start), *z)
    return np.concatenate([before, z[0] + ahead * z[1] + 0.5 * ahead**2 * z[2]])
