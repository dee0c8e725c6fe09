"""From a robot clip to one that can be followed: levelling, contacts, the whole-clip problem."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gmr_traj.collision.untangle import untangle
from gmr_traj.contacts.carrying import carrying
from gmr_traj.contacts.detect import detect
from gmr_traj.contacts.ends import continued
from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.exceptions import ClipError, ProblemError, RobotError, ScheduleError
from gmr_traj.kinematics.casadi_kinematics import CasadiKinematics
from gmr_traj.misfit import fitted
from gmr_traj.motion import RobotMotion
from gmr_traj.outcome import SolveReport
from gmr_traj.problem import Problem
from gmr_traj.references import BodyTargets
from gmr_traj.robot import Robot
from gmr_traj.task import Task
from gmr_traj.trust import NONE, trust, without_spoiled_ends
from gmr_traj.whole_clip import Progress, solve_clip
from gmr_traj.windows import solve_windows


@dataclass(frozen=True)
class Refinement:
    """A refined clip.

    Attributes:
        motion: the result; same frames, rate and joints as the input.
        levelled: the input, raised by the schedule's height to stand on the floor.
        schedule: the stances the result was planted by.
        report: how the problem was solved.
        seen: the stances that heights and speeds of the input show; None where the schedule was given.
    """

    motion: RobotMotion
    levelled: RobotMotion
    schedule: ContactSchedule
    report: SolveReport
    seen: ContactSchedule | None = None


def refine(
    motion: RobotMotion,
    robot: Robot,
    problem: Problem,
    *,
    schedule: ContactSchedule | None = None,
    references: BodyTargets | None = None,
    source_stances: ContactSchedule | None = None,
    held: np.ndarray | None = None,
    window: float | None = None,
    overlap: float | None = None,
    kinematics: CasadiKinematics | None = None,
    progress: Progress | None = None,
) -> Refinement:
    """Solve the problem for one clip.

    Args:
        motion: the input.
        robot: whose joints it moves, in the same order.
        problem: terms and solver.
        schedule: stances, in frames of ``motion``; detected where none is given.
        references: where the source has the bodies, in the world of ``motion``; where they are given they are tracked,
            fitted to the robot (see :mod:`~gmr_traj.misfit`), instead of the clip.
        source_stances: when the sole points are in stance in the source, for the detection of stances.
        held: frames that keep the input's configuration, raised to the floor.  # (H,)
        window: length of the windows to solve one after another [s]; None for the whole clip at once.
        overlap: look-ahead of a window beyond the frames that are kept of it [s].
        kinematics: of the robot; whoever refines many clips keeps one, because what was compiled for it is used again.
        progress: called with what is being done, steps done and steps in all.

    Raises:
        ClipError: the clip's joints are not the robot's, it is too short to have an acceleration, or the references
            have another length.
        RobotError: the kinematics are of another robot.
        ScheduleError: the schedule is for another clip.
        ProblemError: an overlap without a window, or windows that cannot be; a term that cannot be what it is used as.
        SolverError: Ipopt could not be run.
    """
    if kinematics is not None and kinematics.robot is not robot:
        raise RobotError(f"the kinematics are of {kinematics.robot.name}, not of this {robot.name}")
    if motion.joint_names != robot.joint_names:
        raise ClipError(f"the clip moves {len(motion.joint_names)} joints, the robot {robot.name} has {robot.dof}")
    if motion.frames < 4:
        raise ClipError(f"the clip has {motion.frames} frames; at least 4 are needed to speak of smoothness")
    if references is not None and references.frames != motion.frames:
        raise ClipError(f"the references have {references.frames} frames, the clip {motion.frames}")
    if window is None and overlap is not None:
        raise ProblemError(
            f"an overlap of {overlap:g} s is of windows, and there are none: give a window's length, too"
        )
    believed, seen = trust(motion), None
    known = believed > NONE
    if schedule is None:
        seen = detect(motion, robot, source=source_stances)
        schedule = continued(seen, robot, known)
        if any(item.term.dynamic for item in problem.terms):
            schedule = carrying(schedule, motion, robot)
    elif schedule.frames != motion.frames:
        raise ScheduleError(f"the contact schedule has {schedule.frames} frames, the clip {motion.frames}")
    elif abs(schedule.fps - motion.fps) > 1e-3 * motion.fps:
        raise ScheduleError(f"the contact schedule is for {schedule.fps:g} fps, the clip has {motion.fps:g}")
    levelled = motion.shifted(schedule.height)
    kinematics = kinematics or CasadiKinematics(robot)
    # Where a limb is deep in the body the input is no reference: start from, and stay near, a way around.
    start, _ = untangle(robot, without_spoiled_ends(levelled, known))
    fixed = np.zeros(0, int) if held is None else held
    targets = None
    if references is not None:
        targets = fitted(references.raised(schedule.height), robot, start, believed)
    task = Task(start, start, believed, schedule, held=fixed, references=targets)
    if window is None:
        result, report = solve_clip(task, kinematics, problem, progress)
    else:
        result, report = solve_windows(task, kinematics, problem, window, overlap, progress)
    return Refinement(result, levelled, schedule, report, seen)
