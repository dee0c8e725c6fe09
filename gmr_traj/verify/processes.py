"""Work in fresh processes, several at a time, none of which outlives the one that asked for it."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import TypeVar

from gmr_traj.exceptions import RolloutError
from gmr_traj.interrupts import end_with

T = TypeVar("T")
R = TypeVar("R")


def in_processes(do: Callable[[T], R], items: Sequence[T], workers: int) -> Iterator[tuple[int, Future[R]]]:
    """Do something with every item; the index of each item, and what came of it, as they are done.

    Where the caller stops early, by an exception or Ctrl-C, what is on the way is ended.

    Args:
        do: a function of a module, which a fresh interpreter can import.
        items: the items, which can be pickled.
        workers: how many processes.

    Raises:
        RolloutError: a process was killed.
    """
    before = {child.pid for child in multiprocessing.active_children()}
    # A fresh interpreter each: forked ones would share MuJoCo's and ONNX's threads.
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(min(workers, len(items)), context, initializer=_begin, initargs=(os.getpid(),))
    futures: dict[Future[R], int] = {}
    try:
        for index, item in enumerate(items):
            futures[pool.submit(do, item)] = index
        for future in as_completed(futures):
            if isinstance(future.exception(), BrokenProcessPool):
                raise RolloutError(
                    "a process that computes rollouts was killed, perhaps because memory ran out; try --workers 1"
                )
            yield futures[future], future
    except BaseException:
        for child in multiprocessing.active_children():
            if child.pid not in before:
                child.kill()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _begin(parent: int) -> None:
    """Leave Ctrl-C to the parent, which ends this process, and die with it however it dies."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with(parent)
