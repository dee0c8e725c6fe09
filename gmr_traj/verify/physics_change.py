"""What refining has done to the dynamics of a clip: the audit of the input beside that of the result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot
from gmr_traj.verify.audit import Audit, audit

# A figure may grow by this much before it counts as worse.
_SLACK = {"infeasible_share": 0.01, "joint_torque_share": 0.01, "residual_force_mean": 0.01}
_NAMES = {
    "infeasible_share": ("frames that nothing can make follow physics", "%", 100.0),
    "joint_torque_share": ("frames over a joint's effort limit", "%", 100.0),
    "residual_force_mean": ("force that nothing provides, mean", "m g", 1.0),
}


@dataclass(frozen=True)
class Figure:
    """One figure of both clips.

    Attributes:
        name: in words.
        unit: of the values.
        before, after: of the input, raised to stand on the floor, and of the result.
        worse: whether it has grown by more than chance would have it.
    """

    name: str
    unit: str
    before: float
    after: float
    worse: bool


@dataclass(frozen=True)
class PhysicsChange:
    """Audits of the input, raised to stand on the floor, and of the result."""

    before: Audit
    after: Audit

    @property
    def figures(self) -> tuple[Figure, ...]:
        """The figures that refining must not make worse."""
        before, after = self.before.summary(), self.after.summary()
        return tuple(
            Figure(name, unit, factor * before[key], factor * after[key], after[key] > before[key] + _SLACK[key])
            for key, (name, unit, factor) in _NAMES.items()
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """What has become worse, a sentence each, with what to try."""
        return tuple(
            f"{figure.name}: {figure.after:.3g} {figure.unit}, the input has {figure.before:.3g}; look at its contact "
            "schedule (--save-contacts), which says where forces can be, or try --problem refine_kinematic"
            for figure in self.figures
            if figure.worse
        )

    def to_json(self) -> dict[str, Any]:
        """Both audits in a few numbers each, and the warnings; ready for ``json.dumps``."""
        return {"before": self.before.summary(), "after": self.after.summary(), "warnings": list(self.warnings)}


def physics_change(raw: RobotMotion, refined: RobotMotion, robot: Robot, levelling: float) -> PhysicsChange:
    """Audit a clip before and after.

    Args:
        raw: the input.
        refined: the result.
        robot: robot of both.
        levelling: how far the input was raised to stand on the floor [m]; a clip that floats would pass for flying.

    Raises:
        ClipError: the joints of a clip are not the robot's.
        SolverError: the contact forces of a frame could not be found.
    """
    return PhysicsChange(audit(raw.shifted(levelling), robot), audit(refined, robot))
