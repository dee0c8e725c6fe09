"""Clips read for showing them: named, standing on the floor, and held against each other where they can be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from gmr_traj.cli.loading import load
from gmr_traj.contacts.detect import detect
from gmr_traj.exceptions import ClipError
from gmr_traj.formats import Clip
from gmr_traj.metrics import Certificate, certify
from gmr_traj.motion import RobotMotion
from gmr_traj.track import Track, track

if TYPE_CHECKING:
    from gmr_traj.cli.arguments import Common


@dataclass(frozen=True)
class Shown:
    """Clips that are to be shown.

    Attributes:
        clips: as they were read.
        tracks: ready to be looked at, in the same order.
        certificate: of the second against the first, where there are two of the same joints, length and rate.
        apart: why there is none, in a sentence; empty where there is one, or one clip.
    """

    clips: tuple[Clip, ...]
    tracks: tuple[Track, ...]
    certificate: Certificate | None
    apart: str


def load_tracks(paths: Sequence[Path], arguments: Common, *, level: bool = True) -> Shown:
    """Read clips of one robot.

    Of two clips that differ in nothing but the motion the second is measured over the stances of the first, as the
    certificate does, so that a foot cannot get better by being lifted.

    Args:
        paths: the files.
        arguments: of the command.
        level: whether each clip is raised to stand on the floor.

    Raises:
        GmrTrajError: a clip cannot be read, or is not a motion of the robot.
    """
    read = [load(path, arguments) for path in paths]
    names = _names(paths)
    first, robot = read[0]
    schedule = first.schedule or detect(first.motion, robot)
    tracks = [track(names[0], first.motion, robot, schedule, level=level)]
    certificate, apart = None, ""
    for name, path, (clip, own_robot) in zip(names[1:], paths[1:], read[1:], strict=True):
        own = clip.schedule or detect(clip.motion, own_robot)
        if len(paths) == 2:
            apart = difference(paths[0], first.motion, path, clip.motion)
            if not apart:
                own = replace(schedule, height=own.height)
                certificate = _certificate(first, clip, own.height if level else 0.0, tracks[0])
        tracks.append(track(name, clip.motion, own_robot, own, level=level))
    return Shown(tuple(clip for clip, _ in read), tuple(tracks), certificate, apart)


def difference(first_path: Path, first: RobotMotion, path: Path, motion: RobotMotion) -> str:
    """Why two clips cannot be held against each other frame by frame, in a sentence; empty where they can."""
    if first.joint_names != motion.joint_names:
        return f"{first_path} moves {len(first.joint_names)} joints, {path} {len(motion.joint_names)}"
    if abs(first.fps - motion.fps) > 1e-3 * first.fps:
        return f"{first_path} has {first.fps:g} frames per second, {path} {motion.fps:g}"
    if first.frames != motion.frames:
        return f"{first_path} has {first.frames} frames, {path} {motion.frames}"
    return ""


def _certificate(first: Clip, second: Clip, height: float, before: Track) -> Certificate:
    """The certificate of the second clip, standing on the floor, against the first."""
    return certify(
        first.motion,
        second.motion.shifted(height),
        before.robot,
        replace(before.schedule, height=before.raised),
        levelling=before.raised,
        references=first.references,
    )


def _names(paths: Sequence[Path]) -> list[str]:
    """The stems of the files; where two are the same, with the folders they are in.

    Raises:
        ClipError: a file is named twice.
    """
    resolved = [path.resolve() for path in paths]
    for path in resolved:
        if resolved.count(path) > 1:
            raise ClipError(f"{path}: this clip is named twice; name it once")
    stems = [path.stem for path in resolved]
    if len(set(stems)) == len(stems):
        return stems
    return ["/".join(path.with_suffix("").parts[1:]) if stems.count(path.stem) > 1 else path.stem for path in resolved]
