"""A sole point in stance stays where it came down.

For every stance s of a sole point k there is one free anchor a_s on the floor, and in all its frames

    r = (p_k - (a_s, 0)) = 0.

Tying each frame to the one before instead would let the foot creep.  Several points of one rigid sole over-determine
its placement (four corners: 12 equations, 6 + 8 unknowns with their anchors), so this is a stiff cost, consistent
because the anchors are free, and not a hard constraint, whose rows would be dependent.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from gmr_traj.contacts.mask import to_mask
from gmr_traj.kinematics.mujoco_kinematics import body_points
from gmr_traj.residuals import Residual
from gmr_traj.terms.anchored import Held, anchored
from gmr_traj.terms.context import Context
from gmr_traj.terms.lifting import alone, ceilings, pivoting, pivots
from gmr_traj.terms.limb_stance import limb_anchors
from gmr_traj.terms.steep_feet import overhang
from gmr_traj.terms.term import Term
from gmr_traj.variables import Variables


@dataclass(frozen=True)
class StanceAnchor(Term):
    """Fields: ``horizontal`` and ``vertical``, scales of a point's distance from its anchor and from the floor [m].

    ``rise``: how high contact points may come that a turning foot lifts (:mod:`~gmr_traj.terms.lifting`) [m].  With it
    a foot that stands on its toes (or heels) alone turns about the tip of its outline, which gets an anchor of its own;
    without, it stays as flat as the floor keeps that tip from going below.  ``free``: the share of all frames of points
    in stance in which they may come as high as they like.  ``limb``: scale of the distance of hands, knees, elbows and
    hips in stance from their anchors and from the floor [m]; without it they are not held
    (:mod:`~gmr_traj.terms.limb_stance`).
    """

    horizontal: float
    vertical: float
    rise: float = 0.0
    free: float = 0.0
    limb: float = 0.0

    uses: ClassVar[tuple[str, ...]] = ("cost",)

    def complaint(self) -> str:
        """None of what may be left out can be less than nothing, and no share more than all."""
        for name in ("rise", "free", "limb"):
            if getattr(self, name) < 0.0:
                return f"{name} is {getattr(self, name):g}; expected a positive number, or 0 for none"
        return "" if self.free <= 1.0 else f"free is {self.free:g}; expected a share of at most 1"

    def residuals(self, context: Context, variables: Variables) -> list[Residual]:
        """One residual a sole or limb, over the frames in which any of its points is in stance; adds the anchors."""
        out: list[Residual] = []
        robot, last = context.robot, 0
        standing = to_mask(context.schedule, robot) & ~context.turning
        lone = alone(robot, standing)
        ceiling = ceilings(to_mask(context.schedule, robot), context.turning, lone, self.rise, self.free)
        for sole in robot.soles:
            own_points = slice(last, last := last + len(sole.points))
            stances = [s for s in context.schedule.stances if s.sole == sole.name]
            slot = robot.body_names.index(sole.body)
            tips = pivots(sole) if self.rise > 0.0 else {}
            own = np.vstack([sole.points, *tips.values()])
            count, total = len(sole.points), len(own)
            points = body_points(context.placements, slot, own)
            anchor = np.full((context.frames, total, 2), -1)
            resting = np.zeros((context.frames, total), bool)
            for stance in stances:
                during = slice(stance.start, stance.stop)
                start = points[during, stance.point, :2].mean(axis=0)  # the best anchor for feet that stay put
                anchor[during, stance.point] = variables.add(start)
                resting[during, stance.point] = True
            scale = np.tile([self.horizontal, self.horizontal, self.vertical], total)
            weights = np.repeat(resting, 3, axis=1) * (context.dt / scale**2)  # (T, 3 K)
            upper = np.zeros(weights.shape)
            upper[:, 2 : 3 * count : 3] = ceiling[:, own_points]
            steep = overhang(context, sole, own, resting[:, :count])
            upper[:, 2::3] = np.maximum(upper[:, 2::3], steep)
            for number, part in enumerate(tips):
                for first, stop in pivoting(standing[:, own_points], lone[:, own_points], sole.parts, part):
                    during = slice(first, stop)
                    anchor[during, count + number] = variables.add(points[during, count + number, :2].mean(axis=0))
                    resting[during, count + number] = True
                    weights[during, 3 * (count + number) : 3 * (count + number) + 3] = context.dt / scale[:3] ** 2
            names = [*(f"{part} {k}" for k, part in enumerate(sole.parts)), *(f"{part} tip" for part in tips)]
            rows = [f"{name} {axis}" for name in names for axis in "xyz"]
            held = tuple(Held(sole.body, tuple(point)) for point in own.tolist())
            residual = anchored(context, variables, f"stance/{sole.name}", rows, held, anchor, resting, upper, weights)
            out += [] if residual is None else [residual]
        return out + (limb_anchors(context, variables, self.limb) if self.limb > 0.0 else [])
