"""Where the clips are done: a cluster of this machine's processes, or one of the user's own."""

from __future__ import annotations

import logging
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gmr_traj.batch.confined import THREADS
from gmr_traj.batch.fingerprint import versions
from gmr_traj.exceptions import BatchError

if TYPE_CHECKING:
    from distributed import Client

# How often a task may lose its worker is counted per clip, see `gmr_traj.batch.task`; Dask's own count, which is of the
# scheduler and the same for all, must not come before it.
_NO_LIMIT = 1000


def check_installed() -> None:
    """Complain where Dask is not installed.

    Raises:
        BatchError: with the command that installs it.
    """
    try:
        import distributed  # noqa: F401
    except ImportError as error:
        raise BatchError(
            f"batch needs dask.distributed, which is not installed ({error}); pip install 'gmr-traj[batch]'"
        ) from error


@contextmanager
def local_cluster(jobs: int, dashboard: str | None = None) -> Iterator[Client]:
    """Processes on this machine, one clip each at a time, reachable from this machine only.

    Args:
        jobs: how many.
        dashboard: address of Dask's dashboard, None for none.
    """
    import dask
    from distributed import Client, LocalCluster

    settings: dict[str, Any] = {
        "distributed.scheduler.allowed-failures": _NO_LIMIT,
        "distributed.nanny.environ": dict(THREADS),
        "distributed.nanny.pre-spawn-environ": dict(THREADS),
    }
    _hush()
    with dask.config.set(settings), _ctrl_c_is_ours():
        cluster = LocalCluster(
            n_workers=jobs,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address=dashboard or "127.0.0.1:0",
            scheduler_kwargs={"dashboard": dashboard is not None},
            memory_limit=None,  # the clips' own processes are watched, see `gmr_traj.batch.clip_server`
            silence_logs=logging.CRITICAL,
        )
    with cluster, Client(cluster) as client:
        yield client


@contextmanager
def given_cluster(address: str, patience: float, run: Path) -> Iterator[Client]:
    """The user's own scheduler, with at least one worker that can do what is asked of it.

    Args:
        address: of the scheduler, such as ``tcp://127.0.0.1:8786``.
        patience: how long to wait for it and for its first worker [s].
        run: a folder that every worker must see.

    Raises:
        BatchError: there is no scheduler, no worker comes, or a worker lacks gmr-traj, its versions or the folder.
    """
    from distributed import Client

    _hush()
    try:
        client = Client(address, timeout=patience)
    except (OSError, TimeoutError, ValueError) as error:
        raise BatchError(
            f"--scheduler {address}: no scheduler answers there within {patience:g} s ({error or 'no answer'}); "
            "start one with `dask scheduler`, and workers with `dask worker ADDRESS`"
        ) from error
    with client:
        try:
            client.wait_for_workers(1, timeout=patience)
        except TimeoutError as error:
            raise BatchError(
                f"--scheduler {address}: it has no workers, and none came within {patience:g} s; start one with "
                f"`dask worker {address}`"
            ) from error
        _check_workers(client, run)
        yield client


def _check_workers(client: Client, run: Path) -> None:
    try:
        found = client.run(_look, str(run))
    except ImportError as error:
        raise BatchError(
            f"a worker cannot import gmr_traj ({error}); install the same version in the workers' environment"
        ) from error
    wanted = versions()
    for worker, (there, sees) in found.items():
        for name, version in wanted.items():
            if there.get(name) != version:
                raise BatchError(
                    f"worker {worker} has {name} {there.get(name)}, this command {version}; install the same everywhere"
                )
        if not sees:
            raise BatchError(
                f"worker {worker} does not see {run}; the output folder must be one that all workers share"
            )


def _look(run: str) -> tuple[dict[str, str], bool]:
    """On a worker: what is installed, and whether it sees a folder."""
    return versions(), Path(run).is_dir()


def _hush() -> None:
    """Dask's loggers, which have levels of their own, say nothing; what happens to a clip is in its record."""
    for name in list(logging.root.manager.loggerDict):
        if name.partition(".")[0] == "distributed":
            logging.getLogger(name).setLevel(logging.CRITICAL)


@contextmanager
def _ctrl_c_is_ours() -> Iterator[None]:
    """Threads and processes that are started meanwhile do not get the terminal's Ctrl-C; this thread gets it after."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
