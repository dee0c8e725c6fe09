"""How far a batch is: a bar in a terminal, a line a clip elsewhere; on standard error."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from rich.console import Console

from gmr_traj.batch.work import Ended

_SPEED_OVER = 3600.0  # the time left is judged by the speed over this long [s]; a clip may take minutes


@dataclass
class Board:
    """Counts of a run, and who is told about them.

    Attributes:
        total: clips to do.
        show: called with the board, what is left to say in a line, and the weight of what has ended.
        done, failed: clips that ended so far.
        threads: of the cluster, as heard last.
    """

    total: int
    show: Callable[[Board, str, float], None]
    done: int = 0
    failed: int = 0
    threads: int = 0

    def ended(self, ended: Ended, weight: float, failed: str) -> None:
        """Count a clip that ended; ``failed`` says why there is no output."""
        self.failed += bool(failed)
        self.done += not failed
        again = f", attempt {ended.attempts}" if ended.attempts > 1 else ""
        took = f"{ended.seconds:.1f} s, {ended.peak / 1e6:.0f} MB{again}"
        what = f"failed: {failed}" if failed else "done"
        self.show(self, f"[{self.done + self.failed}/{self.total}] {ended.name} ({took}): {what}", weight)

    def heard(self, threads: int) -> None:
        """Take note of the cluster's size."""
        if threads != self.threads:
            self.threads = threads
            self.show(self, "", 0.0)


@contextmanager
def board(total: int, weight: float, quiet: bool) -> Iterator[Board]:
    """Counts of a run that are shown as they change.

    Args:
        total: clips to do.
        weight: of all of them together; the time left is that of the weight.
        quiet: show nothing.
    """
    if quiet:
        yield Board(total, lambda board, line, done: None)
        return
    if not sys.stderr.isatty():
        yield Board(total, lambda board, line, done: print(line, file=sys.stderr, flush=True) if line else None)
        return
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    bars = Progress(*columns, console=Console(stderr=True), transient=True, speed_estimate_period=_SPEED_OVER)
    with bars:
        task = bars.add_task(f"0 of {total} done", total=weight)

        def show(board: Board, line: str, done: float) -> None:
            failed = f", [red]{board.failed} failed[/red]" if board.failed else ""
            text = f"{board.done} of {board.total} done{failed}, {board.threads} at a time"
            bars.update(task, description=text, advance=done)
            if ": failed: " in line:
                bars.console.print(line, markup=False, highlight=False, soft_wrap=True)

        yield Board(total, show)
