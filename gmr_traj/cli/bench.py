"""`gmr-traj bench`: frames per second, peak memory, and how both scale with the clip's length."""

from __future__ import annotations

import json
import multiprocessing
import resource
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.exceptions import GmrTrajError

if TYPE_CHECKING:
    from gmr_traj.cli.arguments import Bench
    from gmr_traj.motion import RobotMotion


@dataclass(frozen=True)
class Measurement:
    """One length.

    Attributes:
        frames: number of frames.
        iterations: Ipopt's, over all windows and passes.
        seconds: wall-clock time of the refinement, without start-up and without reading or writing [s].
        frames_per_second: ``frames / seconds``.
        milliseconds_per_frame: ``1000 seconds / frames``.
        peak_megabytes: largest resident memory of the process, the interpreter and its libraries included.
        status: what became of the solve.
    """

    frames: int
    iterations: int
    seconds: float
    frames_per_second: float
    milliseconds_per_frame: float
    peak_megabytes: float
    status: str


def run(arguments: Bench) -> int:
    """Measure every length in a process of its own, one after the other, and print the figures."""
    lengths = sorted(set(arguments.seconds))
    if not lengths or lengths[0] <= 0:
        raise GmrTrajError(f"--seconds {' '.join(map(str, lengths))}: lengths must be positive")
    # A fresh interpreter each, so that one length's memory is not counted for the next.
    context = multiprocessing.get_context("spawn")
    measurements = []
    for seconds in lengths:
        with context.Pool(1) as pool:
            measurements.append(pool.apply(measure, (arguments, seconds)))
    if arguments.json:
        print(json.dumps([asdict(m) for m in measurements], indent=2))
    else:
        _print_table(arguments.clip, measurements)
    return ExitCode.OK if all(m.status != "not converged" for m in measurements) else ExitCode.NOT_CONVERGED


def measure(arguments: Bench, seconds: float) -> Measurement:
    """Refine the first ``seconds`` of the clip and measure it; to be called in a fresh process."""
    from gmr_traj.cli.loading import load
    from gmr_traj.memory import keep_freed
    from gmr_traj.problem import load_problem
    from gmr_traj.refine import refine

    keep_freed()  # as the command does; this process did not come through it
    clip, robot = load(arguments.clip, arguments)
    motion = cut(clip.motion, seconds)
    problem = load_problem(arguments.problem)
    start = time.perf_counter()
    refinement = refine(motion, robot, problem, window=arguments.window, overlap=arguments.overlap)
    elapsed = time.perf_counter() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss  # kilobytes; bytes on macOS
    return Measurement(
        frames=motion.frames,
        iterations=refinement.report.iterations,
        seconds=elapsed,
        frames_per_second=motion.frames / elapsed,
        milliseconds_per_frame=1e3 * elapsed / motion.frames,
        peak_megabytes=peak / (1e6 if sys.platform == "darwin" else 1e3),
        status=refinement.report.status,
    )


def cut(motion: RobotMotion, seconds: float) -> RobotMotion:
    """The first ``seconds`` of a motion, played forth and back as often as needed (so that nothing jumps)."""
    import numpy as np

    frames = max(2, round(seconds * motion.fps))
    period = 2 * (motion.frames - 1)
    phase = np.arange(frames) % max(period, 1)
    return motion.with_qpos(motion.qpos[np.where(phase < motion.frames, phase, period - phase)])


def _print_table(clip: Path, measurements: list[Measurement]) -> None:
    from rich.table import Table

    from gmr_traj.cli.terminal import console

    table = Table(box=None, pad_edge=False, header_style="bold")
    for column in ("frames", "iterations", "seconds", "frames/s", "ms/frame", "relative", "peak MB", "status"):
        table.add_column(column, justify="left" if column == "status" else "right")
    base = measurements[0].milliseconds_per_frame
    for m in measurements:
        table.add_row(
            str(m.frames),
            str(m.iterations),
            f"{m.seconds:.1f}",
            f"{m.frames_per_second:.0f}",
            f"{m.milliseconds_per_frame:.1f}",
            f"{m.milliseconds_per_frame / base:.2f}",
            f"{m.peak_megabytes:.0f}",
            m.status,
        )
    screen = console()
    screen.print(f"refine {clip.name}", markup=False)
    screen.print(table)
