"""`gmr-traj compare`: retargets of one motion side by side."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING

from rich.markup import escape

from gmr_traj import atomic
from gmr_traj.cli.compare_arguments import Compare
from gmr_traj.cli.compare_tables import as_markdown, as_table, where_table
from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.cli.terminal import console, progress
from gmr_traj.comparison import Comparison, Entrant, Source, as_source, compare
from gmr_traj.comparison.groups import Group
from gmr_traj.exceptions import ClipError, GmrTrajError
from gmr_traj.formats import read_clip
from gmr_traj.formats.human import read_human
from gmr_traj.retarget.body_map import default_map_name, load_map
from gmr_traj.robot import Robot
from gmr_traj.robot_loading import load_robot

if TYPE_CHECKING:
    from gmr_traj.verify.trials import Report


def run(arguments: Compare) -> int:
    """Compare clips and print (or write) the table.

    Returns:
        The exit code, 0.

    Raises:
        GmrTrajError: an argument, a clip or the source cannot be used; the message says which and why.
    """
    markdown = arguments.markdown
    printed = str(markdown) == "-"
    if arguments.json and printed:
        raise GmrTrajError("--json and --markdown - both print on standard output; give one of them, or a file")
    if arguments.map is not None and arguments.source is None:
        raise GmrTrajError("--map scales the human motion of --source; give that as well")
    if markdown is not None and not printed:
        _check_output(markdown, arguments)
    robot = load_robot(arguments.robot)
    with progress(not arguments.json) as report:
        more = verification(arguments, robot, report)
        entrants = read_entrants(arguments, robot)
        source = None if arguments.source is None else read_source(arguments.source, robot, arguments.map)
        compared = compare(entrants, robot, source=source, seconds=arguments.seconds, more=more)
    if arguments.json:
        print(json.dumps(compared.to_json(), indent=2, allow_nan=False))
    elif printed:
        print(as_markdown(compared), end="")
    else:
        show(compared)
    if markdown is not None and not printed:
        with atomic.write(markdown) as stream:
            stream.write(as_markdown(compared).encode())
    return ExitCode.OK


def verification(arguments: Compare, robot: Robot, report: Report | None = None) -> tuple[Group, ...]:
    """The groups that --verify adds.

    Raises:
        GmrTrajError: the policy or the conditions cannot be used, or there is no --verify to use them.
    """
    if not arguments.verify:
        if arguments.policy is not None:
            raise GmrTrajError("--policy follows the clips of --verify; give that as well")
        return ()
    if arguments.seed < 0:
        raise GmrTrajError(f"--seed is {arguments.seed}; it must be at least 0")
    from gmr_traj.verify.compared import verify_groups
    from gmr_traj.verify.conditions import load_conditions
    from gmr_traj.verify.policy import load_policy
    from gmr_traj.verify.trials import Choice

    choice = Choice()
    if arguments.policy is not None:
        load_policy(arguments.policy, robot)  # what is wrong with it is said before any work is done
        choice = Choice("policy", policy=arguments.policy)
    return verify_groups(choice, load_conditions(arguments.conditions), arguments.seed, os.cpu_count() or 1, report)


def _check_output(markdown: Path, arguments: Compare) -> None:
    """Refuse to overwrite an input, or another file that nobody has said may be.

    Raises:
        GmrTrajError: naming the file.
    """
    inputs = [path for path in (*arguments.clips, arguments.source) if path is not None]
    if any(path.exists() and markdown.exists() and markdown.samefile(path) for path in inputs):
        raise GmrTrajError(f"{markdown}: is one of the clips or the source, which are never overwritten; name another")
    if markdown.exists() and not arguments.force:
        raise GmrTrajError(f"{markdown}: exists; --force overwrites it")


def read_entrants(arguments: Compare, robot: Robot) -> list[Entrant]:
    """Read the clips.

    Raises:
        GmrTrajError: there are more or fewer names than clips, or two are the same.
        ClipError: a clip cannot be read, or is not a motion of the robot.
    """
    names, paths = arguments.names or short_names(arguments.clips), arguments.clips
    if len(names) != len(paths):
        raise GmrTrajError(f"--names has {len(names)} names for {len(paths)} clips; give one for each")
    twice = next((name for k, name in enumerate(names) if name in names[:k]), None)
    if twice is not None:
        raise GmrTrajError(f"--names: two clips are called {twice!r}; give each a name of its own")
    entrants = []
    for name, path in zip(names, paths, strict=True):
        clip = read_clip(path, robot, format=arguments.input_format, fps=arguments.fps, quaternion=arguments.quaternion)
        entrants.append(Entrant(name, clip.motion, clip.references))
    return entrants


def short_names(paths: tuple[Path, ...]) -> tuple[str, ...]:
    """The shortest of stem, name and path below their common folder that tells all files apart.

    Raises:
        ClipError: a file is given twice.
    """
    absolute = [path.absolute() for path in paths]
    twice = next((path for k, path in enumerate(absolute) if path in absolute[:k]), None)
    if twice is not None:
        raise ClipError(f"{twice}: is given twice; to compare a clip with itself give --names")
    home = Path(os.path.commonpath([path.parent for path in absolute]))
    below = tuple(str(path.relative_to(home)) for path in absolute)
    for candidate in (tuple(p.stem for p in paths), tuple(p.name for p in paths)):
        if len(set(candidate)) == len(paths):
            return candidate
    return below


def read_source(path: Path, robot: Robot, map_name: str | None) -> Source:
    """Read the human motion, and scale it to the robot.

    Raises:
        ClipError: it cannot be read.
        MapError, ResourceError: there is no map for it.
        ScheduleError: it does not say when its feet are in contact.
    """
    human = read_human(path)
    body_map = load_map(map_name or default_map_name(human.rig, robot.name), robot)
    return as_source(path.stem, human, robot, body_map)


def show(compared: Comparison) -> None:
    """Print a comparison for people."""
    screen = console()
    screen.print(as_table(compared))
    screen.print()
    screen.print(where_table(compared))
    screen.print(f"\n{compared.seconds:.2f} s compared; * is the best of its row", style="dim")
    for note in (compared.stance_rule, *compared.notes):
        screen.print(escape(note), style="dim")
