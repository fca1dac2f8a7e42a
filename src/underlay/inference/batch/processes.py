"""Chunks of curves through processes of this machine, each with one thread for linear algebra."""

from __future__ import annotations

import pickle
import threading
from collections import Counter
from collections.abc import Generator, Iterable, Iterator, Sequence
from queue import SimpleQueue

from underlay.errors import FitError, InputError
from underlay.inference.batch.curves import CurvePlace
from underlay.inference.batch.model import BatchModel
from underlay.inference.batch.results_table import Layout
from underlay.inference.batch.start import Worker, can_fork, fork_worker, start_worker
from underlay.inference.batch.work import died

__all__ = ["Rows", "through_processes"]

#: Rows (index, CSV text) that came together.
Rows = list[tuple[int, str]]

# A process that dies on the same curve this often dies because of it.
_MOST_DEATHS = 2


def through_processes(
    model: BatchModel, layout: Layout, chunks: Iterable[Sequence[CurvePlace]], workers: int
) -> Generator[Rows, None, None]:
    """Fit chunks of curves in worker processes; hand out rows as they come, in any order.

    A process that dies is replaced and what it had not answered is given out again. Leaving the iterator
    early ends the processes.

    Raises
    ------
    FitError
        If worker processes do not start.
    """
    results: SimpleQueue[Rows | BaseException | None] = SimpleQueue()
    shared = _Shared(pickle.dumps((model, layout), pickle.HIGHEST_PROTOCOL), layout, iter(chunks))
    desks = [_Desk(shared, results, fork_worker() if can_fork() else None) for _ in range(workers)]
    return _collect(shared, desks, results)


def _collect(
    shared: _Shared, desks: Sequence[_Desk], results: SimpleQueue[Rows | BaseException | None]
) -> Generator[Rows, None, None]:
    working = len(desks)
    try:
        for desk in desks:
            desk.start()
        while working:
            result = results.get()
            if result is None:
                working -= 1
            elif isinstance(result, BaseException):
                raise result
            else:
                yield result
    finally:
        shared.close()
        for desk in desks:
            desk.end()


class _Shared:
    """What all desks draw from."""

    def __init__(self, greeting: bytes, layout: Layout, chunks: Iterator[Sequence[CurvePlace]]) -> None:
        self.greeting, self.layout = greeting, layout
        self._chunks = chunks
        self._lock = threading.Lock()
        self.deaths: Counter[int] = Counter()
        self.closed = False

    def next_chunk(self) -> list[CurvePlace]:
        """The next curves, or none where all are given out."""
        with self._lock:
            return [] if self.closed else list(next(self._chunks, ()))

    def close(self) -> None:
        """Give out nothing more."""
        with self._lock:
            self.closed = True


class _Desk:
    """The parent's end of one worker process, and of its successors: a thread that asks and waits."""

    def __init__(
        self, shared: _Shared, results: SimpleQueue[Rows | BaseException | None], worker: Worker | None
    ) -> None:
        self._shared, self._results = shared, results
        self._worker = worker
        self._greeted = False
        self._thread = threading.Thread(target=self._run, daemon=True)

    def start(self) -> None:
        """Begin to serve."""
        self._thread.start()

    def end(self) -> None:
        """End the worker process at once: what it has not answered is not lost, only not done."""
        if self._worker is not None:
            self._worker.kill()
        if self._thread.ident is not None:
            self._thread.join()
        if self._worker is not None:
            self._worker.close()

    def _run(self) -> None:
        """Serve until nothing is left; what goes wrong is told to the one who waits."""
        try:
            self._serve()
        except BaseException as error:  # noqa: BLE001  a thread has nobody above it
            self._results.put(error)
        else:
            self._results.put(None)

    def _serve(self) -> None:
        places = self._shared.next_chunk()
        while places:
            worker = self._greeted_worker()
            following: list[CurvePlace] = []
            try:
                worker.send(pickle.dumps(places, pickle.HIGHEST_PROTOCOL))
                # The next chunk is fetched while the worker is busy.
                following = self._shared.next_chunk()
                whole = False
                while not whole:
                    rows, whole = worker.receive()
                    places = places[len(rows) :]
                    self._results.put(rows)
            except (EOFError, OSError, pickle.UnpicklingError):
                if self._shared.closed:
                    return
                worker.close()
                self._worker, self._greeted = None, False
                places = self._after_a_death(places)
            places = [*places, *following]

    def _after_a_death(self, places: list[CurvePlace]) -> list[CurvePlace]:
        """What is still to do when a worker died on the first of `places`."""
        if not places:
            return []
        deaths = self._shared.deaths
        deaths[places[0].index] += 1
        if deaths[places[0].index] < _MOST_DEATHS:
            return places
        self._results.put([died(places[0], self._shared.layout)])
        return places[1:]

    def _greeted_worker(self) -> Worker:
        """Return a worker that knows the model."""
        worker = self._worker = self._worker or start_worker()
        if not self._greeted:
            try:
                worker.send(self._shared.greeting)
                worker.receive()
            except (EOFError, OSError, pickle.UnpicklingError):
                raise self._did_not_start(worker) from None
            self._greeted = True
            if self._shared.closed:
                worker.kill()
        return worker

    def _did_not_start(self, worker: Worker) -> Exception:
        worker.kill()
        complaint = worker.complaint()
        worker.close()
        if "__main__" in complaint:
            return InputError(
                f"worker processes cannot see what was defined in the running script ({complaint}): put it "
                "in a module that can be imported"
            )
        return FitError(f"a worker process did not start: {complaint or 'it ended without a word'}")
