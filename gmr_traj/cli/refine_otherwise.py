"""The problem that was asked for, and the one to solve instead where that one breaks a promise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from gmr_traj.formats import Clip
from gmr_traj.metrics import Certificate, certify
from gmr_traj.motion import RobotMotion
from gmr_traj.problem import Problem, load_problem
from gmr_traj.refine import Refinement
from gmr_traj.robot import Robot


@dataclass(frozen=True)
class Settled:
    """What was chosen.

    Attributes:
        refinement: of the clip.
        problem: name of the problem that it solves.
        note: why that is not the one that was asked for; empty where it is.
        certificate: of the refined motion; None where nothing hung on it.
    """

    refinement: Refinement
    problem: str
    note: str = ""
    certificate: Certificate | None = None

    def certificate_of(self, motion: RobotMotion) -> Certificate | None:
        """The certificate, if the motion is the one that it was measured on, bit for bit."""
        own = self.refinement.motion
        same = motion.fps == own.fps and motion.qpos.tobytes() == own.qpos.tobytes()
        return self.certificate if same else None


def settle(clip: Clip, robot: Robot, problem: Problem, solved: Callable[[Problem], Refinement]) -> Settled:
    """Solve a problem; if a promise is broken, or the solver does not converge, the one it names for that case as well.

    The second one counts where it converges and breaks fewer promises, or where the first one did not even converge.

    Args:
        clip: what is refined.
        robot: its robot.
        problem: what was asked for.
        solved: solves a problem for the clip.

    Raises:
        GmrTrajError: as ``solved`` does; there is no such other problem.
    """
    first = solved(problem)
    if problem.otherwise is None:
        return Settled(first, problem.name)
    certificate = _certificate(clip, robot, first)
    if _converged(first) and certificate.held:
        return Settled(first, problem.name, "", certificate)
    instead = load_problem(problem.otherwise)
    second = solved(instead)
    other = _certificate(clip, robot, second)
    if not _converged(second) or (_converged(first) and len(other.broken) >= len(certificate.broken)):
        return Settled(first, problem.name, "", certificate)
    broken = ", ".join(promise.name for promise in certificate.broken)
    why = f"breaks a promise ({broken})" if _converged(first) else f"does not converge ({first.report.message})"
    return Settled(second, instead.name, f"the problem {problem.name} {why}; solved {instead.name} instead", other)


def _converged(refinement: Refinement) -> bool:
    return refinement.report.status != "not converged"


def _certificate(clip: Clip, robot: Robot, refinement: Refinement) -> Certificate:
    schedule = refinement.schedule
    return certify(
        clip.motion, refinement.motion, robot, schedule, levelling=schedule.height, references=clip.references
    )
