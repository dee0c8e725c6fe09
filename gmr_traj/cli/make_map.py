"""`gmr-traj make-map`: a map for a rig of one's own, by aligning one posture."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from gmr_traj import atomic
from gmr_traj.cli import outputs
from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.cli.terminal import console
from gmr_traj.exceptions import GmrTrajError, MapError
from gmr_traj.formats.human import read_human
from gmr_traj.retarget.alignment import Alignment, align, zero_pose
from gmr_traj.retarget.body_map import load_map
from gmr_traj.retarget.map_writing import to_toml
from gmr_traj.robot_loading import load_robot
from gmr_traj.toml_table import read_toml

if TYPE_CHECKING:
    from gmr_traj.cli.make_map_arguments import MakeMap

# Above this the postures are most likely not the same, and the user should know.
_MISFIT = 0.1


def run(arguments: MakeMap) -> int:
    """Make a map.

    Returns:
        0.

    Raises:
        GmrTrajError: anything the user can put right; nothing was written then.
    """
    draft_file = arguments.draft
    target = arguments.output or draft_file.with_name(f"{draft_file.stem}_map.toml")
    for given in (draft_file, arguments.file):
        outputs.check(target, given, arguments.force)
    robot = load_robot(arguments.robot)
    draft = load_map(draft_file, robot, draft=True)
    human = read_human(arguments.file, up=arguments.up, unit=arguments.unit, rig=arguments.rig)
    if arguments.frame is None and arguments.up is None:
        raise MapError(
            f"{arguments.file}: which of the file's axes is up at zero rotations? Say so with --up y or --up z, or "
            "name a frame in which the person takes the posture with --frame"
        )
    try:
        posed = human if arguments.frame is not None else zero_pose(human, arguments.up or "y")
        ordered = sorted(draft.targets, key=lambda t: t.joint != draft.root)  # the root first
        pairs = [(t.joint, t.orientation_joint, t.body) for t in ordered]
        facing = None if arguments.facing is None else math.radians(arguments.facing)
        found = align(posed, arguments.frame or 0, robot, pairs, draft.posture, facing)
    except GmrTrajError as error:
        raise MapError(f"{arguments.file}: {error}") from error
    targets = tuple(
        replace(target, rotation_offset=offset) for target, offset in zip(ordered, found.rotation_offsets, strict=True)
    )
    remarks = [f"root to body over root to joint in the posture: {scale:.3f}" for scale in found.scales]
    text = to_toml(
        replace(draft, targets=targets),
        comment=_comment(arguments, found),
        joint_ranges=read_toml(draft_file, MapError).text("joint_ranges", ""),
        remarks=remarks,
    )
    with atomic.write(target) as stream:
        stream.write(text.encode())
    screen = console()
    screen.print(f"the person faces {math.degrees(found.facing):.1f} degrees from x; misfit {found.misfit:.3f}")
    if found.misfit > _MISFIT:
        screen.print(
            "note: person and robot are far from the same posture; look at [posture] and the frame", markup=False
        )
    screen.print(f"written: {target}", markup=False, soft_wrap=True)
    return ExitCode.OK


def _comment(arguments: MakeMap, found: Alignment) -> str:
    """How the offsets came about."""
    where = "zero rotations" if arguments.frame is None else f"frame {arguments.frame}"
    return (
        f"Rotation offsets by rest-pose alignment: {where} of {arguments.file.name}, and the robot in [posture],\n"
        f"turned by {math.degrees(found.facing):.1f} degrees; misfit {found.misfit:.3f} of the person's height."
    )
