"""A hand, a knee, an elbow or a hip in stance stays where it came down.

What is held is the centre c_k of the ball that touches the floor, of radius r_k, at one free anchor a_s a stance s:

    r = c_k - (a_s, r_k) = 0.

The limb may turn over the ball.  Where the ball came down is known less well than for a foot, which retargeting plants
or nearly so, and several balls of a limb may rest on the floor a little askew: the scale is softer than that of soles.
"""

from __future__ import annotations

import numpy as np

from gmr_traj.contacts.limbs import limb_points
from gmr_traj.contacts.mask import limbs_to_mask
from gmr_traj.residuals import Residual
from gmr_traj.runs import runs
from gmr_traj.terms.anchored import Held, anchored
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
        anchor = np.full((*on.shape, 2), -1)
        for k, place in enumerate(centres[:, own, :2].transpose(1, 0, 2)):
            for start, stop in runs(on[:, k]):
                anchor[start:stop, k] = variables.add(place[start:stop].mean(axis=0))
        balls = zip(support.bodies, support.points.tolist(), support.radii.tolist(), strict=True)
        held = tuple(Held(body, tuple(centre), radius) for body, centre, radius in balls)
        rows = [f"ball {k} {axis}" for k in range(len(held)) for axis in "xyz"]
        weights = np.repeat(on, 3, axis=1) * (context.dt / scale**2)
        residual = anchored(
            context, variables, f"stance/{support.name}", rows, held, anchor, on, np.zeros(weights.shape), weights
        )
        out += [] if residual is None else [residual]
    return out
