"""What verification adds to a comparison: the audit, and how a simulated robot follows each clip."""

from __future__ import annotations

import numpy as np

from gmr_traj.comparison.entrant import cut_targets
from gmr_traj.comparison.figures import Judged
from gmr_traj.comparison.groups import Group
from gmr_traj.comparison.metric import Measure, Metric
from gmr_traj.metrics.faithfulness import target_distances
from gmr_traj.metrics.observation import observe
from gmr_traj.motion import RobotMotion
from gmr_traj.resampling import resample
from gmr_traj.verify.audit import audit
from gmr_traj.verify.conditions import Conditions
from gmr_traj.verify.rollout import Rollout
from gmr_traj.verify.trials import Choice, Job, Report, run_job

_AUDIT = (
    Metric("infeasible_share", "infeasible", "% of frames"),
    Metric("residual_force_mean", "residual force, mean", "m g"),
    Metric("residual_force_max", "residual force, max", "m g"),
    Metric("joint_torque_max", "largest torque, of its limit", ""),
)
_ROLLOUT = (
    Metric("rollout_success", "followed to the end (anchor rule)", "%", "more"),
    Metric("rollout_full", "the same with hands and feet", "%", "more"),
    Metric("rollout_alive", "followed", "% of the clip", "more"),
    Metric("g_mpbpe", "E_g-mpbpe, to the clip in the world", "mm"),
    Metric("mpbpe", "E_mpbpe, to the clip relative to the base", "mm"),
    Metric("mpjpe", "E_mpjpe, to the clip's joints", "1e-3 rad"),
    Metric("tracked_source", "rollout to the scaled person", "mm"),
)


def verify_groups(
    choice: Choice, conditions: Conditions, seed: int = 0, threads: int = 1, report: Report | None = None
) -> tuple[Group, ...]:
    """Groups for ``compare``: the audit, and one rollout of each clip with the same controller and seed.

    Errors are over the moments before a fall.  A tracker may forgive a bad reference of its own, so the rollout is held
    against the scaled person too, where there is one.

    Args:
        choice: of the controller.
        conditions: of the rollouts.
        seed: of everything random.
        threads: that a rollout computes with; the results do not depend on it.
        report: called with what is going on, how much of it is done and how much there is.
    """
    title = f"rollout ({choice.kind}, {conditions.name})"

    def rolled_out(judged: Judged) -> dict[str, Measure]:
        own = judged.clip.own
        job = Job(own.robot.path, own.motion, conditions, choice, (seed, 0), threads=threads)
        return _figures(judged, run_job(job, report, f" of {judged.clip.name}"))

    return ("audit", _AUDIT, _audited), (title, _ROLLOUT, rolled_out)


def _audited(judged: Judged) -> dict[str, Measure]:
    found = audit(judged.clip.own.motion, judged.clip.own.robot)
    peak = int(found.residual_force.argmax())
    return {
        "infeasible_share": Measure(100.0 * found.share),
        "residual_force_mean": Measure(float(found.residual_force.mean())),
        "residual_force_max": Measure(float(found.residual_force[peak]), f"{peak / found.fps:.2f} s"),
        "joint_torque_max": Measure(float(found.joint_torque.max()), found.worst_joint),
    }


def _figures(judged: Judged, rollout: Rollout) -> dict[str, Measure]:
    followed = rollout.tracking
    how = rollout.controller if followed.success else f"{rollout.controller}, {followed.fell:.2f} s: {followed.reason}"
    return {
        "rollout_success": Measure(100.0 * followed.success, how),
        "rollout_full": Measure(100.0 * followed.success_full),
        "rollout_alive": Measure(100.0 * followed.alive / followed.length),
        "g_mpbpe": Measure(followed.g_mpbpe),
        "mpbpe": Measure(followed.mpbpe),
        "mpjpe": Measure(followed.mpjpe),
        "tracked_source": Measure(_to_source(judged, rollout.motion)),
    }


def _to_source(judged: Judged, motion: RobotMotion) -> float | None:
    """Mean distance of a rollout's bodies to the scaled person [mm], after one turn and shift; None without one."""
    if judged.targets is None:
        return None
    slow = resample(motion, judged.fps)
    frames = min(slow.frames, judged.targets.frames)
    seen = observe(slow.with_qpos(slow.qpos[:frames]), judged.clip.own.robot)
    found = target_distances(seen, cut_targets(judged.targets, slice(0, frames)), judged.bodies)
    return 1e3 * float(np.mean(found.position[:, found.placed]))
