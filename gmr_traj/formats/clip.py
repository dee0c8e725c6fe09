"""A motion clip as a file holds it: the motion, what came with it, and what was decided on reading."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.exceptions import ClipError
from gmr_traj.motion import RobotMotion
from gmr_traj.references import BodyTargets

#: Formats by name, as ``--format`` takes them.
FORMATS: Mapping[str, str] = {
    "gmr": "GMR pickle: root_pos, root_rot (xyzw), dof_pos, fps",
    "gmr-traj": "npz: qpos (wxyz), fps, joint_names, robot, contacts, references",
    "unitree-csv": "csv without header: position, quaternion xyzw, joints (Unitree's LAFAN1, BeyondMimic's input)",
    "protomotions-csv": "csv without header: position, quaternion wxyz, joints",
    "bones-csv": "csv with header: Frame, root_translate [cm], root_rotate (Euler) and joints [deg] (BONES-SEED, SOMA)",
    "mjlab": "npz: joint_pos, body_pos_w, ... in MuJoCo's (depth-first) order",
    "beyondmimic": "npz: joint_pos, body_pos_w, ... in Isaac's (breadth-first) order",
    "holosoma": "npz: joint_pos is the whole qpos, with names; or qpos with human_joints and an object",
    "phc": "joblib pickle: {clip: root_trans_offset, root_rot (xyzw), dof, pose_aa, fps}",
}

#: Suffixes of the files that are written in each format.
SUFFIXES: Mapping[str, str] = {
    "gmr": ".pkl",
    "gmr-traj": ".npz",
    "unitree-csv": ".csv",
    "protomotions-csv": ".csv",
    "bones-csv": ".csv",
    "mjlab": ".npz",
    "beyondmimic": ".npz",
    "holosoma": ".npz",
    "phc": ".pkl",
}

#: Suffixes of clips in a folder.
CLIP_SUFFIXES = (".csv", ".npz", ".pickle", ".pkl")


@dataclass(frozen=True)
class Clip:
    """A motion with what its file also held.

    Attributes:
        motion: the motion.
        format: one of ``FORMATS``; the format it was read from and, unless asked otherwise, is written in.
        schedule: the contact schedule, where the file held one.
        references: desired placements of bodies, where the file held them.
        extras: what the reader of ``format`` keeps for its writer: further fields, types, names, layout.
        notes: what was decided on reading and why, one sentence each.

    Raises:
        ClipError: the format is unknown, or schedule or references have another number of frames than the motion.
    """

    motion: RobotMotion
    format: str
    schedule: ContactSchedule | None = None
    references: BodyTargets | None = None
    extras: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_format(self.format)
        if self.schedule is not None and self.schedule.frames != self.motion.frames:
            raise ClipError(f"the contact schedule has {self.schedule.frames} frames, the motion {self.motion.frames}")
        if self.references is not None and self.references.frames != self.motion.frames:
            raise ClipError(f"the references have {self.references.frames} frames, the motion {self.motion.frames}")

    def with_motion(self, motion: RobotMotion, schedule: ContactSchedule | None = None) -> Clip:
        """The same file's clip with another motion, and with the contact schedule that belongs to it."""
        return replace(self, motion=motion, schedule=schedule)


def check_format(name: str) -> None:
    """Refuse a name that is not a format.

    Raises:
        ClipError: with the list of names.
    """
    if name not in FORMATS:
        raise ClipError(f"there is no format {name!r}; there are {', '.join(FORMATS)}")
