"""The audit: what a clip's dynamics ask for that neither the floor nor the motors can give, frame by frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from gmr_traj.constants import GRAVITY
from gmr_traj.metrics.artefact import Artefact, Collector
from gmr_traj.metrics.balance import centre_of_mass
from gmr_traj.metrics.floor_depth import lowest_points
from gmr_traj.metrics.observation import observe
from gmr_traj.metrics.settings import Settings, shipped
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot
from gmr_traj.verify.balance import margins, pressure_distances, zero_moment_point
from gmr_traj.verify.contact_forces import support
from gmr_traj.verify.contact_points import contact_points
from gmr_traj.verify.inverse_dynamics import demand


@dataclass(frozen=True)
class Audit:
    """Figures of every frame of one clip, and what is wrong.

    Attributes:
        fps: frames per second.
        residual_force: |force| on the base that nothing provides, over m g.  # (T,)
        residual_moment: |moment| about its origin, over m g times 1 m.  # (T,)
        joint_torque: |torque| over effort limit.  # (T, n)
        depth: deepest point of the robot below the floor, 0 where there is none [m].  # (T,)
        zmp_margin: distance of the zero-moment point inside the support, not a number where there is none [m].  # (T,)
        com_cop: horizontal distance of the centres of mass and of pressure, not a number in flight [m].  # (T,)
        forces: contact forces [N].  # (T, K, 3)
        joint_names: the joints.  # n
        infeasible: whether any figure of the frame is above what the settings report.  # (T,)
        faults: the stretches, worst first.
        failures: why the clip fails, one sentence each; empty where it passes.
    """

    fps: float
    residual_force: np.ndarray
    residual_moment: np.ndarray
    joint_torque: np.ndarray
    depth: np.ndarray
    zmp_margin: np.ndarray
    com_cop: np.ndarray
    forces: np.ndarray
    joint_names: tuple[str, ...]
    infeasible: np.ndarray
    faults: tuple[Artefact, ...]
    failures: tuple[str, ...]

    @property
    def passed(self) -> bool:
        """Whether the clip passes."""
        return not self.failures

    @property
    def share(self) -> float:
        """Share of infeasible frames."""
        return float(self.infeasible.mean())

    @property
    def worst_joint(self) -> str:
        """The joint whose torque is largest relative to its limit."""
        return self.joint_names[int(self.joint_torque.max(axis=0).argmax())]

    def summary(self) -> dict[str, Any]:
        """The clip in a few numbers, those that do not exist (a clip that only flies has no support) None."""
        outside = self.zmp_margin[np.isfinite(self.zmp_margin)] < 0.0
        return {
            "residual_force_mean": float(self.residual_force.mean()),
            "residual_force_p95": float(np.percentile(self.residual_force, 95)),
            "residual_force_max": float(self.residual_force.max()),
            "residual_moment_mean": float(self.residual_moment.mean()),
            "residual_moment_max": float(self.residual_moment.max()),
            "joint_torque_max": float(self.joint_torque.max()),
            "joint_torque_joint": self.worst_joint,
            "joint_torque_share": float((self.joint_torque > 1.0).any(axis=1).mean()),
            "depth_max": float(self.depth.max()),
            "zmp_margin_min": _extreme(self.zmp_margin, np.min),
            "zmp_outside_share": float(outside.mean()) if outside.size else None,
            "com_cop_mean": _extreme(self.com_cop, np.mean),
            "com_cop_max": _extreme(self.com_cop, np.max),
            "infeasible_share": self.share,
        }

    def to_json(self, frames: bool = False) -> dict[str, Any]:
        """The audit, ready for ``json.dumps``.

        Args:
            frames: the figures of every frame as well (of the joints the worst one).
        """
        out = {
            "passed": self.passed,
            "failures": list(self.failures),
            "summary": self.summary(),
            "faults": [fault.to_json() for fault in self.faults],
        }
        if frames:
            worst = self.joint_torque.argmax(axis=1)
            out["frames"] = {
                "residual_force": self.residual_force.tolist(),
                "residual_moment": self.residual_moment.tolist(),
                "joint_torque": self.joint_torque.max(axis=1).tolist(),
                "joint_torque_joint": [self.joint_names[j] for j in worst],
                "depth": self.depth.tolist(),
                "zmp_margin": _gaps(self.zmp_margin),
                "com_cop": _gaps(self.com_cop),
                "infeasible": self.infeasible.tolist(),
            }
        return out


def audit(motion: RobotMotion, robot: Robot, settings: Settings | None = None) -> Audit:
    """Audit the dynamics of a clip.

    Args:
        motion: the clip, with the floor at z = 0.
        robot: its robot, with the clip's joints.
        settings: ``configs/verify_audit.toml`` by default.

    Raises:
        ClipError: the clip's joints are not the robot's.
        SolverError: the contact forces of a frame could not be found.
    """
    bars = settings or shipped("verify_audit")
    observation = observe(motion, robot)
    mass = float(robot.model.body_mass.sum())
    weight = mass * GRAVITY
    needed = demand(motion, robot)
    points = contact_points(observation, bars)
    supported = support(robot, motion.qpos, needed, points, bars("contact", "friction"))
    heights, bodies = lowest_points(observation)
    signals = {
        "residual_force": (np.linalg.norm(supported.force, axis=1)[:, None] / weight, ("base",), "m g"),
        "residual_moment": (np.linalg.norm(supported.moment, axis=1)[:, None] / weight, ("base",), "m g m"),
        "joint_torque": (np.abs(supported.torque) / robot.effort_limit, robot.joint_names, "of limit"),
        "depth": (np.maximum(0.0, -heights), bodies, "m"),
    }
    collector = Collector(motion.fps, bars)
    faults = [
        fault
        for kind, (signal, names, unit) in signals.items()
        for fault in collector.collect(kind, names, signal, unit, 1.0)
    ]
    faults.sort(key=lambda fault: (-fault.score, fault.start, fault.where))
    infeasible = np.any([(s > bars(kind, "report")).any(axis=1) for kind, (s, _, _) in signals.items()], axis=0)
    return Audit(
        fps=motion.fps,
        residual_force=signals["residual_force"][0][:, 0],
        residual_moment=signals["residual_moment"][0][:, 0],
        joint_torque=signals["joint_torque"][0],
        depth=signals["depth"][0].max(axis=1),
        zmp_margin=margins(zero_moment_point(needed, motion.qpos[:, :3], mass), points),
        com_cop=pressure_distances(supported.forces, points, centre_of_mass(observation)),
        forces=supported.forces,
        joint_names=robot.joint_names,
        infeasible=infeasible,
        faults=tuple(faults),
        failures=_failures(faults, float(infeasible.mean()), bars),
    )


def _failures(faults: list[Artefact], share: float, bars: Settings) -> tuple[str, ...]:
    """What makes a clip fail: too many infeasible frames, or one figure far too large (the worst of each kind)."""
    failures = []
    if share > bars("clip", "share"):
        failures.append(
            f"{100 * share:.0f} % of the frames are infeasible (at most {100 * bars('clip', 'share'):.0f} %)"
        )
    kinds: set[str] = set()
    for fault in faults:
        if fault.score > 1.0 and fault.kind not in kinds:
            kinds.add(fault.kind)
            name, bar = fault.kind.replace("_", " "), bars(fault.kind, "severe")
            place = f"{fault.where}, frame {fault.peak}"
            failures.append(f"{name} of {fault.value:.3g} {fault.unit} at {place} (at most {bar:g})")
    return tuple(failures)


def _extreme(values: np.ndarray, of: Any) -> float | None:
    known = values[np.isfinite(values)]
    return float(of(known)) if known.size else None


def _gaps(values: np.ndarray) -> list[float | None]:
    return [float(v) if np.isfinite(v) else None for v in values]
