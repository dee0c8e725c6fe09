"""Tasks side by side in threads, as many as this process may use."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import TypeVar

import numpy as np

from gmr_traj.exceptions import GmrTrajError

#: Environment variable with the number of threads of one clip; who does several clips at once sets it to 1.
VARIABLE = "GMR_TRAJ_THREADS"

_T = TypeVar("_T")


def threads() -> int:
    """How many tasks to do at the same time: ``$GMR_TRAJ_THREADS``, or two where there are two cores.

    Results never depend on it.

    Raises:
        GmrTrajError: the variable is not a number of threads.
    """
    wanted = os.environ.get(VARIABLE, "")
    if not wanted:
        return min(2, len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1)
    if not (wanted.isascii() and wanted.isdigit() and int(wanted) > 0):
        raise GmrTrajError(f"{VARIABLE} is {wanted!r}; expected a number of threads, 1 or more")
    return int(wanted)


def parts(count: int, worthwhile: int) -> list[tuple[int, int]]:
    """Half-open ranges that count to ``count``, as many as there are threads, or one of fewer than ``worthwhile``."""
    ends = np.linspace(0, count, (threads() if count >= worthwhile else 1) + 1).astype(int).tolist()
    return list(pairwise(ends))


def side_by_side(tasks: Sequence[Callable[[], _T]]) -> list[_T]:
    """The results of tasks, which run at the same time where there are threads for them.

    What pays is work that gives up the interpreter's lock: compiled kernels, and NumPy on long vectors.

    Args:
        tasks: as many as should run at the same time; the first runs in this thread.
    """
    if len(tasks) < 2 or threads() < 2:
        return [task() for task in tasks]
    results: list[_T | None] = [None] * len(tasks)
    failures: list[BaseException] = []

    def run(k: int) -> None:
        try:
            results[k] = tasks[k]()
        except BaseException as error:  # raised again below, in the thread that asked
            failures.append(error)

    others = [threading.Thread(target=run, args=(k,), daemon=True) for k in range(1, len(tasks))]
    for other in others:
        other.start()
    try:
        run(0)
    finally:
        for other in others:
            other.join()
    if failures:
        raise failures[0]
    return results  # type: ignore[return-value]
