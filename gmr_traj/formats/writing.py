"""Writing a motion clip in its own format or another."""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

from gmr_traj import atomic
from gmr_traj.exceptions import ClipError, GmrTrajError
from gmr_traj.formats import bones_csv, gmr_pickle, holosoma_npz, phc_pickle, project_npz, robot_csv, tracking_npz
from gmr_traj.formats.clip import Clip, check_format
from gmr_traj.formats.decide import reduced
from gmr_traj.robot import Robot
from gmr_traj.robot_loading import load_robot


def write_clip(
    clip: Clip, path: str | Path, *, format: str | None = None, robot: Robot | None = None
) -> tuple[str, ...]:
    """Write a clip, whole or not at all, the same clip to the same bytes.

    In the clip's own format every field that follows from the motion is computed anew (velocities, body placements,
    rotation vectors) in the floating-point type the file had it in, and the rest goes back as it was.  csv and
    float64 fields hold the configurations exactly; float32 fields to 1e-7.

    Args:
        clip: the clip.
        path: the file to write, whose ending is not looked at.
        format: one of ``FORMATS``, None for the clip's own.
        robot: the robot, None to load it by the name in the motion; needed for robots that do not ship with gmr-traj.

    Returns:
        Notes on what the format cannot hold, one sentence each.

    Raises:
        ClipError: the format does not exist or cannot hold the clip.
        GmrTrajError: the file cannot be written.
    """
    name = clip.format if format is None else format
    check_format(name)
    model = reduced(load_robot(clip.motion.robot) if robot is None else robot, clip.motion.joint_names)
    if model.joint_names != clip.motion.joint_names:
        raise ClipError(f"{path}: the joints of the motion are not in the order of {model.name}")
    try:
        with atomic.write(path) as stream:
            notes = _write(clip, model, stream, name, Path(path).stem)
    except ClipError as error:
        raise ClipError(f"{path}: {error}") from error
    dropped = (("the contact schedule", clip.schedule), ("the reference placements", clip.references))
    lost = tuple(f"{name} does not hold {what}" for what, value in dropped if value is not None and name != "gmr-traj")
    further = clip.extras.get("further", ()) if name != clip.format else ()
    if further:
        lost = (*lost, f"{name} does not hold what {clip.format} held beside the motion: {', '.join(further)}")
    return (*notes, *lost)


def _write(clip: Clip, robot: Robot, stream: BinaryIO, name: str, stem: str) -> tuple[str, ...]:
    if name == "gmr":
        return gmr_pickle.write(clip, robot, stream)
    if name == "phc":
        return phc_pickle.write(clip, robot, stream, stem)
    if name in robot_csv.ORDERS:
        return robot_csv.write(clip, stream, name)
    if name == "bones-csv":
        return bones_csv.write(clip, stream)
    if name in ("mjlab", "beyondmimic"):
        return tracking_npz.write(clip, robot, stream, name)
    if name == "holosoma":
        return holosoma_npz.write(clip, robot, stream)
    if name == "gmr-traj":
        return project_npz.write(clip, stream)
    raise GmrTrajError(f"no writer for {name}")
