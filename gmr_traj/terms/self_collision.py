"""Limbs stay out of the body: closed-form clearance of capsules, ``r = c(a, b) >= clearance``.

Only the joints between the two bodies matter, so a pair's residual is a function of those few angles, in the frame of
their closest common ancestor.  Pairs and frames come from python-fcl's broadphase over the visited motions.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

import casadi as ca
import mujoco
import numpy as np

from gmr_traj.collision.segments_casadi import clearance_jacobian
from gmr_traj.kinematics.casadi_kinematics import CasadiKinematics, constant_rotation, hinge_rotation
from gmr_traj.residuals import FrameResidual, Residual
from gmr_traj.robot import Capsule
from gmr_traj.terms.context import Context
from gmr_traj.terms.term import Term
from gmr_traj.variables import Variables


@dataclass(frozen=True)
class SelfCollision(Term):
    """Fields: ``clearance`` [m], ``near`` [m], and ``scale`` of a violation where the term is a cost or soft [m]."""

    clearance: float
    near: float
    scale: float

    uses: ClassVar[tuple[str, ...]] = ("cost", "hard", "soft")

    def residuals(self, context: Context, variables: Variables) -> list[Residual]:
        """One residual a pair of capsules, over the frames in which they come close."""
        close: dict[tuple[int, int], np.ndarray] = {}
        for visited in context.visited:
            for found in visited.close(self.near):
                known = close.get(found.pair)
                close[found.pair] = found.frames if known is None else np.union1d(known, found.frames)
        return [self._pair(context, variables, pair, close[pair]) for pair in sorted(close)]

    def _pair(self, context: Context, variables: Variables, pair: tuple[int, int], frames: np.ndarray) -> FrameResidual:
        robot = context.robot
        chain = _chain(context.kinematics, *pair)
        angles = context.centre.qpos[frames][:, 7 + chain.joints]
        shape = (1, len(frames))
        names = [robot.capsules[k].name for k in pair]
        return FrameResidual(
            name=f"self_collision/{names[0]}:{names[1]}",
            unit="m",
            rows=["clearance"],
            frames=frames,
            columns=variables.steps[frames][:, 6 + chain.joints],
            parameters=angles.T,
            value=chain.value,
            jacobian=chain.jacobian,
            lower=np.full(shape, self.clearance),
            upper=np.full(shape, np.inf),
            weights=np.full(shape, context.dt / self.scale**2),
        )


@dataclass(frozen=True)
class _Chain:
    """The joints between the bodies of two capsules and the clearance as a function of them.

    Attributes:
        joints: indices of the joints.  # (nz,)
        value, jacobian: (step of the joints, their angles) -> clearance [m], its row.
    """

    joints: np.ndarray
    value: ca.Function
    jacobian: ca.Function


@lru_cache(maxsize=2048)
def _chain(kinematics: CasadiKinematics, first: int, second: int) -> _Chain:
    one, two = kinematics.robot.capsules[first], kinematics.robot.capsules[second]
    bodies = _bodies(kinematics, one.body, two.body)
    ends = [_ends(place, capsule) for place, capsule in zip(bodies.placements, (one, two), strict=True)]
    value, row = clearance_jacobian(bodies.step, *ends[0], one.radius, *ends[1], two.radius)
    options = {"cse": True}
    inputs = [bodies.step, bodies.angles]
    return _Chain(
        joints=bodies.joints,
        value=ca.Function("clearance", inputs, [value], ["z", "p"], ["r"], options),
        jacobian=ca.Function("clearance_row", inputs, [ca.densify(row)], ["z", "p"], ["J"], options),
    )


@dataclass(frozen=True)
class _Bodies:
    """Two bodies in the frame of their closest common ancestor, written down once for all of their capsules.

    Attributes:
        joints: indices of the joints between them.  # (nz,)
        step, angles: symbols, step of the joints and their angles.  # (nz, 1)
        placements: position and rotation of each.
    """

    joints: np.ndarray
    step: Any
    angles: Any
    placements: tuple[tuple[Any, Any], tuple[Any, Any]]


@lru_cache(maxsize=1024)
def _bodies(kinematics: CasadiKinematics, first: str, second: str) -> _Bodies:
    model = kinematics.robot.model
    up_one, up_two = _ancestors(model, first), _ancestors(model, second)
    common = next(body for body in up_one if body in up_two)
    paths = [up_one[: up_one.index(common)][::-1], up_two[: up_two.index(common)][::-1]]
    moved = [body for path in paths for body in path if int(model.body_jntnum[body])]
    joints = np.array([int(model.jnt_qposadr[int(model.body_jntadr[body])]) - 7 for body in moved])
    step, angles = ca.SX.sym("z", len(joints)), ca.SX.sym("p", len(joints))
    angle = dict(zip(moved, ca.vertsplit(step + angles), strict=True))
    return _Bodies(joints, step, angles, (_placement(model, paths[0], angle), _placement(model, paths[1], angle)))


def _ancestors(model: mujoco.MjModel, body: str) -> list[int]:
    """A body and all above it, up to the world."""
    out = [int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, body))]
    while out[-1]:
        out.append(int(model.body_parentid[out[-1]]))
    return out


def _placement(model: mujoco.MjModel, path: list[int], angle: dict[int, Any]) -> tuple[Any, Any]:
    """Position and rotation of the last body of a path, in the frame of the path's start."""
    position, rotation = ca.SX.zeros(3), ca.SX.eye(3)
    for body in path:
        position = position + rotation @ ca.DM(model.body_pos[body])
        rotation = rotation @ constant_rotation(model.body_quat[body])
        if body in angle:
            joint = int(model.body_jntadr[body])
            zero = float(model.qpos0[int(model.jnt_qposadr[joint])])
            turned = rotation @ hinge_rotation(np.asarray(model.jnt_axis[joint]), angle[body] - zero)
            anchor = ca.DM(model.jnt_pos[joint])
            position = position + rotation @ anchor - turned @ anchor
            rotation = turned
    return position, rotation


def _ends(placement: tuple[Any, Any], capsule: Capsule) -> tuple[Any, Any]:
    """End points of a capsule of a body; the second is None for a sphere."""
    position, rotation = placement
    start = position + rotation @ ca.DM(capsule.start)
    if np.allclose(capsule.start, capsule.end):
        return start, None
    return start, position + rotation @ ca.DM(capsule.end)
