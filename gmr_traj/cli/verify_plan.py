"""What `gmr-traj verify` is asked to do, checked before any work is done."""

from __future__ import annotations

import os
from dataclasses import dataclass

from gmr_traj.cli.verify_arguments import Verify
from gmr_traj.cli.view import check_recording
from gmr_traj.exceptions import GmrTrajError
from gmr_traj.verify.conditions import Conditions, load_conditions
from gmr_traj.verify.trials import Choice


@dataclass(frozen=True)
class Plan:
    """What to do with every clip.

    Attributes:
        choice: the controller; None for the audit alone.
        conditions: of the rollouts.
        starts: frames to begin at; None to find one.
        workers: processes.
    """

    choice: Choice | None
    conditions: tuple[Conditions, ...]
    starts: tuple[int, ...] | None
    workers: int


def make_plan(arguments: Verify) -> Plan:
    """Check the arguments before any work is done.

    Raises:
        GmrTrajError: naming the argument that is out of range.
    """
    for name, value, least in (
        ("--top", arguments.top, 0),
        ("--trials", arguments.trials, 1),
        ("--seed", arguments.seed, 0),
        ("--workers", arguments.workers, 1),
    ):
        if value is not None and value < least:
            raise GmrTrajError(f"{name} is {value}; it must be at least {least}")
    if arguments.find_start and arguments.start_frame is not None:
        raise GmrTrajError("--find-start and --start-frame both say where to begin; give one of them")
    if not arguments.conditions:
        raise GmrTrajError("--conditions needs at least one name or file; --controller none audits without rollouts")
    parts = (arguments.start_frame or "0").split(",")
    if not all(part.strip().isdecimal() for part in parts):
        raise GmrTrajError(f"--start-frame is {arguments.start_frame!r}; expected frames such as 0,7,49")
    if arguments.save is not None and arguments.controller == "none":
        raise GmrTrajError("--save writes what the robot did in rollouts, and --controller none makes none")
    if arguments.save is not None and not arguments.save.is_dir():
        raise GmrTrajError(f"--save {arguments.save}: there is no such folder; create it first")
    if (arguments.controller == "policy") != (arguments.policy is not None):
        raise GmrTrajError("--controller policy and --policy FILE.onnx belong together; give both")
    if arguments.steer < 0.0 or (arguments.steer and arguments.policy is None):
        raise GmrTrajError(f"--steer is {arguments.steer:g}; it is a gain of zero or more, for --policy")
    if arguments.rerun is not None:
        if len(arguments.clips) != 1 or not arguments.clips[0].is_file() or arguments.controller == "none":
            raise GmrTrajError("--rerun shows one clip and its rollouts; name one file, and a controller")
        check_recording(arguments.rerun, arguments.clips, arguments.force)
    conditions = tuple(load_conditions(name) for name in arguments.conditions)
    names = [each.name for each in conditions]
    twice = next((name for k, name in enumerate(names) if name in names[:k]), None)
    if twice is not None:
        raise GmrTrajError(f"--conditions: two are called {twice!r}; give each a name of its own in its file")
    choice = None
    if arguments.controller != "none":
        presets = ("A", "B") if arguments.preset == "auto" else (arguments.preset,)
        choice = Choice(arguments.controller, presets, arguments.policy, arguments.steer)
    starts = None if arguments.find_start else tuple(dict.fromkeys(int(part) for part in parts))
    return Plan(choice, conditions, starts, arguments.workers or os.cpu_count() or 1)
