"""`gmr-traj bench`: frames per second, start-up, memory, and how the time a frame grows with the clip's length."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gmr_traj import atomic, machine_code, resources
from gmr_traj._version import __version__
from gmr_traj.bench.chart import chart
from gmr_traj.bench.engine import engines, with_engine
from gmr_traj.bench.figures import Figures, Run, gathered
from gmr_traj.bench.fresh import measured
from gmr_traj.bench.gmr_loop import MINK_IS_MISSING, has_mink
from gmr_traj.bench.machine import machine, measured_versions
from gmr_traj.c_compiler import compiler
from gmr_traj.cli import bench_tables, outputs
from gmr_traj.cli.bench_arguments import GROWTH, Measure
from gmr_traj.cli.bench_work import FirstUse, Measured
from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.cli.loading import load
from gmr_traj.cli.terminal import console, progress
from gmr_traj.exceptions import BenchError, GmrTrajError
from gmr_traj.formats.human import is_human
from gmr_traj.problem import load_problem

if TYPE_CHECKING:
    from gmr_traj.cli.bench_arguments import Bench
    from gmr_traj.whole_clip import Progress

EXAMPLE = "kick.txt"
_LOOPS = ("gmr-loop", "gmr-loop-lean")


@dataclass(frozen=True)
class Results:
    """All that was measured.

    Attributes:
        clip: the clip.
        frames, fps: of the clip.
        sides: measurements of the clip as it is, side by side.
        growth: of refining other lengths.
        skipped: what was not measured, and why.
    """

    clip: Path
    frames: int
    fps: float
    sides: list[Figures]
    growth: list[Figures]
    skipped: dict[str, str]


def run(arguments: Bench) -> int:
    """Measure one thing after the other, as often as asked for, and print the medians.

    Returns:
        0, or 4 where a refinement did not converge.

    Raises:
        GmrTrajError: anything the user can put right.
        BenchError: a process ended early; what the others measured was printed and written before that.
    """
    clip = arguments.clip or resources.find("examples", EXAMPLE)
    printed = arguments.json == Path("-")
    for option, path in (("--plot", arguments.plot), ("--json", None if printed else arguments.json)):
        if path is not None:
            outputs.check(path, clip, arguments.force, option)
    if arguments.plot is not None and arguments.plot.suffix.lower() != ".png":
        raise GmrTrajError(f"--plot {arguments.plot}: the plot is a PNG; name it {arguments.plot.stem}.png")
    if arguments.repeats < 1:
        raise GmrTrajError(f"--repeats {arguments.repeats}: give 1 or more")
    human = is_human(clip)
    _refuse_options(arguments, clip, human)
    frames, fps = _length(arguments, clip, human)
    lengths = _lengths(arguments, fps)
    chosen = _engines(arguments)
    wanted, skipped = _wanted(arguments, chosen, clip, human)
    sides = [Measured(arguments, clip, human, what, engine) for what, engine in wanted]
    growth = [Measured(arguments, clip, human, "refine", engine, length) for length in lengths for engine in chosen]
    if human and compiler() is not None:
        measured(FirstUse(Measured(arguments, clip, human, "retarget")))
        machine_code.wait()
    with progress(not arguments.quiet) as callback:
        runs, broken = _all(sides + growth, arguments.repeats, callback)
    one_length, other_lengths = (
        gathered([(job.name, job.frames, run) for job, run in runs if (job.frames is None) is same])
        for same in (True, False)
    )
    results = Results(clip, frames, fps, one_length, other_lengths, skipped | broken)
    _hand_over(arguments, results)
    if broken:
        raise BenchError("; ".join(f"{name}: {why}" for name, why in broken.items()))
    converged = all(figures.status != "not converged" for figures in (*results.sides, *results.growth))
    return ExitCode.OK if converged else ExitCode.NOT_CONVERGED


def _refuse_options(arguments: Bench, clip: Path, human: bool) -> None:
    """Refuse options that are not about what the clip is.

    Raises:
        GmrTrajError: naming the option.
    """
    robots = {"--input-format": arguments.input_format, "--quaternion": arguments.quaternion}
    given = [option for option, value in robots.items() if value is not None] if human else list(arguments.given())
    if given:
        one, other = ("a robot's clip", "a human motion") if human else ("a human motion", "a robot's clip")
        raise GmrTrajError(f"{given[0]} is about {one}, and {clip} is {other}; leave it out")


def _length(arguments: Bench, clip: Path, human: bool) -> tuple[int, float]:
    """Frames and frame rate of the clip.

    Raises:
        ClipError: it cannot be read.
    """
    if human:
        person = arguments.read_human(clip, arguments.fps)
        return person.frames, person.fps
    motion = load(clip, arguments)[0].motion
    return motion.frames, motion.fps


def _lengths(arguments: Bench, fps: float) -> list[int]:
    """Lengths to refine beside the clip's own [frames].

    Raises:
        GmrTrajError: a length that is none.
    """
    if not arguments.seconds:
        return list(GROWTH) if arguments.growth else []
    lengths = sorted({round(seconds * fps) for seconds in arguments.seconds})
    if lengths[0] < 4:
        given = " ".join(f"{seconds:g}" for seconds in arguments.seconds)
        raise GmrTrajError(f"--seconds {given}: lengths must be at least 4 frames, {4 / fps:.3g} s at {fps:g} fps")
    return lengths


def _engines(arguments: Bench) -> tuple[str, ...]:
    """Engines to refine with.

    Raises:
        ProblemError, ResourceError: the problem cannot be read.
        BenchError: it has no attempts for an engine.
    """
    problem = load_problem(arguments.problem)
    for engine in arguments.engines:
        with_engine(problem, engine)
    return tuple(dict.fromkeys(arguments.engines)) or engines(problem)


def _wanted(
    arguments: Bench, chosen: tuple[str, ...], clip: Path, human: bool
) -> tuple[list[tuple[Measure, str | None]], dict[str, str]]:
    """What to measure with which engine, and what not and why.

    Raises:
        GmrTrajError: nothing is left.
    """
    wanted: list[tuple[Measure, str | None]] = []
    skipped: dict[str, str] = {}
    for what in dict.fromkeys(arguments.measure):
        if what == "refine":
            wanted += [(what, engine) for engine in chosen]
        elif not human:
            skipped[what] = f"{clip.name} is a robot's clip; it takes a human motion"
        elif what in _LOOPS and not has_mink():
            skipped[what] = MINK_IS_MISSING
        else:
            wanted.append((what, None))
    if not wanted and not (arguments.growth or arguments.seconds):
        reasons = "; ".join(f"{what}: {why}" for what, why in skipped.items())
        raise GmrTrajError(f"nothing to measure: {reasons or 'give --measure or --engines a value'}")
    return wanted, skipped


_Runs = list[tuple[Measured, Run]]


def _all(jobs: list[Measured], repeats: int, callback: Progress | None) -> tuple[_Runs, dict[str, str]]:
    """All runs, one after the other; a job whose process ends early is given up.

    In turns, and not all repeats of one after the other, so that what else the machine does spoils none of them alone.
    """
    runs: _Runs = []
    broken: dict[str, str] = {}
    for k in range(repeats):
        for j, job in enumerate(jobs):
            if callback is not None:
                callback("measuring", k * len(jobs) + j, repeats * len(jobs))
            called = job.name if job.frames is None else f"{job.name}, {job.frames} frames"
            if called in broken:
                continue
            try:
                runs.append((job, measured(job)))
            except BenchError as error:
                broken[called] = str(error)
    return runs, broken


def _hand_over(arguments: Bench, results: Results) -> None:
    """Write and print what was asked for."""
    if arguments.json is not None:
        text = json.dumps(_to_json(arguments, results), indent=2, allow_nan=False) + "\n"
        if arguments.json == Path("-"):
            print(text, end="")
        else:
            with atomic.write(arguments.json) as stream:
                stream.write(text.encode())
    if arguments.plot is not None:
        with atomic.write(arguments.plot) as stream:
            stream.write(chart(_title(results), results.sides, results.growth))
    if not (arguments.quiet or arguments.json == Path("-")):
        screen = console()
        for line in bench_tables.lines(
            _title(results), arguments.repeats, results.sides, results.growth, results.skipped
        ):
            screen.print(line, markup=False) if isinstance(line, str) else screen.print(line)
        here = machine()
        screen.print(f"refine's inner loops: {here['kernels']}, threads: {here['threads']}", markup=False)


def _title(results: Results) -> str:
    return f"{results.clip.name}, {results.frames} frames at {results.fps:g} Hz"


def _to_json(arguments: Bench, results: Results) -> dict[str, Any]:
    """Everything, ready for JSON."""
    return {
        "gmr_traj": __version__,
        "machine": machine(),
        "versions": measured_versions(),
        "clip": str(results.clip),
        "frames": results.frames,
        "fps": results.fps,
        "robot": arguments.robot,
        "problem": arguments.problem,
        "method": arguments.method,
        "window": arguments.window,
        "overlap": arguments.overlap,
        "repeats": arguments.repeats,
        "measurements": [figures.to_json() for figures in results.sides],
        "growth": [figures.to_json() for figures in results.growth],
        "skipped": results.skipped,
    }
