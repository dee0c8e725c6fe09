"""What `gmr-traj batch` does with one clip: the steps, with the functions of the subcommands of the same names."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from gmr_traj.batch.naming import RETARGETED
from gmr_traj.batch.work import Result
from gmr_traj.cli.batch_arguments import Step
from gmr_traj.cli.batch_warm import prepare, prepared
from gmr_traj.cli.human_input import Start, start
from gmr_traj.cli.refine import given_schedule, solve, write
from gmr_traj.cli.refine_arguments import Refine
from gmr_traj.cli.refine_lead import to_json, wanted_leads, with_leads
from gmr_traj.cli.refine_otherwise import settle
from gmr_traj.cli.verify import verify_clip
from gmr_traj.cli.verify_arguments import Verify
from gmr_traj.cli.verify_plan import make_plan
from gmr_traj.contacts import schedule_json
from gmr_traj.contacts.detect import detect
from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.exceptions import ClipError
from gmr_traj.formats import Clip, write_clip
from gmr_traj.formats.clip import SUFFIXES
from gmr_traj.formats.human import is_human
from gmr_traj.lead import Extended
from gmr_traj.metrics.figures import measure
from gmr_traj.problem import load_problem


@dataclass(frozen=True, kw_only=True)
class ClipWork:
    """What all work on a clip has.

    Attributes:
        name: what its outputs are called, without suffix.
        refine: arguments of refining, and of reading and retargeting before that.
        versions: of the packages, wherever it is carried out.
    """

    name: str
    refine: Refine
    versions: Mapping[str, str]

    @property
    def path(self) -> Path:
        """The input."""
        return self.refine.clip

    def prepare(self) -> None:
        """Make what several clips share, before the process of one is forked: nothing."""

    def extended(self, begun: Start) -> tuple[Start, ContactSchedule | None, Extended | None]:
        """What is refined, with its leads where there are any, and the schedule that it brings.

        Raises:
            GmrTrajError: the schedule is of another clip, or a lead is too short.
        """
        schedule, leads = given_schedule(self.refine.contacts, begun.clip, begun.robot), wanted_leads(self.refine)
        return (begun, schedule, None) if leads is None else with_leads(begun, schedule, leads)


@dataclass(frozen=True, kw_only=True)
class Steps(ClipWork):
    """The steps for one clip.

    Attributes:
        steps: which.
        verify: arguments of verifying.
    """

    steps: tuple[Step, ...]
    verify: Verify

    def prepare(self) -> None:
        """Make what the clips that are refined share."""
        if "refine" in self.steps:
            prepare(self.refine.robot, self.refine.problem)

    def carry_out(self, folder: Path) -> Result:
        """Take the steps in turn and write what they make into the folder.

        Raises:
            GmrTrajError: the clip cannot be read, or a step is not for what it is.
        """
        human = is_human(self.path)
        if self.steps == ("retarget",) and not human:
            raise ClipError(f"{self.path}: this is a robot's clip, and there is nothing to retarget; --steps refine")
        if self.steps == ("verify",) and human:
            raise ClipError(f"{self.path}: this is a human motion; retarget it first: --steps refine verify")
        begun = start(self.refine)
        clip = begun.clip
        content: dict[str, Any] = {"kind": "human" if human else "robot", "notes": list(clip.notes)}
        outputs: dict[str, str] = {}
        refining = "refine" in self.steps
        if human and "retarget" in self.steps:
            outputs["retargeted" if refining else "clip"] = self._write_retargeted(begun, folder, refining)
            stances = clip.schedule or detect(clip.motion, begun.robot)
            content["figures"] = measure(clip.motion, begun.robot, stances).to_json()
        if refining:
            kinematics = prepared(begun.robot, self.refine.robot, self.refine.problem)
            if kinematics is not None:
                begun = replace(begun, robot=kinematics.robot)
            begun, schedule, extended = self.extended(begun)
            held = None if extended is None else extended.held
            problem = load_problem(self.refine.problem)
            settled = settle(
                begun.clip,
                begun.robot,
                problem,
                lambda one: solve(begun, schedule, self.refine, one, held=held, kinematics=kinematics),
            )
            refinement = settled.refinement
            content["notes"] = [*begun.clip.notes, *filter(None, [settled.note])]
            content["solved"], content["lead"] = settled.problem, to_json(extended)
            content["solver"] = refinement.report.to_json()
            content["contacts"] = json.loads(schedule_json.to_json(refinement.schedule, refinement.seen))
            if refinement.report.status == "not converged":
                why = f"the solver did not converge: {refinement.report.solver_status}"
                return Result(_plain(content), {}, f"{self.path}: {why}. {refinement.report.message}".strip(" ."))
            outputs["clip"] = self.name + (SUFFIXES[self.refine.format] if self.refine.format else self._suffix(human))
            written = write(folder / outputs["clip"], begun, settled, self.refine.format)
            content["certificate"], content["audit"] = written.certificate.to_json(), written.audit
            content["physics"] = written.physics.to_json()
            content.pop("figures", None)  # the certificate has them as those before
            clip = written.clip
        if "verify" in self.steps:
            content["verify"] = self._verify(clip, begun)
        return Result(_plain(content), outputs)

    def _write_retargeted(self, begun: Start, folder: Path, refining: bool) -> str:
        """What the step `retarget` makes, as gmr-traj's own npz where more is to come of it."""
        name_format = "gmr-traj" if refining else self.refine.format or "gmr-traj"
        file = f"{self.name}{RETARGETED if refining else ''}{SUFFIXES[name_format]}"
        write_clip(begun.clip, folder / file, format=name_format, robot=begun.robot)
        return file

    def _suffix(self, human: bool) -> str:
        return SUFFIXES["gmr-traj"] if human else self.path.suffix

    def _verify(self, clip: Clip, begun: Start) -> dict[str, Any]:
        verified = verify_clip(self.path, clip, begun.robot, self.verify, make_plan(self.verify)).to_json(frames=False)
        return {key: verified[key] for key in ("passed", "audit", "rollouts")}


def _plain(content: Any) -> Any:
    """The same, with what is not a number as None, which JSON knows."""
    if isinstance(content, Mapping):
        return {key: _plain(value) for key, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [_plain(value) for value in content]
    return None if isinstance(content, float) and not math.isfinite(content) else content
