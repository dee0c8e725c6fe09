"""Whole clips, raw and refined in several ways: audits, and rollouts of every stretch of ten seconds.

    python tools/segments_table.py DATA/gmr_pkl DATA/gmr_reference DATA/lafan1_unitree_csv@12 \
        --variant kinematic=/tmp/kinematic --variant physical=/tmp/physical --results /tmp/segments.jsonl

`@12` takes the first 12 s of a clip or of every clip of a folder.  The refined clip of DATA/gmr_pkl/walk.pkl is looked
for in the folder of a variant under gmr_pkl/, then in the folder itself, as walk.*, walk_refined.* and walk_pkl.*; it
is of the whole clip or of its first seconds.

Raw clips are raised first, by the height that `gmr-traj refine` raises them by to stand on the floor: one that hovers
would fall for that alone.  Where a raw clip's first frames are a transient, its first 0.2 s are left out of the
rollouts (not of the audits), in all variants.  A rest shorter than 3 s is part of the stretch before it.

Every result is appended to --results when it is there.  A second run does only what is missing; --print only prints.
What counts is the content of a stretch, the controller and the conditions, so that a clip that was refined anew is
rolled out anew.  A change of the controller's code is not noticed: name another file then.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from segment_results import Line, Row, append_line, markdown, read_lines
from segment_work import Work, clip_work, inputs, result

from gmr_traj.exceptions import GmrTrajError, RolloutError
from gmr_traj.verify.processes import in_processes


def main() -> None:
    """Do what is missing, then print the table."""
    arguments = parsed()
    variants = dict(split_variant(text) for text in arguments.variant)
    try:
        work = [
            one for path, seconds in inputs(arguments.clips) for one in clip_work(path, seconds, variants, arguments)
        ]
    except GmrTrajError as error:
        raise SystemExit(f"error: {error}") from error
    names = [one.clip for one in work if one.audited and one.variant == "raw"]
    if len(set(names)) < len(names):
        raise SystemExit(f"error: clips that are called the same: {sorted({n for n in names if names.count(n) > 1})}")
    arguments.results.parent.mkdir(parents=True, exist_ok=True)
    done = read_lines(arguments.results)
    missing = list({one.id: one for one in work if one.id not in done}.values())  # equal clips have equal results
    try:
        failed = [] if arguments.print else run(missing, arguments, done)
    except KeyboardInterrupt:
        raise SystemExit("interrupted; run this again to go on") from None
    rollouts = [one for one in work if not one.audited]
    minutes = sum(one.job.motion.duration for one in rollouts) / 60.0
    print(f"\n{len(names)} clips, {minutes:.1f} min of segments of {arguments.seconds:g} s in all variants;")
    print(f"mpc {arguments.preset}, {arguments.conditions}, seed 0; errors over what was followed.")
    print("Raw clips are raised to stand on the floor, as refine raises them.\n")
    print(markdown(("raw", *variants), table_rows(work, done)))
    for kind in ("raw", *variants):
        own = [done[one.id] for one in rollouts if one.variant == kind and one.id in done]
        followed = sum(line["alive"] for line in own)
        if followed:
            cost = sum(line["cpu"] for line in own) / followed
            print(f"\n{kind}: {followed:.0f} s were followed, at {cost:.2f} CPU-s a second")
    for text in failed:
        print(f"error: {text}", file=sys.stderr)
    raise SystemExit(1 if failed else 0)


def parsed() -> argparse.Namespace:
    """The arguments."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("clips", nargs="+", metavar="CLIP|FOLDER[@SECONDS]", help="raw clips")
    parser.add_argument(
        "--variant", action="append", default=[], metavar="NAME=FOLDER", help="refined clips; any number"
    )
    parser.add_argument("--results", type=Path, required=True, help="file of JSON lines to append results to")
    parser.add_argument("--robot", default="unitree_g1")
    parser.add_argument("--seconds", type=float, default=10.0, help="length of the segments [s]")
    parser.add_argument("--conditions", default="sim")
    parser.add_argument("--preset", choices=("A", "B", "auto"), default="A", help="auto tries B where A falls")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--audits", action="store_true", help="no rollouts, only audits")
    parser.add_argument("--print", action="store_true", help="only print what is there")
    return parser.parse_intermixed_args()


def split_variant(text: str) -> tuple[str, Path]:
    """Name and folder of a variant.

    Raises:
        SystemExit: it is not ``NAME=FOLDER``.
    """
    name, sign, folder = text.partition("=")
    if not sign or not name or name == "raw" or not Path(folder).is_dir():
        raise SystemExit(f"error: --variant {text}: expected NAME=FOLDER, of a folder that exists and not called raw")
    return name, Path(folder)


def run(missing: Sequence[Work], arguments: argparse.Namespace, done: dict[str, Line]) -> list[str]:
    """Do what is missing, several at a time, and append every result.

    Audits come first, then the first stretches of all clips, then their second ones: a run that is stopped has seen
    something of every clip, raw and refined.

    Returns:
        What could not be done, a sentence each.
    """
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # of the workers, which read it when they import
    audits = [one for one in missing if one.audited]
    rollouts = sorted((one for one in missing if not one.audited), key=lambda one: one.segment[0] / one.job.motion.fps)
    left = sum(one.job.motion.duration for one in rollouts)
    print(f"to do: {len(audits)} audits, {len(rollouts)} rollouts of {left / 60:.1f} min", flush=True)
    if not missing:
        return []
    failed: list[str] = []
    begun, ready = time.monotonic(), 0.0
    work = [*audits, *rollouts]
    try:
        for count, (index, future) in enumerate(in_processes(result, work, arguments.workers), 1):
            one = work[index]
            try:
                line = future.result()
            except GmrTrajError as error:
                failed.append(f"{one.clip}, {one.variant}, frames {one.segment}: {error}")
                continue
            append_line(arguments.results, line)
            done[one.id] = line
            if one.audited:
                continue
            ready += one.job.motion.duration
            remaining = (time.monotonic() - begun) * (left / ready - 1.0)
            fell = "followed" if line["success"] else f"falls at {line['fell']:.1f} s"
            print(
                f"{count}/{len(work)} {one.clip} {one.segment} {one.variant}: {fell},"
                f" E_g {line['g_mpbpe']:.0f} mm, {line['cpu']:.0f} CPU-s; {remaining / 60:.0f} min left",
                flush=True,
            )
    except RolloutError as error:
        failed.append(f"{error}; run this again to go on")
    return failed


def table_rows(work: Sequence[Work], done: dict[str, Line]) -> list[Row]:
    """A row of every clip that has been audited in all variants."""
    rows = []
    for clip in dict.fromkeys(one.clip for one in work):
        own = [one for one in work if one.clip == clip]
        audits = complete([one for one in own if one.audited], done)
        if audits is None:
            continue
        parts = dict.fromkeys(one.segment for one in own if not one.audited)
        stretches = [complete([o for o in own if o.segment == s and not o.audited], done) for s in parts]
        rows.append(Row(clip, audits, tuple(lines for lines in stretches if lines is not None), len(parts)))
    return rows


def complete(work: Sequence[Work], done: dict[str, Line]) -> tuple[Line, ...] | None:
    """The results of all of some work; None where one is missing."""
    lines = tuple(done[one.id] for one in work if one.id in done)
    return lines if len(lines) == len(work) else None


if __name__ == "__main__":
    main()
