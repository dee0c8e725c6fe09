"""One run of `gmr-traj batch` from its plan to its last record."""

from __future__ import annotations

import json
import os
import sys
from collections import Counter
from collections.abc import MutableMapping, Sequence
from contextlib import ExitStack
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

from gmr_traj.batch import cluster, folder
from gmr_traj.batch.machine import default_jobs
from gmr_traj.batch.plan import Todo
from gmr_traj.batch.publish import RECORDING, publish
from gmr_traj.batch.records import Record, output_path
from gmr_traj.batch.run import run_orders
from gmr_traj.batch.settings import Limits, Settings
from gmr_traj.batch.summary import ranked
from gmr_traj.batch.work import Ended, Order
from gmr_traj.cli.batch_arguments import Batch
from gmr_traj.cli.batch_clips import Clips
from gmr_traj.cli.batch_progress import board
from gmr_traj.cli.batch_recording import recording
from gmr_traj.interrupts import Stop

if TYPE_CHECKING:
    from distributed import Client

TIMES = "times.jsonl"
_DASHBOARD = "127.0.0.1:8787"


class Session:
    """What is on the way, on a cluster that is started when there is something to do.

    At its end everything that is not finished is given up and removed, and the cluster is closed.

    Args:
        clips: of the batch.
        records: by name; those of the clips that are done are put in.
        settings: of the batch.
        limits: of a clip.
        unfinished: folder for unfinished work.
        stop: whether to stop.

    Attributes:
        left: clips that are still to do.
        unrecorded: recordings that could not be made.
    """

    def __init__(
        self,
        clips: Clips,
        records: MutableMapping[str, Record],
        settings: Settings,
        limits: Limits,
        unfinished: Path,
        stop: Stop,
    ) -> None:
        self.clips, self.records, self.settings, self.limits = clips, records, settings, limits
        self.unfinished, self.stop = unfinished, stop
        self.left = self.unrecorded = 0
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        folder.remove(self.unfinished)  # first: who still does something gives it up, and the cluster closes at once
        self._stack.close()

    def do(self, todo: Sequence[Todo]) -> None:
        """Do clips, the largest files first, so that none of them is left for the end.

        Raises:
            BatchError: there is no cluster, or it was lost.
        """
        self.left = len(todo)
        if not todo:
            return
        weights = {clip.name: max(1, os.stat(clip.path).st_size) for clip in todo}
        first = sorted(todo, key=lambda clip: (-weights[clip.name], clip.name))
        works = [self.clips.work(clip.name, clip.path) for clip in first]
        orders = [
            Order(clip.name, index, work, self.unfinished, self.limits)
            for index, (clip, work) in enumerate(zip(first, works, strict=True))
        ]
        paths = {clip.name: clip.path for clip in todo}
        client = self._client
        with board(len(todo), sum(weights.values()), self._arguments.quiet) as shown:

            def done(order: Order, ended: Ended) -> None:
                name = ended.name
                expected = self.clips.expected(name, paths[name])
                record = publish(
                    ended, paths[name], expected, self.clips.out, self.unfinished, order.index, self.records.get(name)
                )
                self.records[name] = record
                self.left -= 1
                self._time(ended, record["reason"])
                shown.ended(ended, weights[name], record["reason"] or "")

            run_orders(orders, client, done, lambda: self.stop.asked, shown.heard)

    def record(self, names: Sequence[str], count: int | None) -> None:
        """Make the recordings that are missing of the clips that fall short most.

        Args:
            names: the clips.
            count: how many; None for all.
        """
        out = self.clips.out
        rows = [row for row in ranked({name: self.records[name] for name in names}) if row[1]["status"] == "done"]
        orders: list[Order] = []
        for name, record, _ in rows[:count]:
            if not output_path(out, name, Path(name).name + RECORDING).exists():
                path = Path(record["input"]["path"])
                work = recording(name, record, self.clips.refine(name, path), out, record["versions"])
                orders.append(Order(name, len(orders), work, self.unfinished / "recordings", self.limits))
        if not orders or self.stop.asked:
            return
        (self.unfinished / "recordings").mkdir()
        client = self._client
        with board(len(orders), len(orders), self._arguments.quiet) as shown:

            def done(order: Order, ended: Ended) -> None:
                file = Path(ended.name).name + RECORDING
                failed = ended.failed
                if ended.folder is not None:
                    failed = json.loads((ended.folder / "result.json").read_text(encoding="utf-8"))["failed"]
                    if not failed:
                        os.replace(ended.folder / file, output_path(out, ended.name, file))
                if failed:
                    self.unrecorded += 1
                    print(f"gmr-traj: error: recording of {ended.name}: {failed}", file=sys.stderr)
                shown.ended(ended, 1.0, failed)

            run_orders(orders, client, done, lambda: self.stop.asked, shown.heard)

    @property
    def _arguments(self) -> Batch:
        return self.clips.arguments

    @cached_property
    def _client(self) -> Client:
        arguments = self._arguments
        if arguments.scheduler is not None:
            given = cluster.given_cluster(arguments.scheduler, self.settings.patience, self.unfinished)
            return self._stack.enter_context(given)
        jobs = arguments.jobs or default_jobs(self.limits.threads, self.limits.memory)
        dashboard = _DASHBOARD if arguments.dashboard else None
        client = self._stack.enter_context(cluster.local_cluster(jobs, dashboard))
        if arguments.dashboard and not arguments.quiet:
            print(f"dashboard: {client.dashboard_link}", file=sys.stderr)
        return client

    def _time(self, ended: Ended, reason: str | None) -> None:
        """Note what the clip took: not in its record, which is the same however long it takes."""
        entry = {
            "clip": ended.name,
            "failed": reason is not None,
            "seconds": round(ended.seconds, 3),
            "peak_mb": round(ended.peak / 1e6),
            "attempts": ended.attempts,
            "worker": ended.worker,
        }
        with (self.clips.out / TIMES).open("a", encoding="utf-8") as stream:
            stream.write(json.dumps(entry) + "\n")


def limits_of(arguments: Batch, settings: Settings) -> Limits:
    """The settings' limits, with those the arguments give in their place.

    Raises:
        BatchError: one of them is out of range.
    """
    wanted, given = arguments, settings.limits
    return Limits(
        seconds=given.seconds if wanted.time_limit is None else wanted.time_limit,
        memory=given.memory if wanted.memory_limit is None else round(1e9 * wanted.memory_limit),
        retries=given.retries if wanted.retries is None else wanted.retries,
        threads=given.threads,
    )


def announcement(todo: Sequence[Todo], total: int) -> str:
    """What is to be done and why, in a line."""
    reasons = Counter(clip.why for clip in todo)
    why = ", ".join(f"{count} {reason}" for reason, count in reasons.most_common(5))
    return f"{total} clips: {total - len(todo)} done before, {len(todo)} to do{f' ({why})' if why else ''}"
