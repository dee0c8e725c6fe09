"""Limbs stay out of the body: closed-form clearance of capsules, ``r = c(a, b) >= clearance``.

Only the joints between the two bodies matter, so a pair's residual is a function of those few angles, in the frame of
their closest common ancestor.  Pairs and frames come from python-fcl's broadphase over the visited motions, and from
where the schedule will take the feet (:mod:`~gmr_traj.terms.planted`).
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
from gmr_traj.terms.planted import planted_close
from gmr_traj.terms.term import Term
from gmr_traj.variables import Variables

_NO_FRAMES = np.zeros(0, int)
# Where a foot will stand is known to a few centimetres only: rows between feet are built from this much farther apart.
_PLANTED = 2.0


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
                close[found.pair] = np.union1d(close.get(found.pair, _NO_FRAMES), found.frames)
        for pair, frames in planted_close(context, _PLANTED * self.near).items():
            close[pair] = np.union1d(close.get(pair, _NO_FRAMES), frames)
        return [self._pair(context, variables, pair, close[pair]) for pair in sorted(close)]

    def _pair(self, context: Context, variables: Variables, pair: tuple[int, int], frames: np.ndarray) -> FrameResidual:
        robot = context.robot
        one, two = (robot.capsules[k] for k in pair)
        chain = _chain(context.kinematics, one.body, two.body, _is_sphere(one), _is_sphere(two))
        angles = context.centre.qpos[frames][:, 7 + chain.joints]
        constants = np.concatenate([_constants(one), _constants(two)])
        shape = (1, len(frames))
        return FrameResidual(
            name=f"self_collision/{one.name}:{two.name}",
            unit="m",
            rows=["clearance"],
            frames=frames,
            columns=variables.steps[frames][:, 6 + chain.joints],
            parameters=np.vstack([angles.T, np.repeat(constants[:, None], len(frames), axis=1)]),
            value=chain.value,
            jacobian=chain.jacobian,
            lower=np.full(shape, self.clearance),
            upper=np.full(shape, np.inf),
            weights=np.full(shape, context.dt / self.scale**2),
        )


def _is_sphere(capsule: Capsule) -> bool:
    return np.allclose(capsule.start, capsule.end)


def _constants(capsule: Capsule) -> np.ndarray:
    """What a chain's functions ask of a capsule: start, end unless it is a sphere, and radius [m]."""
    return np.concatenate([capsule.start, [] if _is_sphere(capsule) else capsule.end, [capsule.radius]])


@dataclass(frozen=True)
class _Chain:
    """The joints between two bodies, and the clearance of capsules of theirs as a function of them.

    Attributes:
        joints: indices of the joints.  # (nz,)
        value, jacobian: (step of the joints, their angles and the capsules) -> clearance [m], its row.
    """

    joints: np.ndarray
    value: ca.Function
    jacobian: ca.Function


@lru_cache(maxsize=1024)
def _chain(kinematics: CasadiKinematics, first: str, second: str, sphere_one: bool, sphere_two: bool) -> _Chain:
    """For all capsules of two bodies: writing a function down takes longer than evaluating it in many frames."""
    model = kinematics.robot.model
    up_one, up_two = _ancestors(model, first), _ancestors(model, second)
    common = next(body for body in up_one if body in up_two)
    path = [*up_one[: up_one.index(common)][::-1], *up_two[: up_two.index(common)][::-1]]
    joints = np.array([_joint(model, body) for body in path if int(model.body_jntnum[body])])
    step, angles = kinematics.joint_symbols
    symbols, ends = [angles[joints]], []
    for body, sphere in ((up_one[0], sphere_one), (up_two[0], sphere_two)):
        position, rotation = _placement(kinematics, common, body)
        points = [ca.SX.sym("point", 3) for _ in range(1 if sphere else 2)]
        symbols += [*points, ca.SX.sym("radius")]
        placed = [position + rotation @ point for point in points]
        ends += [placed[0], None if sphere else placed[1], symbols[-1]]
    value, row = clearance_jacobian(step[joints], *ends)
    # Not with CasADi's search for common subexpressions: it finds a twentieth, in a multiple of the time of the rest.
    inputs = [step[joints], ca.vertcat(*symbols)]
    return _Chain(
        joints=joints,
        value=ca.Function("clearance", inputs, [value], ["z", "p"], ["r"]),
        jacobian=ca.Function("clearance_row", inputs, [ca.densify(row)], ["z", "p"], ["J"]),
    )


def _joint(model: mujoco.MjModel, body: int) -> int:
    return int(model.jnt_qposadr[int(model.body_jntadr[body])]) - 7


def _ancestors(model: mujoco.MjModel, body: str) -> list[int]:
    """A body and all above it, up to the world."""
    out = [int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, body))]
    while out[-1]:
        out.append(int(model.body_parentid[out[-1]]))
    return out


@lru_cache(maxsize=4096)
def _placement(kinematics: CasadiKinematics, ancestor: int, body: int) -> tuple[Any, Any]:
    """Position and rotation of a body in the frame of an ancestor."""
    if body == ancestor:
        return ca.SX.zeros(3), ca.SX.eye(3)
    model = kinematics.robot.model
    position, rotation = _placement(kinematics, ancestor, int(model.body_parentid[body]))
    position = position + rotation @ ca.DM(model.body_pos[body])
    rotation = rotation @ constant_rotation(model.body_quat[body])
    if int(model.body_jntnum[body]):
        step, angles = kinematics.joint_symbols
        index, joint = _joint(model, body), int(model.body_jntadr[body])
        zero = float(model.qpos0[int(model.jnt_qposadr[joint])])
        angle = step[index] + angles[index] - zero
        turned = rotation @ hinge_rotation(np.asarray(model.jnt_axis[joint]), angle)
        anchor = ca.DM(model.jnt_pos[joint])
        position = position + rotation @ anchor - turned @ anchor
        rotation = turned
    return position, rotation
