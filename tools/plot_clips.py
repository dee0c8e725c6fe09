"""Plot a clip before and after `gmr-traj refine` as one picture, as the README shows it.

    python tools/plot_clips.py examples/punch.npz examples/punch_refined.npz docs/example.png

`gmr-traj report` makes a page of the same signals.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib.pyplot as plt

from gmr_traj import colours
from gmr_traj.cli.tracks import load_tracks
from gmr_traj.cli.view_arguments import View

SHOWN = ("joint_speed", "sole_height", "slide", "clearance")
NAMES = ("raw", "refined")


def main() -> None:
    """Read both clips, draw four of their signals."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("raw", type=Path, help="the input of `gmr-traj refine`")
    parser.add_argument("refined", type=Path, help="its output")
    parser.add_argument("picture", type=Path, help="PNG to write")
    arguments = parser.parse_args()
    tracks = load_tracks([arguments.raw, arguments.refined], View(clips=())).tracks

    figure, axes = plt.subplots(len(SHOWN), 1, figsize=(9, 8), sharex=True, constrained_layout=True)
    for axis, wanted in zip(axes, SHOWN, strict=True):
        for name, track in zip(NAMES, tracks, strict=True):
            signal = next(signal for signal in track.signals if signal.name == wanted)
            colour = colours.hexadecimal(colours.ROLES[name])
            axis.plot(track.time, signal.values, color=colour, label=name, linewidth=1.4)
        if signal.bar is not None:
            axis.axhline(signal.bar, color=colours.hexadecimal(colours.LIMIT), linewidth=0.9, linestyle="--")
        axis.set_title(f"{signal.title} [{signal.unit}]", loc="left", fontsize=10)
        axis.grid(alpha=0.3)
    axes[0].legend(loc="upper right")
    axes[-1].set_xlabel("time [s]")
    figure.savefig(arguments.picture, dpi=110)


if __name__ == "__main__":
    main()
