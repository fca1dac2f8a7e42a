"""Fits the curves of a map in worker processes, of this machine or of a Dask cluster.

Here each process has one thread and its own pipe. A worker is a fresh Python on every platform: a fork would copy
the locks of threads that it does not copy. It does not run the caller's script again, so scripts need no ``if
__name__ == "__main__"`` guard.

No library's worker pool is used: the workers of such a pool share one pipe behind one lock, and a worker that is
killed while it holds the lock blocks all others. Eight pools of pebble 5.2.3, two workers each with tasks of 2 ms
and 300 kB, had their workers killed one at a time at random moments: every pool stopped for good, seven without a
message, after one to seven kills (``tests/studies/worker_kills.py`` repeats it, and does the same to these
workers). With its own pipe, the death of a worker ends that pipe and nothing else.
"""

from __future__ import annotations

import math
import multiprocessing
import os
import pickle
import signal
import sys
import threading
import time
from collections import Counter
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from multiprocessing.connection import Connection, wait
from pathlib import Path
from types import ModuleType
from typing import Any

from underlay.errors import FitError, InputError, SchedulerError, missing_extra
from underlay.inference.batch.curves import CurvePlace
from underlay.inference.batch.model import BatchModel
from underlay.inference.batch.results_table import Layout
from underlay.inference.batch.work import DIED, HANDED_ON, CurveFitter, Rows, given_up, work

# Environment variables that limit libraries of linear algebra to one thread: the matrices here are small, and
# threads of several processes would compete for the cores. It also makes sums the same to the last bit, whatever
# the machine and its load.
_ONE_THREAD = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
)
# Environment of a worker. Without PYTHONSAFEPATH a new Python would search the folder in which it starts, where the
# data may be, for every module first.
_ENVIRONMENT = dict.fromkeys((*_ONE_THREAD, "PYTHONSAFEPATH"), "1")
# Deaths of a process with a single curve after which that curve is given up as their cause.
_MOST_DEATHS = 2
# Largest number of processes in a row that may be killed from outside while they start.
_MOST_LOST_STARTS = 5
# Time limit for the start of a process (s), for a busy machine or a slow disk.
_LONGEST_START = 300.0
# Chunks submitted to a Dask cluster per thread: one at work and one waiting.
_AHEAD = 2


@contextmanager
def start_of_a_process() -> Iterator[None]:
    """Context for starting a process that neither runs the caller's script again nor receives Ctrl-C.

    The process gets one thread for linear algebra, and imports nothing from the folder it is started in.
    """
    script = sys.modules["__main__"]
    before = {name: os.environ.get(name) for name in _ENVIRONMENT}
    here = threading.current_thread() is threading.main_thread()
    interrupt = signal.signal(signal.SIGINT, signal.SIG_IGN) if here else None
    # multiprocessing would run the script of this module in the new process.
    sys.modules["__main__"] = ModuleType("__main__")
    os.environ.update(_ENVIRONMENT)
    try:
        yield
    finally:
        sys.modules["__main__"] = script
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
        if here:
            signal.signal(signal.SIGINT, interrupt)


def through_processes(
    model: BatchModel,
    layout: Layout,
    chunks: Sequence[Sequence[CurvePlace]],
    workers: int,
    time_limit: float | None = None,
) -> Generator[Rows, None, None]:
    """Fit chunks of curves in worker processes; yield rows as they come, in any order.

    A process that dies or exceeds the limit is replaced, and its unfinished curves are sent out again one at a
    time, so that one bad curve does not take others with it. Leaving the generator early ends the processes.

    Parameters
    ----------
    model : BatchModel
        What the curves have in common.
    layout : Layout
        Columns of the rows.
    chunks : sequence of sequences of CurvePlace
        The curves, in the groups in which they are sent to workers.
    workers : int
        Number of processes.
    time_limit : float, optional
        Longest time for one curve (s).

    Raises
    ------
    FitError
        If worker processes do not start.
    InputError
        If they cannot import what the running script defines.
    """
    remaining = _Remaining(chunks, layout, time_limit)
    message = pickle.dumps((model, layout), pickle.HIGHEST_PROTOCOL)
    team: list[_Worker] = []
    try:
        team.extend(_Worker(message, time_limit) for _ in range(workers))
        while active := [
            worker for worker in team if worker.places or (remaining.chunks and not worker.ready)
        ]:
            for worker in _heard_from(active):
                try:
                    rows = worker.receive()
                    remaining.lost_starts = 0
                except (EOFError, OSError):
                    worker.end()
                    rows = remaining.after_the_end_of(worker)
                    team[team.index(worker)] = _Worker(message, time_limit)
                if rows:
                    yield rows
            for worker in team:
                if worker.ready and not worker.places and remaining.chunks:
                    worker.give(remaining.chunks.pop())
    finally:
        for worker in team:
            worker.end()


class _Remaining:
    """The chunks not yet sent to a worker, the next one last, and the handling of those whose worker ended."""

    def __init__(
        self, chunks: Sequence[Sequence[CurvePlace]], layout: Layout, time_limit: float | None
    ) -> None:
        self.chunks = [list(chunk) for chunk in reversed(chunks)]
        self._layout, self._time_limit = layout, time_limit
        self._deaths: Counter[int] = Counter()
        self.lost_starts = 0

    def after_the_end_of(self, worker: _Worker) -> Rows:
        """Queue the unfinished curves of a worker that ended; return the row of a curve that is given up, if any.

        Raises
        ------
        FitError
            If the worker had not even started.
        """
        if not worker.ready:
            self.lost_starts += 1
            # A process that was killed by a signal (negative exit code) is replaced.
            if worker.exit_code >= 0 or self.lost_starts > _MOST_LOST_STARTS:
                raise FitError(f"a worker process did not start: it ended with code {worker.exit_code}")
        if len(worker.places) != 1:
            self.chunks.extend([place] for place in reversed(worker.places))
            return []
        place = worker.places[0]
        self._deaths[place.index] += 1
        if worker.late:
            return [given_up(place, self._layout, f"it took longer than {self._time_limit:g} s")]
        if self._deaths[place.index] == _MOST_DEATHS:
            return [given_up(place, self._layout, DIED)]
        self.chunks.append([place])
        return []


class _Worker:
    """A worker process and the parent's end of its pipe.

    Attributes
    ----------
    places : list of CurvePlace
        Curves that were sent to it and have no row yet.
    ready : bool
        Whether it has confirmed that it received the model.
    deadline : float
        Time of the monotonic clock (s) by which its next message must come.
    late : bool
        Whether it was ended because it missed the deadline.
    """

    def __init__(self, message: bytes, time_limit: float | None) -> None:
        if multiprocessing.current_process().daemon:
            raise FitError("a daemonic process cannot have worker processes: use none (workers 0)")
        self.connection, theirs = multiprocessing.Pipe()
        self._process = multiprocessing.get_context("spawn").Process(
            target=_serve, args=(theirs, message), daemon=True
        )
        self.places: list[CurvePlace] = []
        self.ready = self.late = False
        self._patience = math.inf if time_limit is None else time_limit + HANDED_ON
        self.deadline = time.monotonic() + _LONGEST_START
        with start_of_a_process():
            self._process.start()
        # Only the worker has the other end now: its death ends the pipe.
        theirs.close()

    @property
    def exit_code(self) -> int:
        """Exit code of the process; minus the number of the signal that ended it."""
        return self._process.exitcode or 0

    def give(self, places: list[CurvePlace]) -> None:
        """Send curves to the worker; a dead worker is noticed when its answer is read."""
        self.places, self.deadline = places, time.monotonic() + self._patience
        with suppress(OSError):
            self.connection.send_bytes(pickle.dumps(places, pickle.HIGHEST_PROTOCOL))

    def receive(self) -> Rows:
        """Read one message: finished rows, empty for the confirmation of the model.

        Raises
        ------
        EOFError, OSError
            If the process is gone.
        """
        answer: Rows | str = self.connection.recv()
        if isinstance(answer, str):
            raise _cannot_work(answer)
        self.places = self.places[len(answer) :]
        self.ready, self.late, self.deadline = True, False, time.monotonic() + self._patience
        return answer

    def kill(self) -> None:
        """End a process that missed its deadline; reading its pipe then raises EOFError."""
        self.late = True
        self._process.kill()

    def end(self) -> None:
        """End the process at once and close the pipe; its unfinished curves can be sent to another."""
        self._process.kill()
        self._process.join()
        self.connection.close()


def _heard_from(active: Sequence[_Worker]) -> list[_Worker]:
    """Wait until a worker sends a message or ends, and return those; kill those that missed their deadline."""
    left = min(worker.deadline for worker in active) - time.monotonic()
    ready = wait([worker.connection for worker in active], max(left, 0.0) if left < math.inf else None)
    for worker in active:
        if worker.connection not in ready and time.monotonic() > worker.deadline:
            worker.kill()
    return [worker for worker in active if worker.connection in ready]


def _cannot_work(complaint: str) -> Exception:
    if "__main__" in complaint:
        return InputError(
            f"worker processes cannot see what was defined in the running script ({complaint}): put it in a "
            "module that can be imported"
        )
    return FitError(f"a worker process cannot work: {complaint}")


def _serve(connection: Connection, message: bytes) -> None:
    """Main function of a worker: receive chunks of curves and send back rows, until the parent is gone.

    The first message, an empty list, confirms the model; a text reports an error.
    """
    # Ctrl-C reaches the whole process group; the parent decides which processes end.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with suppress(EOFError, OSError):
        try:
            model, layout = pickle.loads(message)  # noqa: S301  from the parent process only
            fitter = CurveFitter(model, layout)
            connection.send([])
            while True:
                places = pickle.loads(connection.recv_bytes())  # noqa: S301  same
                for rows in filter(None, fitter.batches(places)):
                    connection.send(rows)
        except (AttributeError, ImportError, pickle.UnpicklingError) as error:
            connection.send(f"{type(error).__name__}: {error}")


# --- a Dask cluster -------------------------------------------------------------------------------------


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
    try:
        distributed = import_module("distributed")
    except ImportError as error:
        raise missing_extra("a Dask scheduler needs dask", "cluster") from error
    try:
        client = distributed.Client(address, timeout=timeout, set_as_default=False)
    except (OSError, ValueError) as error:
        raise SchedulerError(
            f"no Dask scheduler answered at {address} within {timeout:g} s: is it running, and is the "
            "address right (tcp://host:8786)?"
        ) from error
    try:
        try:
            client.wait_for_workers(1, timeout=timeout)
        except OSError as error:
            raise SchedulerError(
                f"the Dask scheduler at {address} has no workers: start some with 'dask worker {address}'"
            ) from error
        threads = max(1, sum(client.nthreads().values()))
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
