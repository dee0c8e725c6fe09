"""The rows of a comparison: a group is a title, its metrics, and the function that fills them."""

from __future__ import annotations

from collections.abc import Callable

from gmr_traj.comparison import figures
from gmr_traj.comparison.figures import Judged
from gmr_traj.comparison.metric import Measure, Metric

#: A group: its title, its metrics, and what fills them.
Group = tuple[str, tuple[Metric, ...], Callable[[Judged], dict[str, Measure]]]

#: The groups of a comparison in the order of its rows.
GROUPS: tuple[Group, ...] = (
    (
        "feet in stance",
        (
            Metric("slide_mean", "slide speed, mean", "mm/s"),
            Metric("slide_p95", "slide speed, 95 %", "mm/s"),
            Metric("slide_max", "slide speed, max", "mm/s"),
            Metric("drift_p95", "drift in a stance, 95 %", "mm"),
            Metric("drift_max", "drift in a stance, max", "mm"),
            Metric("float_mean", "height of the foot, mean", "mm"),
            Metric("hover_share", "robot more than 20 mm above the floor", "% of stance"),
        ),
        figures.foot_figures,
    ),
    (
        "contacts of the source",
        (
            Metric("contact_kept", "kept", "% of contact", "more"),
            Metric("contact_added", "added", "% of contact"),
        ),
        figures.contact_figures,
    ),
    (
        "floor",
        (
            Metric("penetration_max", "deepest point", "mm"),
            Metric("penetration_share", "deeper than 10 mm", "% of frames"),
        ),
        figures.penetration,
    ),
    (
        "self-penetration",
        (
            Metric("self_depth", "deepest", "mm"),
            Metric("self_share", "deeper than 1 mm", "% of frames"),
        ),
        figures.self_penetration,
    ),
    (
        "joints",
        (
            Metric("speed_ratio", "fastest, of its velocity limit", ""),
            Metric("over_share", "above a velocity limit", "% of frames"),
            Metric("jumps", "jumps", ""),
            Metric("jerk_rms", "jerk at 50 Hz, rms", "rad/s^3"),
            Metric("jerk_p99", "jerk at 50 Hz, 99 %", "rad/s^3"),
            Metric("limit_excess", "farthest out of range", "rad"),
            Metric("limit_share", "out of range", "% of frames"),
        ),
        figures.joint_figures,
    ),
    (
        "balance in stance",
        (
            Metric("com_cop_mean", "centre of mass to centre of pressure, mean", "mm"),
            Metric("com_cop_longest", "longest farther than 100 mm", "s"),
            Metric("zmp_margin_p05", "margin of the zero-moment point, 5 %", "mm", "more"),
            Metric("zmp_outside", "zero-moment point outside the support", "% of stance"),
        ),
        figures.balance_figures,
    ),
    (
        "distance to the scaled person",
        (
            Metric("position_mean", "position, mean", "mm"),
            Metric("position_max", "position, max", "mm"),
            Metric("relative_mean", "position relative to the base, mean", "mm"),
            Metric("orientation_mean", "orientation, mean", "deg"),
            Metric("orientation_max", "orientation, max", "deg"),
        ),
        figures.faithfulness_figures,
    ),
)
