"""The leads of `gmr-traj refine` and `batch`: what is refined becomes longer before it is refined."""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from gmr_traj.cli.human_input import Start
from gmr_traj.contacts.detect import detect
from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.exceptions import GmrTrajError
from gmr_traj.formats.longer import longer
from gmr_traj.human_motion import HumanMotion
from gmr_traj.lead import Added, Extended, Leads, extend

if TYPE_CHECKING:
    from gmr_traj.cli.refine_arguments import RefineOptions

# Longer ones are more likely a number of frames than seconds.
LONGEST = 60.0


def wanted_leads(arguments: RefineOptions) -> Leads | None:
    """The leads that are asked for; None for none.

    Raises:
        GmrTrajError: a length is not one.
    """
    for option, seconds in (("--lead-in", arguments.lead_in), ("--lead-out", arguments.lead_out)):
        if seconds is not None and not (math.isfinite(seconds) and 0.0 < seconds <= LONGEST):
            raise GmrTrajError(f"{option} is {seconds:g}; expected seconds, more than 0 and at most {LONGEST:g}")
    leads = Leads(arguments.lead_in, arguments.lead_out)
    return None if leads == Leads() else leads


def with_leads(begun: Start, schedule: ContactSchedule | None, leads: Leads) -> tuple[Start, ContactSchedule, Extended]:
    """What is to be refined with its leads, and the stances of it all.

    Args:
        begun: what is to be refined.
        schedule: its stances; detected where none is given.
        leads: the leads.

    Raises:
        ClipError: a lead is too short.
    """
    clip, robot = begun.clip, begun.robot
    if schedule is None:
        schedule = detect(clip.motion, robot, source=begun.stances)
    extended = extend(clip.motion, robot, schedule, leads, clip.references)
    ends = {"lead_in": extended.before, "lead_out": extended.after}
    before, after = (0 if added is None else added.frames for added in ends.values())
    extras = longer(clip.extras, clip.motion.frames, before, after)
    # Kept in gmr-traj's own format, whatever the clip came in; a clip that has a lead already gets a longer one.
    own = clip.extras.get("others", {})
    extras["leads"] = {
        f"{end}_frames": np.asarray(own.get(f"{end}_frames", 0)) + added.frames
        for end, added in ends.items()
        if added is not None
    }
    notes = tuple(_note(end, added, extended) for end, added in ends.items() if added is not None)
    clip = replace(
        clip,
        motion=extended.motion,
        schedule=None,
        references=extended.references,
        extras=extras,
        notes=(*clip.notes, *notes),
    )
    human = None if begun.human is None else _waiting(begun.human, before / clip.motion.fps, after / clip.motion.fps)
    return Start(clip, robot, None, human), extended.schedule, extended


def to_json(extended: Extended | None) -> dict[str, Any] | None:
    """What was added where, for the report; None where nothing was."""
    if extended is None:
        return None
    ends = {"in": extended.before, "out": extended.after}
    return {end: None if added is None else asdict(added) for end, added in ends.items()}


def _note(end: str, added: Added, extended: Extended) -> str:
    side, beside = ("before", "first") if end == "lead_in" else ("after", "last")
    text = f"{added.frames} frames ({added.frames / extended.motion.fps:.2f} s) were put {side} the clip"
    if added.replaced:
        text += f"; its {beside} {added.replaced}, a transient, are part of the blend"
    return text


def _waiting(human: HumanMotion, before: float, after: float) -> HumanMotion:
    """The person, who stands still during the leads of ``before`` and ``after`` seconds."""
    width = (round(before * human.fps), round(after * human.fps))

    def held(values: np.ndarray) -> np.ndarray:
        return np.pad(values, [width] + [(0, 0)] * (np.ndim(values) - 1), mode="edge")

    return replace(
        human,
        positions=held(human.positions),
        quaternions=held(human.quaternions),
        contacts={joint: held(np.asarray(touching)) for joint, touching in human.contacts.items()},
    )
