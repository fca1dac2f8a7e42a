"""Chunks of curves through processes of this machine, each with one thread for linear algebra."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import tempfile
import threading
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from queue import SimpleQueue
from typing import IO, Any

from underlay.errors import FitError, InputError
from underlay.inference.batch_curves import CurvePlace
from underlay.inference.batch_model import BatchModel
from underlay.inference.batch_work import died
from underlay.inference.results_table import Layout

__all__ = ["Rows", "through_processes"]

#: Rows (index, CSV text) that came together.
Rows = list[tuple[int, str]]

# One thread each: the matrices here are small, and threads of several processes would fight for the cores.
# It also makes the last bit of every sum the same, whatever machine and load.
_ONE_THREAD = dict.fromkeys(
    (
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "BLIS_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS",
        "NUMEXPR_NUM_THREADS",
    ),
    "1",
)
# A process that dies on the same curve this often dies because of it.
_MOST_DEATHS = 2
_LONGEST_COMPLAINT = 2000


def through_processes(
    model: BatchModel, layout: Layout, chunks: Iterable[Sequence[CurvePlace]], workers: int
) -> Iterator[Rows]:
    """Fit chunks of curves in worker processes; yield rows as they come, in any order.

    A process that dies is replaced and what it had not answered is given out again. Leaving the iterator
    early ends the processes.

    Raises
    ------
    FitError
        If worker processes do not start.
    """
    results: SimpleQueue[Rows | BaseException | None] = SimpleQueue()
    shared = _Shared(pickle.dumps((model, layout), pickle.HIGHEST_PROTOCOL), layout, iter(chunks))
    desks = [_Desk(shared, results) for _ in range(workers)]
    for desk in desks:
        desk.start()
    try:
        working = workers
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
        for desk in desks:
            desk.join()


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


class _Desk(threading.Thread):
    """The parent's end of one worker process, and of its successors."""

    def __init__(self, shared: _Shared, results: SimpleQueue[Rows | BaseException | None]) -> None:
        super().__init__(daemon=True)
        self._shared, self._results = shared, results
        self._process: subprocess.Popen[bytes] | None = None
        self._complaints: IO[bytes] | None = None

    def run(self) -> None:
        """Serve until nothing is left; what goes wrong is told to the one who waits."""
        try:
            self._serve()
        except BaseException as error:  # noqa: BLE001  a thread has nobody above it
            if not self._shared.closed:
                self._results.put(error)
        else:
            self._results.put(None)
        finally:
            self.end()

    def end(self) -> None:
        """End the worker process at once; what it has not answered is not lost, only not done."""
        process = self._process
        if process is not None and process.poll() is None:
            process.kill()
            process.wait()

    def _serve(self) -> None:
        places = self._shared.next_chunk()
        while places:
            process = self._process or self._start()
            message = pickle.dumps(places, pickle.HIGHEST_PROTOCOL)
            following: list[CurvePlace] | None = None
            try:
                _write(process, message)
                # The next chunk is fetched while the worker is busy.
                following = self._shared.next_chunk()
                whole = False
                while not whole:
                    rows, whole = _answer(process)
                    places = places[len(rows) :]
                    self._results.put(rows)
            except (EOFError, OSError, pickle.UnpicklingError):
                if self._shared.closed:
                    return
                self._bury()
                places = self._after_a_death(places) + (following or [])
            else:
                places = following

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

    def _start(self) -> subprocess.Popen[bytes]:
        path = os.pathsep.join(os.path.realpath(entry) for entry in sys.path)
        self._complaints = tempfile.TemporaryFile()  # noqa: SIM115  closed with its process
        process = subprocess.Popen(  # noqa: S603  our own interpreter and module
            [sys.executable, "-m", "underlay.inference.batch_worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._complaints,
            env={**os.environ, **_ONE_THREAD, "PYTHONPATH": path},
        )
        self._process = process
        try:
            _write(process, self._shared.greeting)
            _answer(process)
        except (EOFError, OSError, pickle.UnpicklingError):
            raise self._did_not_start(process) from None
        return process

    def _did_not_start(self, process: subprocess.Popen[bytes]) -> Exception:
        process.wait()
        text = ""
        if self._complaints is not None:
            self._complaints.seek(0)
            text = self._complaints.read()[-_LONGEST_COMPLAINT:].decode("utf-8", "replace").strip()
        last = text.rpartition("\n")[2]
        if "__main__" in last:
            return InputError(
                f"worker processes cannot see what was defined in the running script ({last}): put it in a "
                "module that can be imported"
            )
        return FitError(f"a worker process did not start: {last or f'exit code {process.returncode}'}")

    def _bury(self) -> None:
        self.end()
        self._process = None
        if self._complaints is not None:
            self._complaints.close()


def _write(process: subprocess.Popen[bytes], message: bytes) -> None:
    assert process.stdin is not None  # noqa: S101  it was asked for
    process.stdin.write(message)
    process.stdin.flush()


def _answer(process: subprocess.Popen[bytes]) -> Any:
    assert process.stdout is not None  # noqa: S101  it was asked for
    return pickle.load(process.stdout)  # noqa: S301  from our own worker only
