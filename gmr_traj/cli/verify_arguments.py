"""Arguments of `gmr-traj verify`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from gmr_traj.cli.arguments import Common, named
from gmr_traj.exceptions import GmrTrajError


@dataclass(frozen=True, kw_only=True)
class Verify(Common):
    """Can the robot follow these clips? Audit their dynamics, and track them in a MuJoCo simulation.

    The audit takes milliseconds, a rollout with mpc some 3 seconds of computing a second of motion. The clips are not
    changed. Exit code 5 where a clip fails the audit or a rollout falls.
    """

    clips: Annotated[
        tyro.conf.Positional[tuple[Path, ...]],
        tyro.conf.arg(metavar="CLIP|FOLDER...", help_behavior_hint="(at least one)"),
    ]
    """Clips, or folders of clips."""

    controller: Literal["mpc", "policy", "pd", "none"] = "mpc"
    """What tracks the clip: model-predictive control, a trained policy, open-loop PD; none audits only."""

    preset: Literal["auto", "A", "B"] = "auto"
    """Of mpc: A plans every 80 ms, B every 40 ms; auto tries B where A falls."""

    policy: Annotated[Path | None, named("FILE.onnx", "none")] = None
    """Of policy: TWIST2's tracker, or one of BeyondMimic's form with its metadata (extra `policy`)."""

    steer: float = 0.0
    """Of policy (TWIST2): turn the velocity command toward the reference's place with this gain [1/s]."""

    conditions: tuple[str, ...] = ("sim",)
    """Simulations to track it in: sim, sim-dr, sim2sim, or files of your own."""

    trials: int = 1
    """Rollouts under conditions that hold anything random."""

    seed: int = 0
    """Of everything random."""

    workers: Annotated[int | None, named("N", "one a core")] = None
    """Processes to run rollouts in; the results do not depend on it."""

    start: Literal["clip", "default"] = "clip"
    """Begin in the clip's first configuration, with its velocity, or standing in the robot's default one."""

    start_frame: Annotated[str | None, named("FRAME,...", "0")] = None
    """Frames of the clip (or of the stretch) to begin at, a rollout for each."""

    find_start: bool = False
    """Propose a frame to begin at and one to end at, feasible and balanced both, and begin and end there."""

    seconds: Annotated[tuple[float, float] | None, named("FROM TO", "the whole clip")] = None
    """Stretch of every clip to verify [s]."""

    save: Annotated[Path | None, named("FOLDER", "not written")] = None
    """Write what the robot did in each rollout into this folder, as clips (gmr-traj npz, 50 Hz)."""

    rerun: Annotated[Path | None, named("RRD", "not written")] = None
    """Write a recording of one clip and its rollouts, with the floor's forces, for the rerun viewer."""

    force: bool = False
    """Overwrite files that exist."""

    top: int = 5
    """How many faults of each clip to list."""

    json: bool = False
    """Print everything as JSON on standard output instead of tables."""

    frames: bool = False
    """With --json: the audit's figures of every frame as well."""

    def run(self) -> int:
        """Verify the clips."""
        if not self.clips:
            raise GmrTrajError("verify needs at least one clip or folder of clips")
        if self.frames and not self.json:
            raise GmrTrajError("--frames adds figures to --json; give that as well")
        from gmr_traj.cli.verify import run

        return run(self)
