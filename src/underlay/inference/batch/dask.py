"""Fits chunks of curves on the workers of a Dask scheduler, with the code that local processes run."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from underlay.errors import SchedulerError, missing_extra
from underlay.inference.batch.curves import CurvePlace
from underlay.inference.batch.model import BatchModel
from underlay.inference.batch.results_table import Layout
from underlay.inference.batch.work import DIED, Rows, given_up, work

# Chunks submitted per thread of the cluster: one at work and one waiting.
_AHEAD = 2


def through_dask(
    model: BatchModel,
    layout: Layout,
    todo: Sequence[CurvePlace],
    size: int,
    address: str,
    timeout: float,
) -> Generator[Rows, None, None]:
    """Fit curves on the workers of the scheduler at `address`; yield rows as they come, in any order.

    Dask resubmits the chunks of a lost worker; each row comes once. A chunk on which workers die repeatedly is
    split into single curves, so that one bad curve does not take others with it.

    Parameters
    ----------
    model : BatchModel
        What the curves have in common.
    layout : Layout
        Columns of the rows.
    todo : sequence of CurvePlace
        The curves.
    size : int
        Curves of a chunk.
    address : str
        Address of the scheduler.
    timeout : float
        How long it may take to answer (s).

    Raises
    ------
    MissingExtraError
        If Dask is not installed.
    SchedulerError
        If the scheduler does not answer within `timeout` (s), has no workers, they do not see the files, or the
        connection is lost.
    """
    distributed = _distributed()
    client = _connect(distributed, address, timeout)
    try:
        threads = _threads(client, address, timeout)
        _require_files(client, todo, address)
        size = max(1, min(size, -(-len(todo) // (threads * _AHEAD))))
        waiting = [list(todo[start : start + size]) for start in range(0, len(todo), size)]
        yield from _through(distributed, client, model, layout, waiting, threads * _AHEAD)
    except (OSError, distributed.CancelledError) as error:
        raise SchedulerError(
            f"the Dask scheduler at {address} went away ({error}); what was finished is kept: continue with "
            "resume (--resume)"
        ) from error
    finally:
        client.close(timeout=timeout)


def _through(
    distributed: Any,
    client: Any,
    model: BatchModel,
    layout: Layout,
    waiting: list[list[CurvePlace]],
    ahead: int,
) -> Generator[Rows, None, None]:
    under_way: dict[Any, list[CurvePlace]] = {}
    waiting.reverse()
    finished = distributed.as_completed(loop=client.loop)

    def submit() -> None:
        while waiting and len(under_way) < ahead:
            chunk = waiting.pop()
            # Not pure: a result is needed once, and hashing every curve for a key would take time.
            future = client.submit(work, model, layout, chunk, pure=False)
            under_way[future] = chunk
            finished.add(future)

    submit()
    while under_way:
        future = next(finished)
        chunk = under_way.pop(future)
        try:
            rows: Rows = future.result()
        except distributed.KilledWorker:
            if len(chunk) == 1:
                yield [given_up(chunk[0], layout, DIED)]
            else:
                waiting.extend([place] for place in reversed(chunk))
        else:
            yield rows
        future.release()
        submit()


def _distributed() -> Any:
    try:
        return import_module("distributed")
    except ImportError as error:
        raise missing_extra("a Dask scheduler needs dask", "cluster") from error


def _connect(distributed: Any, address: str, timeout: float) -> Any:
    try:
        return distributed.Client(address, timeout=timeout, set_as_default=False)
    except (OSError, ValueError) as error:
        raise SchedulerError(
            f"no Dask scheduler answered at {address} within {timeout:g} s: is it running, and is the "
            "address right (tcp://host:8786)?"
        ) from error


def _threads(client: Any, address: str, timeout: float) -> int:
    try:
        client.wait_for_workers(1, timeout=timeout)
    except OSError as error:
        raise SchedulerError(
            f"the Dask scheduler at {address} has no workers: start some with 'dask worker {address}'"
        ) from error
    threads: dict[str, int] = client.nthreads()
    return max(1, sum(threads.values()))


def _sees(path: str) -> bool:
    return Path(path).is_file()


def _require_files(client: Any, todo: Sequence[CurvePlace], address: str) -> None:
    """Raise SchedulerError if a worker of the cluster cannot see the first curve's file."""
    first = next((place.path for place in todo if place.curve is None), None)
    if first is None:
        return
    blind = [worker for worker, sees in client.run(_sees, first).items() if not sees]
    if blind:
        raise SchedulerError(
            f"worker {blind[0]} of the scheduler at {address} does not see {first}: put the curves on a disk "
            "that all machines share, under the same path, or pass them as curves"
        )
