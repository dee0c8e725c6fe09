"""`gmr-traj refine`: from file to file, with the certificate measured on what was written."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gmr_traj import atomic
from gmr_traj._version import __version__
from gmr_traj.cli import outputs, recordings, tables
from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.cli.human_input import Start, start
from gmr_traj.cli.refine_lead import to_json, wanted_leads, with_leads
from gmr_traj.cli.refine_otherwise import Settled, settle
from gmr_traj.cli.terminal import console, progress
from gmr_traj.collision.audit import audit
from gmr_traj.contacts import schedule_json
from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.contacts.source_level import source_height
from gmr_traj.exceptions import ScheduleError
from gmr_traj.formats import Clip, read_clip, write_clip
from gmr_traj.formats.human import is_human
from gmr_traj.interrupts import passed_on
from gmr_traj.metrics import Certificate, certify
from gmr_traj.motion import RobotMotion
from gmr_traj.problem import Problem, load_problem
from gmr_traj.refine import Refinement, refine
from gmr_traj.robot import Robot
from gmr_traj.verify.physics_change import PhysicsChange, physics_change

if TYPE_CHECKING:
    from gmr_traj.cli.refine_arguments import Refine, RefineOptions
    from gmr_traj.kinematics.casadi_kinematics import CasadiKinematics
    from gmr_traj.whole_clip import Progress


@dataclass(frozen=True)
class Written:
    """A refined clip that was written.

    Attributes:
        clip: as it was read back, its targets on the floor.
        certificate: of the file.
        physics: the dynamics of the input and of the file.
        audit: overlaps of the model's own collision shapes, the deepest first.
    """

    clip: Clip
    certificate: Certificate
    physics: PhysicsChange
    audit: list[dict[str, Any]]


def run(arguments: Refine) -> int:
    """Refine one clip.

    Returns:
        0 where every promise of the certificate holds, 3 where one is broken, 4 where the solver did not converge.

    Raises:
        GmrTrajError: anything the user can put right; nothing was written then.
    """
    method = arguments.method if is_human(arguments.clip) else None
    file_format = arguments.format or (None if method is None else "gmr-traj")
    planned = outputs.plan(arguments.clip, arguments.output, file_format, arguments.save_contacts, arguments.force)
    recording = recordings.plan(arguments)
    leads = wanted_leads(arguments)
    problem = load_problem(arguments.problem)
    with progress(not arguments.quiet) as callback, passed_on():
        begun = start(arguments, callback)
        schedule, extended, held = given_schedule(arguments.contacts, begun.clip, begun.robot), None, None
        if leads is not None:
            begun, schedule, extended = with_leads(begun, schedule, leads)
            held = extended.held
        settled = settle(
            begun.clip,
            begun.robot,
            problem,
            lambda one: solve(begun, schedule, arguments, one, callback, held),
        )
    clip, refinement = begun.clip, settled.refinement
    converged = refinement.report.status != "not converged"
    target = planned.clip if converged else planned.unconverged
    with outputs.staged(target) as staged:
        written = write(staged, begun, settled, arguments.format)
        certificate = written.certificate
        code = _exit_code(converged, certificate)
        report = _report(arguments, method, target, clip, settled, certificate, code)
        report["lead"] = to_json(extended)
        report["physics"] = written.physics.to_json()
        report["audit"] = written.audit
        text = json.dumps(report, indent=2) + "\n"
        if recording is not None:
            trace = refinement.report.trace
            recordings.write(recording, begun, written.clip, refinement.schedule, certificate, trace)
        outputs.publish(staged, target, planned.report(target), text)
    if planned.contacts is not None:
        with atomic.write(planned.contacts) as stream:
            stream.write(schedule_json.to_json(refinement.schedule, refinement.seen).encode())
    if arguments.json:
        print(text, end="")
    elif not arguments.quiet:
        _show(clip, target, settled, written, code)
    if recording is not None:
        recordings.announce(recording, arguments)
    return code


def solve(
    begun: Start,
    schedule: ContactSchedule | None,
    arguments: RefineOptions,
    problem: Problem,
    callback: Progress | None = None,
    held: np.ndarray | None = None,
    kinematics: CasadiKinematics | None = None,
) -> Refinement:
    """Refine a clip that was read, with its schedule, or one that is detected; ``held`` are frames that stay.

    Raises:
        GmrTrajError: the schedule, the windows or the problem do not fit the clip.
    """
    clip = begun.clip
    return refine(
        clip.motion,
        begun.robot,
        problem,
        schedule=schedule,
        references=clip.references,
        source_stances=begun.stances,
        held=held,
        window=arguments.window,
        overlap=arguments.overlap,
        kinematics=kinematics,
        progress=callback,
    )


def write(path: Path, begun: Start, settled: Settled, file_format: str | None) -> Written:
    """Write a refined clip and measure what was written.

    Args:
        path: the file; an existing one is replaced.
        begun: what was refined.
        settled: what it came to.
        file_format: format of the file; the input's where None.

    Raises:
        ClipError: the format cannot hold the clip.
    """
    refinement = settled.refinement
    write_clip(grounded(begun, refinement.motion, refinement.schedule), path, format=file_format, robot=begun.robot)
    # Measured on the file as it was written, read back, not on what was meant to be written.
    return read_back(path, begun, refinement.schedule, file_format, settled)


def read_back(
    path: Path, begun: Start, schedule: ContactSchedule, file_format: str | None, settled: Settled | None = None
) -> Written:
    """Measure a refined clip that was written.

    Args:
        path: the file.
        begun: what was refined.
        schedule: the stances it was planted by.
        file_format: that was asked for; the input's where None.
        settled: what was written; its certificate is the file's where the file has the same motion.
    """
    clip, robot = begun.clip, begun.robot
    motion = read_clip(path, robot, format=file_format or clip.format, fps=clip.motion.fps).motion
    certificate = None if settled is None else settled.certificate_of(motion)
    if certificate is None:
        height, references = schedule.height, clip.references
        certificate = certify(clip.motion, motion, robot, schedule, levelling=height, references=references)
    physics = physics_change(clip.motion, motion, robot, schedule.height)
    return Written(grounded(begun, motion, schedule), certificate, physics, _audit(motion, robot))


def given_schedule(path: Path | None, clip: Clip, robot: Robot) -> ContactSchedule | None:
    """The schedule the user or the clip brings along; None to detect one."""
    if path is None:
        return clip.schedule
    motion = clip.motion
    try:
        return schedule_json.from_json(path.read_text(), robot, frames=motion.frames, fps=motion.fps)
    except UnicodeDecodeError:
        raise ScheduleError(f"{path}: this is not text; expected JSON as --save-contacts writes it") from None
    except ScheduleError as error:
        raise ScheduleError(f"{path}: {error}") from error


def grounded(begun: Start, motion: RobotMotion, schedule: ContactSchedule) -> Clip:
    """The clip to write: the refined motion, its schedule, and the source's targets on the same floor."""
    references = begun.clip.references
    if references is not None:
        references = references.raised(source_height(references, begun.robot, schedule))
    # The written motion stands on the floor already, so its schedule has nothing left to raise.
    return replace(begun.clip, motion=motion, schedule=replace(schedule, height=0.0), references=references)


def _audit(written: RobotMotion, robot: Robot) -> list[dict[str, Any]]:
    """Overlaps of the model's own collision geometry, by python-fcl, the deepest first."""
    return [
        {"shapes": list(found.shapes), "depth_mm": round(1e3 * found.depth, 3), "frame": found.frame}
        for found in audit(robot, written.qpos)
    ]


def _exit_code(converged: bool, certificate: Certificate) -> ExitCode:
    if not converged:
        return ExitCode.NOT_CONVERGED
    return ExitCode.OK if certificate.held else ExitCode.BROKEN_PROMISE


def _report(
    arguments: Refine,
    method: str | None,
    target: Path,
    clip: Clip,
    settled: Settled,
    certificate: Certificate,
    code: ExitCode,
) -> dict[str, Any]:
    """Everything there is to know about the run, ready for JSON; ``method`` is how a human motion was retargeted."""
    return {
        "gmr_traj": __version__,
        "input": str(arguments.clip),
        "output": str(target),
        "source": None if arguments.source is None else str(arguments.source),
        "retargeted": method,
        "format": arguments.format or clip.format,
        "robot": arguments.robot,
        "problem": arguments.problem,
        "solved": settled.problem,
        "exit_code": int(code),
        "meaning": code.meaning,
        "notes": [*clip.notes, *filter(None, [settled.note])],
        "certificate": certificate.to_json(),
        "solver": settled.refinement.report.to_json(),
        "contacts": json.loads(schedule_json.to_json(settled.refinement.schedule, settled.refinement.seen)),
    }


def _show(clip: Clip, target: Path, settled: Settled, written: Written, code: ExitCode) -> None:
    """Print what was decided, what was solved, what it measures, and where it went."""
    screen, report = console(), settled.refinement.report
    for note in (*clip.notes, *filter(None, [settled.note])):
        screen.print(f"note: {note}", markup=False)
    done = f"{clip.motion.frames} frames, {report.iterations} iterations"
    if report.repairs:
        done += f", {report.repair_iterations} more on {report.repairs} part{'s' * (report.repairs > 1)} of it"
    screen.print(f"{report.solver_status}: {done}, {report.seconds:.1f} s", markup=False)
    if report.message:
        screen.print(report.message, markup=False)
    screen.print(tables.certificate(written.certificate))
    screen.print(tables.physics(written.physics))
    for warning in written.physics.warnings:
        screen.print(f"warning: {warning}", markup=False)
    if code is not ExitCode.OK:
        screen.print(code.meaning, markup=False)
    screen.print(f"written: {target}", markup=False, soft_wrap=True)
