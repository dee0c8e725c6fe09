"""`gmr-traj retarget`: from a human motion to a robot's clip."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gmr_traj._version import __version__
from gmr_traj.cli import outputs
from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.cli.human_input import retargeted_clip
from gmr_traj.cli.human_options import about
from gmr_traj.cli.terminal import console, progress
from gmr_traj.formats import write_clip
from gmr_traj.formats.clip import SUFFIXES
from gmr_traj.human_motion import HumanMotion
from gmr_traj.retarget.retarget import Retargeted, retarget
from gmr_traj.robot_loading import load_robot

if TYPE_CHECKING:
    from gmr_traj.cli.retarget_arguments import Retarget


@dataclass(frozen=True)
class _Run:
    """What there is to report.

    Attributes:
        target: the file that was written.
        human: the motion that was read.
        map: name of the map.
        result: the retargeted clip.
        seconds: how long the retargeting took.
        notes: of reading, retargeting and writing.
    """

    target: Path
    human: HumanMotion
    map: str
    result: Retargeted
    seconds: float
    notes: tuple[str, ...]


def run(arguments: Retarget) -> int:
    """Retarget one motion.

    Returns:
        0.

    Raises:
        GmrTrajError: anything the user can put right; nothing was written then.
    """
    file = arguments.file
    target = arguments.output or file.with_name(f"{file.stem}_retargeted{SUFFIXES[arguments.format]}")
    outputs.check(target, file, arguments.force)
    robot = load_robot(arguments.robot)
    human = arguments.read_human(file, arguments.fps)
    body_map = arguments.load_map(human, file, robot)
    started = time.perf_counter()
    with progress(not arguments.quiet) as callback, about(file):
        result = retarget(
            human,
            robot,
            body_map,
            method=arguments.method,
            velocity_limit=arguments.velocity_limit,
            progress=callback,
        )
    seconds = time.perf_counter() - started
    clip, _, _ = retargeted_clip(human, result, robot, body_map, file)
    lost = write_clip(clip, target, format=arguments.format, robot=robot)
    done = _Run(target, human, body_map.name, result, seconds, (*clip.notes, *lost))
    if arguments.json:
        print(json.dumps(_report(arguments, done), indent=2, allow_nan=False))
    elif not arguments.quiet:
        _show(arguments, done)
    return ExitCode.OK


def _report(arguments: Retarget, done: _Run) -> dict[str, Any]:
    """Everything there is to know about the run, ready for JSON."""
    motion, result = done.result.motion, done.result
    return {
        "gmr_traj": __version__,
        "input": str(arguments.file),
        "output": str(done.target),
        "format": arguments.format,
        "rig": done.human.rig,
        "human_height": done.human.height,
        "map": done.map,
        "robot": motion.robot,
        "method": arguments.method,
        "velocity_limit": arguments.velocity_limit,
        "frames": motion.frames,
        "fps": motion.fps,
        "raised": result.raised,
        "steps": result.steps,
        "seconds": done.seconds,
        "notes": list(done.notes),
    }


def _show(arguments: Retarget, done: _Run) -> None:
    """Print what was decided, what was done, and where it went."""
    screen, motion, result = console(), done.result.motion, done.result
    for note in done.notes:
        screen.print(f"note: {note}", markup=False)
    screen.print(
        f"{done.human.rig} to {motion.robot} ({done.map}, {arguments.method}): {motion.frames} frames at "
        f"{motion.fps:g} Hz in {done.seconds:.1f} s ({motion.frames / done.seconds:.0f} frames/s), "
        f"raised by {1e3 * result.raised:.1f} mm",
        markup=False,
    )
    screen.print(f"written: {done.target}", markup=False, soft_wrap=True)
