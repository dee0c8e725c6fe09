"""`gmr-traj refine`: from file to file, with the certificate measured on what was written."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gmr_traj import atomic
from gmr_traj._version import __version__
from gmr_traj.cli import outputs, recordings, tables
from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.cli.human_input import start
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
from gmr_traj.problem import load_problem
from gmr_traj.refine import Refinement, refine
from gmr_traj.robot import Robot

if TYPE_CHECKING:
    from gmr_traj.cli.refine_arguments import Refine


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
    problem = load_problem(arguments.problem)
    with progress(not arguments.quiet) as callback, passed_on():
        begun = start(arguments, callback)
        clip, robot = begun.clip, begun.robot
        schedule = _given_schedule(arguments.contacts, clip, robot)
        refinement = refine(
            clip.motion,
            robot,
            problem,
            schedule=schedule,
            references=clip.references,
            source_stances=begun.stances,
            window=arguments.window,
            overlap=arguments.overlap,
            progress=callback,
        )
    converged = refinement.report.status != "not converged"
    target = planned.clip if converged else planned.unconverged
    with outputs.staged(target) as staged:
        refined = _refined(clip, refinement, robot)
        write_clip(refined, staged, format=arguments.format, robot=robot)
        # Measured on the file as it was written, read back, not on what was meant to be written.
        written = read_clip(staged, robot, format=arguments.format or clip.format, fps=clip.motion.fps).motion
        schedule = refinement.schedule
        certificate = certify(
            clip.motion, written, robot, schedule, levelling=schedule.height, references=clip.references
        )
        code = _exit_code(converged, certificate)
        report = _report(arguments, method, target, clip, refinement, certificate, code)
        report["audit"] = _audit(written, robot)
        text = json.dumps(report, indent=2) + "\n"
        if recording is not None:
            recordings.write(recording, begun, refined.with_motion(written), refinement, certificate)
        outputs.publish(staged, target, planned.report(target), text)
    if planned.contacts is not None:
        with atomic.write(planned.contacts) as stream:
            stream.write(schedule_json.to_json(refinement.schedule).encode())
    if arguments.json:
        print(text, end="")
    elif not arguments.quiet:
        _show(clip, target, refinement, certificate, code)
    if recording is not None:
        recordings.announce(recording, arguments)
    return code


def _given_schedule(path: Path | None, clip: Clip, robot: Robot) -> ContactSchedule | None:
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


def _refined(clip: Clip, refinement: Refinement, robot: Robot) -> Clip:
    """The clip to write: the refined motion, its schedule, and the source's targets on the same floor."""
    references = clip.references
    if references is not None:
        references = references.raised(source_height(references, robot, refinement.schedule))
    # The written motion stands on the floor already, so its schedule has nothing left to raise.
    schedule = replace(refinement.schedule, height=0.0)
    return replace(clip, motion=refinement.motion, schedule=schedule, references=references)


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
    refinement: Refinement,
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
        "exit_code": int(code),
        "meaning": code.meaning,
        "notes": list(clip.notes),
        "certificate": certificate.to_json(),
        "solver": refinement.report.to_json(),
        "contacts": json.loads(schedule_json.to_json(refinement.schedule)),
    }


def _show(clip: Clip, target: Path, refinement: Refinement, certificate: Certificate, code: ExitCode) -> None:
    """Print what was decided, what was solved, what it measures, and where it went."""
    screen, report = console(), refinement.report
    for note in clip.notes:
        screen.print(f"note: {note}", markup=False)
    frames, iterations = clip.motion.frames, report.iterations
    screen.print(
        f"{report.solver_status}: {frames} frames, {iterations} iterations, {report.seconds:.1f} s", markup=False
    )
    if report.message:
        screen.print(report.message, markup=False)
    screen.print(tables.certificate(certificate))
    if code is not ExitCode.OK:
        screen.print(code.meaning, markup=False)
    screen.print(f"written: {target}", markup=False, soft_wrap=True)
