"""`gmr-traj inspect`: the artefact report of a clip, or a ranking of many."""

from __future__ import annotations

import json
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.markup import escape

from gmr_traj import contacts
from gmr_traj.cli import tables
from gmr_traj.cli.clip_files import clip_files
from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.cli.terminal import console
from gmr_traj.exceptions import GmrTrajError
from gmr_traj.formats import Clip, read_clip
from gmr_traj.metrics import Artefact, Figures, clip_score
from gmr_traj.metrics.artefacts import find_artefacts
from gmr_traj.metrics.figures import figures
from gmr_traj.metrics.observation import observe
from gmr_traj.robot import Robot
from gmr_traj.robot_loading import load_robot, reduce_robot


@dataclass(frozen=True)
class Inspection:
    """What was found in one clip.

    Attributes:
        path: the file.
        clip: what it held.
        score: how bad the clip is on the whole, see :func:`gmr_traj.metrics.clip_score`.
        figures: its figures, as it is.
        artefacts: its artefacts, worst first.
    """

    path: Path
    clip: Clip
    score: float
    figures: Figures
    artefacts: tuple[Artefact, ...]

    def to_json(self) -> dict[str, Any]:
        """The inspection, ready for ``json.dumps``."""
        return {
            "clip": str(self.path),
            "format": self.clip.format,
            "robot": self.clip.motion.robot,
            "notes": list(self.clip.notes),
            "score": self.score,
            "figures": self.figures.to_json(),
            "artefacts": [artefact.to_json() for artefact in self.artefacts],
        }


def inspect(
    paths: list[Path],
    robot: str,
    as_json: bool,
    top: int,
    fps: float | None,
    quaternion: str | None,
    format: str | None,
) -> int:
    """Report what is wrong with clips, and change nothing.

    One file is reported in full; a folder (searched with its subfolders) or several files are ranked, the worst
    first.  A file that cannot be read is reported on stderr, one line each, and the others still are inspected.

    Args:
        paths: clips and folders of clips.
        robot: name of a robot, or path of a robot.toml.
        as_json: print JSON with every artefact instead of tables.
        top: how many artefacts of one clip, or clips of a ranking, to list in tables.
        fps: frame rate of clips whose file has none.
        quaternion: ``xyzw`` or ``wxyz`` where a file cannot tell.
        format: format of the clips; by default each is detected.

    Returns:
        The exit code: 0, or that of bad input where a file could not be read.

    Raises:
        GmrTrajError: where the robot cannot be loaded, a path does not exist, or a folder has no clips.
    """
    if top < 1:
        raise GmrTrajError(f"--top is {top}; it must be at least 1")
    full = load_robot(robot)
    files = list(clip_files(paths))
    reduced: dict[tuple[str, ...], Robot] = {full.joint_names: full}
    found: list[Inspection] = []
    unreadable: list[tuple[Path, str]] = []
    for path in files:
        try:
            clip = read_clip(path, full, format=format, fps=fps, quaternion=quaternion)
            joints = clip.motion.joint_names
            if joints not in reduced:
                reduced[joints] = reduce_robot(full, joints)
            found.append(inspect_clip(path, clip, reduced[joints]))
        except (GmrTrajError, OSError) as error:
            line = " ".join(str(error).split())
            unreadable.append((path, line if str(path) in line else f"{path}: {line}"))
    found.sort(key=lambda inspection: (-inspection.score, str(inspection.path)))
    ranking = len(files) > 1 or paths[0].is_dir()
    if as_json:
        report = {
            "clips": [inspection.to_json() for inspection in found],
            "unreadable": [{"clip": str(path), "error": line} for path, line in unreadable],
        }
        print(json.dumps(report, indent=2, allow_nan=False))
    elif ranking and found:
        _print_ranking(found, top)
    elif found:
        _print_report(found[0], top)
    for _, line in unreadable:
        print(f"gmr-traj: error: {line}", file=sys.stderr)
    return ExitCode.BAD_INPUT if unreadable else ExitCode.OK


def inspect_clip(path: Path, clip: Clip, robot: Robot) -> Inspection:
    """Find the artefacts of a clip that was read.

    The contact schedule is the file's own where it has one, and is detected otherwise.

    Raises:
        ClipError, ScheduleError: where joints or schedule do not fit the robot or the clip.
    """
    motion = clip.motion
    schedule = clip.schedule if clip.schedule is not None else contacts.detect(motion, robot)
    observation = observe(motion, robot)
    artefacts = find_artefacts(observation, schedule)
    return Inspection(path, clip, clip_score(artefacts, motion), figures(observation, schedule), artefacts)


def _print_report(inspection: Inspection, top: int) -> None:
    screen, measured, clip = console(), inspection.figures, inspection.clip
    screen.print(
        f"[bold]{escape(str(inspection.path))}[/bold]  {clip.format}, {measured.frames} frames at "
        f"{measured.fps:g} Hz ({measured.seconds:.1f} s), score {inspection.score:.2f}"
    )
    for note in clip.notes:
        screen.print(f"  {escape(note)}", style="dim")
    if not inspection.artefacts:
        screen.print("no artefacts")
        return
    screen.print()
    screen.print(tables.kinds(inspection.artefacts, measured.seconds))
    shown = min(top, len(inspection.artefacts))
    screen.print(f"\n[bold]the worst {shown} of {len(inspection.artefacts)}[/bold]")
    screen.print(tables.artefacts(inspection.artefacts, top))


def _print_ranking(found: list[Inspection], top: int) -> None:
    screen = console()
    home = Path(os.path.commonpath([i.path.absolute().parent for i in found]))
    rows = [(str(i.path.absolute().relative_to(home)), i.score, i.figures, i.artefacts) for i in found[:top]]
    screen.print(f"[bold]{escape(str(home))}[/bold]: {len(found)} clips, the worst first")
    screen.print(tables.ranking(rows))
    if len(found) > top:
        screen.print(f"... and {len(found) - top} better ones (--top {len(found)} lists all)", style="dim")
