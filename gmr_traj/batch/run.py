"""The run: as many orders on the way as the cluster has threads, until all are done or it is to stop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError
from typing import TYPE_CHECKING, Any

from gmr_traj.batch.task import carry_out
from gmr_traj.batch.work import Ended, Order
from gmr_traj.exceptions import BatchError

if TYPE_CHECKING:
    from distributed import Client, Future

_BEAT = 0.5  # how often it is looked whether to stop [s]


class ClusterLostError(BatchError):
    """The cluster went away while the batch ran; what is done is done."""


def run_orders(
    orders: Sequence[Order],
    client: Client,
    done: Callable[[Order, Ended], None],
    stopped: Callable[[], bool],
    heard: Callable[[int], None],
) -> None:
    """Carry out orders on a cluster, in their order.

    No more are given to the scheduler than it has threads: a worker that dies holds no other clips that Dask would hold
    it against, and workers may come and go.

    Args:
        orders: what to do.
        client: of the cluster.
        done: called for every order that ended, in this thread.
        stopped: whether to stop; what is on the way is given up.
        heard: called now and then with the number of threads there are.

    Raises:
        ClusterLostError: the scheduler was lost.
    """
    from distributed import wait

    waiting = list(reversed(orders))
    running: dict[Future[Any], Order] = {}
    while (waiting or running) and not stopped():
        threads = sum(_threads(client).values())
        heard(threads)
        while waiting and len(running) < max(1, threads):
            order = waiting.pop()
            running[client.submit(carry_out, order, pure=False, retries=0)] = order
        try:
            finished = wait(list(running), timeout=_BEAT, return_when="FIRST_COMPLETED").done
        except TimeoutError:
            continue
        except CancelledError as error:
            raise _lost() from error
        for future in finished:
            order = running.pop(future)
            ended = _ended(future, order)
            if ended.void:
                raise ClusterLostError(
                    f"{order.run}: this folder was removed while the batch ran; run the same command again"
                )
            done(order, ended)
    client.cancel(list(running))


def _lost() -> ClusterLostError:
    return ClusterLostError(
        "the scheduler was lost, and with it what was on the way; run the same command again to go on"
    )


def _threads(client: Client) -> dict[str, int]:
    try:
        threads: dict[str, int] = client.nthreads()
    except (OSError, TimeoutError) as error:
        raise ClusterLostError(f"the scheduler was lost: {error}; run the same command again to go on") from error
    return threads


def _ended(future: Future[Any], order: Order) -> Ended:
    """What the worker answered, or why it did not."""
    if future.status == "cancelled" or future.status == "lost":
        raise _lost()
    error = future.exception()
    if error is None:
        ended: Ended = future.result()
        return ended
    return Ended(order.name, failed=" ".join(f"the worker could not do it: {type(error).__name__}: {error}".split()))
