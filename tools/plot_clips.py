"""Plot a clip before and after `gmr-traj refine`: joint speed, height of the soles, sliding feet, self-collision.

python tools/plot_clips.py examples/punch.npz examples/punch_refined.npz docs/punch.png
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from gmr_traj.contacts import schedule_json
from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.formats import read_clip
from gmr_traj.metrics.observation import Observation, observe
from gmr_traj.robot_loading import load_robot, reduce_robot

COLOURS = {"raw": "#d1495b", "refined": "#00798c"}


def joint_speed(observation: Observation) -> np.ndarray:
    """Largest joint speed in each step [rad/s].  # (T - 1,)."""
    motion = observation.motion
    return np.abs(np.diff(motion.qpos[:, 7:], axis=0)).max(axis=1) * motion.fps


def lowest_sole(observation: Observation) -> np.ndarray:
    """Height of the lowest point of both soles [mm].  # (T,)."""
    points = np.concatenate([*observation.soles, *observation.outlines], axis=1)
    return 1e3 * points[..., 2].min(axis=1)


def stance_slide(observation: Observation, schedule: ContactSchedule) -> np.ndarray:
    """Largest horizontal speed of a sole point that is at rest by the schedule [mm/s], not a number elsewhere.

    # (T - 1,).
    """
    names = [sole.name for sole in observation.robot.soles]
    slide = np.full(observation.motion.frames - 1, np.nan)
    for stance in schedule.stances:
        track = observation.soles[names.index(stance.sole)][stance.start : stance.stop, stance.point, :2]
        speed = 1e3 * observation.motion.fps * np.linalg.norm(np.diff(track, axis=0), axis=1)
        slide[stance.start : stance.stop - 1] = np.fmax(slide[stance.start : stance.stop - 1], speed)
    return slide


def main() -> None:
    """Read both clips, draw the four curves of each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("raw", type=Path, help="the input of `gmr-traj refine`")
    parser.add_argument("refined", type=Path, help="its output, with the report beside it")
    parser.add_argument("picture", type=Path, help="PNG to write")
    arguments = parser.parse_args()
    robot = load_robot("unitree_g1")
    raw, refined = (read_clip(path, robot).motion for path in (arguments.raw, arguments.refined))
    if raw.joint_names != robot.joint_names:
        robot = reduce_robot(robot, raw.joint_names)
    report = json.loads(arguments.refined.with_name(arguments.refined.name + ".report.json").read_text())
    contacts = json.dumps(report["contacts"])
    schedule = schedule_json.from_json(contacts, robot, frames=raw.frames, fps=raw.fps)
    seen = {"raw": observe(raw.shifted(schedule.height), robot), "refined": observe(refined, robot)}

    figure, axes = plt.subplots(4, 1, figsize=(9, 8), sharex=True, constrained_layout=True)
    for name, observation in seen.items():
        time = np.arange(raw.frames) / raw.fps
        style = {"color": COLOURS[name], "label": name, "linewidth": 1.4}
        axes[0].plot(time[1:], joint_speed(observation), **style)
        axes[1].plot(time, lowest_sole(observation), **style)
        axes[2].plot(time[1:], stance_slide(observation, schedule), **style)
        axes[3].plot(time, 1e3 * observation.overlaps.by_frame(), **style)
    axes[1].axhline(0.0, color="black", linewidth=0.8)
    for axis, title in zip(
        axes,
        (
            "largest joint speed [rad/s]",
            "lowest point of the soles above the floor [mm]",
            "horizontal speed of sole points in stance [mm/s]",
            "deepest self-collision [mm]",
        ),
        strict=True,
    ):
        axis.set_title(title, loc="left", fontsize=10)
        axis.grid(alpha=0.3)
    axes[0].legend(loc="upper right")
    axes[-1].set_xlabel("time [s]")
    figure.savefig(arguments.picture, dpi=110)


if __name__ == "__main__":
    main()
