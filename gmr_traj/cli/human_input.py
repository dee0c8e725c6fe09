"""What `gmr-traj refine` starts from: a robot's clip, a clip with its human source, or a human motion alone."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from gmr_traj.cli.human_options import about
from gmr_traj.cli.loading import load
from gmr_traj.contacts.detect import detect
from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.exceptions import GmrTrajError, ScheduleError
from gmr_traj.formats import Clip
from gmr_traj.formats.human import is_human
from gmr_traj.human_motion import HumanMotion
from gmr_traj.resampling import resample_schedule
from gmr_traj.retarget.body_map import BodyMap
from gmr_traj.retarget.joining import join
from gmr_traj.retarget.retarget import Retargeted, retarget
from gmr_traj.retarget.source import person_schedule
from gmr_traj.retarget.targets import scaled_targets
from gmr_traj.robot import Robot
from gmr_traj.robot_loading import load_robot

if TYPE_CHECKING:
    from gmr_traj.cli.refine_arguments import Refine
    from gmr_traj.retarget.options import Progress


@dataclass(frozen=True)
class Start:
    """A clip to refine.

    Attributes:
        clip: the clip, with the source's targets as references where they are known.
        robot: its robot.
        stances: when the source's feet are in contact, in the clip's frames; None where that is not known.
        human: the person the clip comes from, where known.
    """

    clip: Clip
    robot: Robot
    stances: ContactSchedule | None = None
    human: HumanMotion | None = None


def start(arguments: Refine, progress: Progress | None = None) -> Start:
    """Read what is to be refined; retarget it first where it is a human motion.

    Raises:
        GmrTrajError: a file cannot be read, an option does not fit the input, or clip and source do not fit.
    """
    if is_human(arguments.clip):
        return _from_human(arguments, progress)
    if arguments.source is None:
        if arguments.given():
            raise GmrTrajError(
                f"{arguments.given()[0]} is about a human motion, and {arguments.clip} is a robot's clip; leave it "
                "out, or name the human motion with --source"
            )
        return Start(*load(arguments.clip, arguments))
    clip, robot = load(arguments.clip, arguments)
    human = arguments.read_human(arguments.source)
    body_map = arguments.load_map(human, arguments.source, robot)
    with about(arguments.source):
        targets = scaled_targets(human, body_map)
    stances, unknown = _stances(human, robot, body_map)
    joined = join(str(arguments.source), targets, human.fps, clip.motion, robot, stances)
    notes = (*clip.notes, *human.notes, *joined.notes, *unknown)
    return Start(replace(clip, references=joined.targets, notes=notes), robot, joined.stances, human)


def _from_human(arguments: Refine, progress: Progress | None) -> Start:
    """The clip that `gmr-traj retarget` would write."""
    for option, value in (
        ("--source", arguments.source),
        ("--input-format", arguments.input_format),
        ("--quaternion", arguments.quaternion),
    ):
        if value is not None:
            raise GmrTrajError(
                f"{option} is about a robot's clip, and {arguments.clip} is a human motion; leave it out"
            )
    robot = load_robot(arguments.robot)
    human = arguments.read_human(arguments.clip, arguments.fps)
    body_map = arguments.load_map(human, arguments.clip, robot)
    with about(arguments.clip):
        result = retarget(human, robot, body_map, method=arguments.method, progress=progress)
    return Start(*retargeted_clip(human, result, robot, body_map, arguments.clip), human)


def retargeted_clip(
    human: HumanMotion, result: Retargeted, robot: Robot, body_map: BodyMap, path: Path
) -> tuple[Clip, Robot, ContactSchedule | None]:
    """A retargeted clip with everything that travels with it: targets, stances, notes.

    Returns:
        The clip, its robot, and the source's stances where they are known.
    """
    motion = result.motion
    stances, unknown = _stances(human, robot, body_map)
    if stances is not None:
        stances = resample_schedule(stances, motion.fps, motion.frames)
    notes = (f"{path.name} was retargeted to {robot.name} with {body_map.name}", *human.notes, *result.notes, *unknown)
    schedule = detect(motion, robot, source=stances)
    clip = Clip(motion, "gmr-traj", schedule=schedule, references=result.references, notes=notes)
    return clip, robot, stances


def _stances(human: HumanMotion, robot: Robot, body_map: BodyMap) -> tuple[ContactSchedule | None, tuple[str, ...]]:
    """When the robot's soles are in stance as the person's feet have them; or nothing, and a note why."""
    try:
        return person_schedule(human, robot, body_map), ()
    except ScheduleError as error:
        return None, (f"stances are found on the robot alone: {error}",)
