"""The clips of a batch: found, checked as far as that goes before any work is done, named, and turned into work."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from gmr_traj.batch.collect import Input, collect
from gmr_traj.batch.fingerprint import resource_hashes, sha256, versions
from gmr_traj.batch.naming import name_inputs
from gmr_traj.batch.plan import Expected
from gmr_traj.batch.records import Record
from gmr_traj.cli.batch_arguments import ORDER, Batch
from gmr_traj.cli.batch_work import Steps
from gmr_traj.cli.refine_arguments import Refine, RefineOptions
from gmr_traj.cli.refine_lead import wanted_leads
from gmr_traj.cli.verify_plan import make_plan as check_verify
from gmr_traj.exceptions import BatchError
from gmr_traj.formats.human import is_human
from gmr_traj.problem import load_problem
from gmr_traj.retarget.body_map import load_map
from gmr_traj.robot_loading import load_robot

# What the content of decides, and not the name: its hash is among the resources.
_BY_CONTENT = ("robot", "problem", "map", "body_model", "contacts")


@dataclass(frozen=True)
class Clips:
    """The clips of a batch.

    Attributes:
        arguments: of the command, paths in them absolute, because workers may have another working folder.
        out: the output folder, absolute.
        inputs: the motions.
        human: which of them are human motion.
    """

    arguments: Batch
    out: Path
    inputs: tuple[Input, ...]
    human: frozenset[Path]

    def named(self, records: Mapping[str, Record]) -> dict[str, Input]:
        """The inputs by the names of their outputs."""
        return name_inputs(self.inputs, {name: Path(record["input"]["path"]) for name, record in records.items()})

    def expected(self, name: str, path: Path) -> Expected:
        """What the record of a clip must say for the clip not to be done again."""
        human = path in self.human
        hashes = self._hashes[human]
        contacts = self._contacts(name)
        if contacts is not None:
            hashes = {**hashes, "contacts": sha256(contacts)}
        return Expected(self._options[human], hashes, self._versions)

    def work(self, name: str, path: Path) -> Steps:
        """What is to be done with a clip."""
        return Steps(
            name=Path(name).name,
            refine=self.refine(name, path),
            versions=self._versions,
            steps=self.arguments.steps,
            verify=self.arguments.of_verify(path),
        )

    def refine(self, name: str, path: Path) -> Refine:
        """The arguments with which `gmr-traj refine` would do a clip."""
        return self.arguments.of_clip(path, path in self.human, self._contacts(name))

    @cached_property
    def _versions(self) -> dict[str, str]:
        return versions()

    @cached_property
    def _hashes(self) -> dict[bool, dict[str, str]]:
        a = self.arguments
        # Conditions that ship are among the configs.
        own = [Path(name) for name in a.conditions if "verify" in a.steps and Path(name).is_file()]
        conditions = {f"conditions/{path.name}": sha256(path) for path in own}
        return {
            human: {**resource_hashes(a.robot, a.problem, a.map, a.body_model, a.steps, human), **conditions}
            for human in (False, True)
        }

    @cached_property
    def _options(self) -> dict[bool, dict[str, Any]]:
        return {human: self._decisive(human) for human in (False, True)}

    def _decisive(self, human: bool) -> dict[str, Any]:
        """The options that decide the result, as JSON gives them back."""
        refine = self.arguments.of_clip(Path(), human, None)
        names = [field.name for field in fields(RefineOptions) if field.name not in (*_BY_CONTENT, "traceback")]
        options: dict[str, Any] = {
            "steps": list(self.arguments.steps),
            **{name: getattr(refine, name) for name in names},
        }
        if "verify" in self.arguments.steps:
            conditions = [Path(name).name for name in self.arguments.conditions]
            options |= {"controller": self.arguments.controller, "conditions": conditions}
        decided: dict[str, Any] = json.loads(json.dumps(options))
        return decided

    def _contacts(self, name: str) -> Path | None:
        if self.arguments.contacts is None:
            return None
        path = self.arguments.contacts / f"{name}.json"
        return path if path.is_file() else None


def find_clips(arguments: Batch) -> Clips:
    """Find the motions, and refuse what could not work for any of them.

    Raises:
        GmrTrajError: naming the option or the input.
    """
    arguments = _checked(arguments)
    out = arguments.out
    inputs = collect(arguments.inputs, out)
    # Others than regular files may never end; what they are is found out where that does not matter.
    human = frozenset(one.path for one in inputs if one.path.is_file() and is_human(one.path))
    if arguments.given() and not human:
        raise BatchError(
            f"{arguments.given()[0]} is about human motion, and all {len(inputs)} inputs are clips of a robot; "
            "leave it out"
        )
    return Clips(arguments, out, inputs, human)


def _checked(arguments: Batch) -> Batch:
    """The arguments with absolute paths and the steps in their order."""
    if not arguments.steps:
        raise BatchError(f"--steps needs at least one of {', '.join(ORDER)}")
    if arguments.contacts is not None and not arguments.contacts.is_dir():
        raise BatchError(f"--contacts {arguments.contacts}: there is no such folder")
    if wanted_leads(arguments) is not None and "refine" not in arguments.steps:
        raise BatchError("--lead-in and --lead-out are of the step refine; add it to --steps, or leave them out")
    robot = load_robot(arguments.robot)
    if "refine" in arguments.steps:
        load_problem(arguments.problem)
    if arguments.map is not None:
        load_map(arguments.map, robot)
    if arguments.body_model is not None and not arguments.body_model.is_file():
        raise BatchError(f"--body-model {arguments.body_model}: there is no such file")
    if "verify" in arguments.steps:
        check_verify(arguments.of_verify(Path()))
    return replace(
        arguments,
        out=_absolute(arguments.out),
        steps=tuple(step for step in ORDER if step in arguments.steps),
        robot=_located(arguments.robot),
        problem=_located(arguments.problem),
        map=None if arguments.map is None else _located(arguments.map),
        body_model=None if arguments.body_model is None else _absolute(arguments.body_model),
        contacts=None if arguments.contacts is None else _absolute(arguments.contacts),
        conditions=tuple(_located(name) for name in arguments.conditions),
    )


def _located(name: str) -> str:
    """The absolute path where a file of the user's own is named; names of what ships stay, which each worker has."""
    path = Path(name).expanduser()
    return str(_absolute(path)) if path.exists() else name


def _absolute(path: Path) -> Path:
    return path.expanduser().absolute()
