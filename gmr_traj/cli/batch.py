"""`gmr-traj batch`: many clips, each in a process of its own, on this machine or a cluster."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from contextlib import ExitStack

from gmr_traj.batch import folder, summary
from gmr_traj.batch.cluster import check_installed
from gmr_traj.batch.plan import make_plan
from gmr_traj.batch.records import Record, read_records
from gmr_traj.batch.run import ClusterLostError
from gmr_traj.batch.settings import load_settings
from gmr_traj.cli import batch_tables
from gmr_traj.cli.batch_arguments import Batch
from gmr_traj.cli.batch_clips import find_clips
from gmr_traj.cli.batch_recording import wanted
from gmr_traj.cli.batch_session import Session, announcement, limits_of
from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.cli.terminal import console, progress
from gmr_traj.exceptions import BatchError
from gmr_traj.interrupts import asked_to_stop


def run(arguments: Batch) -> int:
    """Do every clip that is new, changed, missing or failed.

    Returns:
        0 where every promise of every clip holds; 6 where a clip failed or was not reached, else 3 where a promise is
        broken, else 5 where a clip fails its verification; 130 where it was interrupted.

    Raises:
        GmrTrajError: bad usage, or there is no cluster; no clip was done then.
    """
    check_installed()
    settings = load_settings(arguments.settings)
    limits = limits_of(arguments, settings)
    recorded = wanted(arguments.rerun)
    if arguments.top < 0:
        raise BatchError(f"--top is {arguments.top}; it must be at least 0")
    if arguments.jobs is not None and (arguments.jobs < 1 or arguments.scheduler is not None):
        raise BatchError("--jobs is at least 1, and of a cluster on this machine; leave it out with --scheduler")
    clips = find_clips(arguments)
    lost = ""
    with folder.locked(clips.out) as unfinished, ExitStack() as stack:
        records = read_records(clips.out)
        named = {name: one.path for name, one in clips.named(records).items()}
        with progress(not arguments.quiet) as callback:
            todo = make_plan(
                named,
                records,
                clips.expected,
                clips.out,
                force=arguments.force,
                retry_failed=arguments.retry_failed,
                progress=callback,
            )
        if not arguments.quiet:
            print(announcement(todo, len(named)), file=sys.stderr, flush=True)
        stop = stack.enter_context(asked_to_stop())
        with Session(clips, records, settings, limits, unfinished, stop) as session:
            try:
                session.do(todo)
                session.record([name for name in named if name in records], recorded)
            except ClusterLostError as error:
                lost = str(error)
        known = {name: records[name] for name in named if name in records}
        summary.write_summary(clips.out, known)
    _report(arguments, known, session.left)
    if lost:
        print(f"gmr-traj: error: {lost}", file=sys.stderr)
        return ExitCode.CLIP_FAILED
    if stop.asked:
        print(
            f"gmr-traj: interrupted with {session.left} clips to do; run the same command again to go on",
            file=sys.stderr,
        )
        return ExitCode.INTERRUPTED
    return ExitCode.CLIP_FAILED if session.unrecorded else exit_code(known)


def exit_code(records: Mapping[str, Record]) -> ExitCode:
    """What the clips together come to."""
    found = summary.totals(records.values())
    if found["failed"]:
        return ExitCode.CLIP_FAILED
    if found["broken"]:
        return ExitCode.BROKEN_PROMISE
    return ExitCode.NOT_FOLLOWED if found["not_followed"] else ExitCode.OK


def _report(arguments: Batch, known: Mapping[str, Record], left: int) -> None:
    """Print the totals and the clips that fall short most."""
    if arguments.json:
        rows = [summary.line(*row) for row in summary.ranked(known)]
        content = {"totals": summary.totals(known.values()), "not_reached": left, "clips": rows}
        print(json.dumps(content, indent=2, allow_nan=False))
    elif not arguments.quiet:
        screen = console()
        batch_tables.show(screen, known, arguments.top)
        screen.print(f"written: {arguments.out / summary.SUMMARY}", markup=False, soft_wrap=True)
