"""What `gmr-traj verify` writes: what the robot did in each rollout, and a recording."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from gmr_traj.exceptions import GmrTrajError
from gmr_traj.formats import Clip, write_clip
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot
from gmr_traj.verify.trials import Trials


def check_free(name: str, folder: Path, cases: Sequence[tuple[str, int, int]]) -> None:
    """Refuse to overwrite files, before the work is done that they are for.

    Args:
        name: of the clip.
        folder: where they go.
        cases: conditions, start frame and number of trials.

    Raises:
        GmrTrajError: naming a file that exists.
    """
    for conditions, frame, count in cases:
        for k in range(count):
            target = _file(folder, name, conditions, frame, k)
            if target.exists():
                raise GmrTrajError(f"{target}: this file exists; overwrite it with --force")


def save(name: str, trials: Sequence[Trials], robot: Robot, folder: Path) -> None:
    """Write what the robot did in each rollout; files that exist are replaced."""
    for each in trials:
        for k, rollout in enumerate(each.rollouts):
            target = _file(folder, name, each.conditions, each.start_frame, k)
            write_clip(Clip(rollout.motion, "gmr-traj"), target, robot=robot)


def record(title: str, motion: RobotMotion, trials: Sequence[Trials], robot: Robot, path: Path) -> None:
    """Write a recording: the clip, and beside it the first rollout under each of the conditions."""
    from gmr_traj.track import track
    from gmr_traj.viewer import Scene
    from gmr_traj.viewer import save as save_recording

    begun = trials[0].start_frame
    clip = motion.with_qpos(motion.qpos[begun : trials[0].stop_frame])
    tracks = [track("clip", clip, robot, level=False)]
    for each in trials:
        if each.start_frame == begun:
            first = each.rollouts[0]
            name = f"rollout {each.conditions}"
            tracks.append(track(name, first.motion, robot, level=False, forces=first.forces))
    save_recording(Scene(title=title, tracks=tuple(tracks)), path)


def _file(folder: Path, name: str, conditions: str, frame: int, trial: int) -> Path:
    told = [re.sub(r"[^\w-]+", "_", part) for part in (name, conditions)]
    return folder / f"{'_'.join(told)}_frame{frame}_trial{trial}.npz"
