"""Method ``protomotions``: the inverse kinematics of ProtoMotions before it took up trajectory optimisation.

Positions are scaled along the axes of the **world**, p* = diag(scale) p, the root's path included, and each frame takes
two steps of differential inverse kinematics from where the last one ended,

    minimise    sum_b ||c_b e_b||^2 + posture_cost^2 ||q||^2 + (damping + lm_damping sum_b ||c_b e_b||^2) ||dq||^2

with hardly any cost on orientations.  A scale that differs between x and y makes the length of a stride, and the
distance of the feet from each other, depend on the heading: that is the method's fault, and turns and crossed legs
show it.
Its step of 1 / (2 fps) cancels: steps are not limited in speed unless the options ask for it.

ProtoMotions: Tessler et al., github.com/NVlabs/ProtoMotions; it used mink, whose program this is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.human_motion import HumanMotion
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.references import BodyTargets
from gmr_traj.retarget.body_map import BodyMap
from gmr_traj.retarget.inverse_kinematics import InverseKinematics
from gmr_traj.retarget.landmarks import LandmarkPoint, Landmarks, match, read_points, read_settings, thinned
from gmr_traj.retarget.options import Options, Solved
from gmr_traj.retarget.targets import check
from gmr_traj.robot import Robot

_UNBOUNDED = 1e30  # what daqp takes for infinity
_REPORT_EVERY = 20  # frames between two reports of progress

#: ``every-frame``: each frame is shifted until the robot's lowest body is as high as the person's lowest joint, not
#: scaled, as in the code. ``clip``: the same with the lowest of the whole clip, as the GMR paper says.
Height = Literal["every-frame", "clip"]


@dataclass(frozen=True)
class ProtoMotionsSettings:
    """The numbers of ``configs/protomotions_<robot>.toml``, which says what they mean."""

    points: tuple[LandmarkPoint, ...]
    frames_per_second: float
    scale: np.ndarray
    position_cost: float
    orientation_cost: float
    posture_cost: float
    lm_damping: float
    damping: float
    limit_gain: float
    solves_per_frame: int
    warm_up_frames: int

    @classmethod
    def read(cls, robot: Robot) -> ProtoMotionsSettings:
        """Read them.

        Raises:
            ResourceError: there is no such file for the robot, or it is wrong.
        """
        table = read_settings("protomotions", robot)
        settings = cls(
            points=read_points(table, robot),
            frames_per_second=table.number("frames_per_second", above=0.0),
            scale=table.point("scale"),
            position_cost=table.weight("position_cost"),
            orientation_cost=table.weight("orientation_cost"),
            posture_cost=table.weight("posture_cost"),
            lm_damping=table.weight("lm_damping"),
            damping=table.number("damping", above=0.0),
            limit_gain=table.number("limit_gain", above=0.0),
            solves_per_frame=table.count("solves_per_frame", 0),
            warm_up_frames=table.count("warm_up_frames", 0),
        )
        table.done()
        if settings.solves_per_frame < 1:
            raise table.error("solves_per_frame must be at least 1")
        if settings.limit_gain > 1.0:
            raise table.error(f"limit_gain is {settings.limit_gain:g}; above 1 a step would cross the limit")
        if not (settings.scale > 0.0).all():
            raise table.error("scale must be above 0 along each axis")
        bodies = [point.body for point in settings.points]
        twice = [body for k, body in enumerate(bodies) if body in bodies[:k]]
        if twice:
            raise table.error(f"gives body {twice[0]!r} two points; expected one a body")
        return settings


def solve(
    human: HumanMotion, robot: Robot, body_map: BodyMap, options: Options, *, height: Height = "every-frame"
) -> Solved:
    """Retarget a clip.

    Args:
        human: the person; thinned out to about 30 frames per second.
        robot: the robot.
        body_map: only the orientations of the bodies are taken from it, which hardly count.
        options: velocity limit and callback.
        height: how the height is corrected.

    Raises:
        MapError: the method does not know the person's rig, or the map is made for another.
        ResourceError: there are no settings for the robot.
        SolverError: a quadratic program was not solved.
    """
    settings = ProtoMotionsSettings.read(robot)
    check(human, body_map)
    human = thinned(human, settings.frames_per_second)
    targets = world_scaled(human, match(human, settings.points), body_map, settings.scale)
    qpos = _frames(targets, robot, settings, human.fps, options)
    bodies = placements(robot, qpos)[0][..., 2].min(axis=1)  # (T,) [m]
    person = human.positions[..., 2].min(axis=1)
    raised = person - bodies if height == "every-frame" else np.full(len(qpos), person.min() - bodies.min())
    qpos[:, 2] += raised
    lifted = np.array(targets.positions)
    lifted[..., 2] += raised[:, None]
    followed = replace(targets, positions=lifted)
    steps = (len(qpos) + settings.warm_up_frames) * settings.solves_per_frame
    notes = (f"each frame was raised by {raised.min():.3f} to {raised.max():.3f} m",) if height == "every-frame" else ()
    return Solved(qpos, followed, float(raised.mean()), steps, notes, human.fps)


def world_scaled(human: HumanMotion, landmarks: Landmarks, body_map: BodyMap, scale: np.ndarray) -> BodyTargets:
    """The person's landmarks, scaled along the axes of the world.

    Orientations are those of the joints that the map gives the bodies, turned into the bodies' frames; bodies that are
    not in the map have none (weight 0).

    Args:
        human: the person.
        landmarks: the landmarks.
        body_map: where orientations come from.
        scale: along x, y and z.  # (3,)
    """
    bodies = [point.body for point in landmarks.points]
    turns = np.zeros((human.frames, len(bodies), 4))
    turns[..., 0] = 1.0
    turned = np.zeros(len(bodies))
    for target in body_map.targets:
        if target.body in bodies:
            joint = human.quaternions[:, human.index(target.orientation_joint)]
            rotation = Rotation.from_quat(joint, scalar_first=True)
            offset = Rotation.from_quat(target.rotation_offset, scalar_first=True)
            turns[:, bodies.index(target.body)] = (rotation * offset).as_quat(scalar_first=True)
            turned[bodies.index(target.body)] = 1.0
    weights = np.array([point.weight for point in landmarks.points])
    return BodyTargets(
        names=tuple(bodies),
        positions=human.positions[:, landmarks.joints] * scale,
        quaternions=turns,
        position_weights=weights,
        orientation_weights=weights * turned,
        points=np.array([point.point for point in landmarks.points]),
    )


def _frames(
    targets: BodyTargets, robot: Robot, settings: ProtoMotionsSettings, fps: float, options: Options
) -> np.ndarray:
    """Configurations of all frames, each from where the last one ended.  # (T, 7 + n)"""
    costs = np.stack(
        [settings.position_cost * targets.position_weights, settings.orientation_cost * targets.orientation_weights],
        axis=1,
    )
    ik = InverseKinematics(
        robot, targets.names, targets.points, [costs], damping=settings.damping, lm_damping=settings.lm_damping
    )
    factor, solves = options.velocity_limit, settings.solves_per_frame
    reach = None if factor is None else factor * robot.velocity_limit / (fps * solves)
    q = np.zeros(7 + robot.dof)
    base = targets.names.index(robot.body_names[0])
    q[:3], q[3:7] = targets.positions[0, base], targets.quaternions[0, base]
    q[7:] = np.clip(q[7:], robot.position_lower, robot.position_upper)
    out = np.empty((targets.frames, len(q)))
    for k in range(-settings.warm_up_frames, targets.frames):
        t = max(k, 0)
        ik.aim(targets.positions[t], targets.quaternions[t])
        for _ in range(solves):
            # The first frames may move as fast as they must: there is no frame before them.
            q = step(ik, q, robot, settings, reach if k > 0 else None)
        if k >= 0:
            out[k] = q
            if options.progress is not None and (k % _REPORT_EVERY == 0 or k == targets.frames - 1):
                options.progress("retargeting", k + 1, targets.frames)
    return out


def step(
    ik: InverseKinematics,
    q: np.ndarray,
    robot: Robot,
    settings: ProtoMotionsSettings,
    reach: np.ndarray | None,
) -> np.ndarray:
    """The configuration after one step."""
    ik.place(q)
    H, gradient = ik.objective(0)
    joints, cost = q[7:], settings.posture_cost**2
    H.flat[6 * (len(H) + 1) :: len(H) + 1] += cost
    gradient[6:] += cost * joints
    lower, upper = np.full(len(gradient), -_UNBOUNDED), np.full(len(gradient), _UNBOUNDED)
    lower[6:] = settings.limit_gain * (robot.position_lower - joints)
    upper[6:] = settings.limit_gain * (robot.position_upper - joints)
    if reach is not None:
        lower[6:], upper[6:] = np.maximum(lower[6:], -reach), np.minimum(upper[6:], reach)
    return ik.moved(H, gradient, lower, upper)
