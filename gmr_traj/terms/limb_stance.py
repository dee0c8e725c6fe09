"""A hand, a knee, an elbow or a hip in stance stays where it came down.

What is held is the centre c_k of the ball that touches the floor, of radius r_k, at one free anchor a_s a stance s:

    r = c_k - (a_s, r_k) = 0.

The limb may turn over the ball.  Where the ball came down is known less well than for a foot, which retargeting plants
or nearly so, and several balls of a limb may rest on the floor a little askew: the scale is softer than that of soles.
"""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from gmr_traj.contacts.limbs import limb_points
from gmr_traj.contacts.mask import limbs_to_mask
from gmr_traj.kinematics.casadi_kinematics import CasadiKinematics
from gmr_traj.residuals import FrameResidual, Residual
from gmr_traj.runs import runs
from gmr_traj.terms.context import Context
from gmr_traj.variables import Variables


def limb_anchors(context: Context, variables: Variables, scale: float) -> list[Residual]:
    """One residual a support, over the frames in which any of its balls is in stance; adds the anchors.

    Args:
        context: motions and schedule.
        variables: the unknowns, to which an anchor a stance is added.
        scale: of a centre's distance from where it should be [m].
    """
    out: list[Residual] = []
    resting, last = limbs_to_mask(context.schedule, context.robot), 0
    if not resting.any():
        return out
    centres = limb_points(context.robot, context.placements)[0]
    for support in context.robot.supports:
        own = slice(last, last := last + len(support.points))
        on = resting[:, own]
        frames = np.flatnonzero(on.any(axis=1))
        if not frames.size:
            continue
        anchor = np.full((*on.shape, 2), -1)
        for k, place in enumerate(centres[:, own, :2].transpose(1, 0, 2)):
            for start, stop in runs(on[:, k]):
                anchor[start:stop, k] = variables.add(place[start:stop].mean(axis=0))
        # A ball in the air has weight zero; naming an anchor of its limb there keeps the Hessian as sparse as it is.
        some = anchor[frames, on[frames].argmax(axis=1)]
        anchors = np.where(on[frames][:, :, None], anchor[frames], some[:, None])
        value, jacobian = _functions(context.kinematics, support.name)
        zero = np.zeros((3 * on.shape[1], len(frames)))
        out.append(
            FrameResidual(
                name=f"stance/{support.name}",
                unit="m",
                rows=[f"ball {k} {axis}" for k in range(on.shape[1]) for axis in "xyz"],
                frames=frames,
                columns=np.hstack([variables.steps[frames], anchors.reshape(len(frames), -1)]),
                parameters=context.centre.qpos[frames].T,
                value=value,
                jacobian=jacobian,
                lower=zero,
                upper=zero,
                weights=np.repeat(on[frames], 3, axis=1).T * (context.dt / scale**2),
            )
        )
    return out


@lru_cache(maxsize=64)
def _functions(kinematics: CasadiKinematics, name: str) -> tuple[ca.Function, ca.Function]:
    """(step and anchors, configuration) -> errors of the centres; and their Jacobian."""
    robot, size = kinematics.robot, kinematics.tangent_size
    support = next(s for s in robot.supports if s.name == name)
    z, reference = ca.SX.sym("z", size + 2 * len(support.points)), ca.SX.sym("q", 7 + robot.dof)
    placed, errors = kinematics.placements(z[:size], reference), []
    for k, (body, point) in enumerate(zip(support.bodies, support.points, strict=True)):
        slot, anchor = kinematics.slot(body), z[size + 2 * k : size + 2 * k + 2]
        centre = placed.positions[slot] + placed.rotations[slot] @ ca.DM(point)
        errors.append(centre - ca.vertcat(anchor, support.radii[k]))
    r, options = ca.vertcat(*errors), {"cse": True}
    value = ca.Function("limb", [z, reference], [r], ["z", "p"], ["r"], options)
    jacobian = ca.Function("limb_jacobian", [z, reference], [ca.jacobian(r, z)], ["z", "p"], ["J"], options)
    return value, jacobian
