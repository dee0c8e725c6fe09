"""Points of the robot that are held at anchors on the floor, while they rest there.

For a point p_k of a body, at the height h_k above the floor, and the anchor a_s of its stance,

    r = p_k - (a_s, h_k).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from gmr_traj.kinematics.casadi_kinematics import CasadiKinematics
from gmr_traj.residuals import FrameResidual
from gmr_traj.terms.context import Context
from gmr_traj.variables import Variables


@dataclass(frozen=True)
class Held:
    """A point that is held: its body, where it is in the body's frame [m], and its height above the floor [m]."""

    body: str
    own: tuple[float, ...]
    height: float = 0.0


def anchored(
    context: Context,
    variables: Variables,
    name: str,
    rows: Sequence[str],
    points: tuple[Held, ...],
    anchor: np.ndarray,
    resting: np.ndarray,
    upper: np.ndarray,
    weights: np.ndarray,
) -> FrameResidual | None:
    """The residual of some points, over the frames in which any of them rests; None where there are none.

    Args:
        context: motions.
        variables: the unknowns, which have the anchors.
        name: of the residual.
        rows: names of its rows, three a point.
        points: the points.
        anchor: unknowns of the anchor of each point where it rests.  # (T, m, 2) int
        resting: which of them rests when.  # (T, m) bool
        upper: upper bounds of the rows [m]; the lower ones are 0.  # (T, 3 m)
        weights: of the rows, 0 where a point does not rest [1/m^2].  # (T, 3 m)
    """
    frames = np.flatnonzero(resting.any(axis=1))
    if not frames.size:
        return None
    # A point in swing has weight zero; naming an anchor of its limb there keeps the Hessian as sparse as it is.
    some = anchor[frames, resting[frames].argmax(axis=1)]
    anchors = np.where(resting[frames][:, :, None], anchor[frames], some[:, None])
    value, jacobian = _functions(context.kinematics, points)
    return FrameResidual(
        name=name,
        unit="m",
        rows=rows,
        frames=frames,
        columns=np.hstack([variables.steps[frames], anchors.reshape(len(frames), -1)]),
        parameters=context.centre.qpos[frames].T,
        value=value,
        jacobian=jacobian,
        lower=np.zeros((3 * len(points), len(frames))),
        upper=upper[frames].T,
        weights=weights[frames].T,
    )


@lru_cache(maxsize=64)
def _functions(kinematics: CasadiKinematics, points: tuple[Held, ...]) -> tuple[ca.Function, ca.Function]:
    """(step and anchors, configuration) -> errors of the points; and their Jacobian."""
    size = kinematics.tangent_size
    z, reference = ca.SX.sym("z", size + 2 * len(points)), ca.SX.sym("q", 7 + kinematics.robot.dof)
    placed, errors = kinematics.placements(z[:size], reference), []
    for k, point in enumerate(points):
        slot, anchor = kinematics.slot(point.body), z[size + 2 * k : size + 2 * k + 2]
        where = placed.positions[slot] + placed.rotations[slot] @ ca.DM(list(point.own))
        errors.append(where - ca.vertcat(anchor, point.height))
    r, options = ca.vertcat(*errors), {"cse": True}
    value = ca.Function("stance", [z, reference], [r], ["z", "p"], ["r"], options)
    jacobian = ca.Function("stance_jacobian", [z, reference], [ca.jacobian(r, z)], ["z", "p"], ["J"], options)
    return value, jacobian
