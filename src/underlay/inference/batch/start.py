"""How a worker process comes into being, and the two pipes to it.

Where the caller is a process of one thread, a worker is a fork of it, ready in milliseconds. Everywhere else
(threads of linear algebra, a notebook, Windows) a fork would copy locks that nobody releases, so a worker is
a fresh Python that imports the library, in about a second. Neither runs the caller's script again, so scripts
need no ``if __name__ == "__main__"`` guard.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
import warnings
from contextlib import suppress
from pathlib import Path
from typing import IO, Any, BinaryIO

from underlay.inference.batch.worker import serve

__all__ = ["Worker", "can_fork", "fork_worker", "start_worker"]

# One thread each: the matrices here are small, and threads of several processes would fight for the cores.
# It also makes the last bit of every sum the same, whatever the machine and its load.
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
_LONGEST_COMPLAINT = 2000
_TASKS, _FILES = Path("/proc/self/task"), Path("/proc/self/fd")
# Threads that stop their work and let go of their locks around a fork: jemalloc's, which comes with pyarrow.
_SAFE_THREADS = frozenset({"jemalloc_bg_thd"})


class Worker:
    """A worker process as its parent sees it.

    Parameters
    ----------
    source, sink : binary streams
        Answers come from `source`, questions go to `sink`.
    process : Popen or int
        The process, or its number where it is a fork.
    complaints : binary stream, optional
        What it writes to standard error.
    """

    def __init__(
        self,
        source: BinaryIO,
        sink: BinaryIO,
        process: subprocess.Popen[bytes] | int,
        complaints: IO[bytes] | None = None,
    ) -> None:
        self._source, self._sink = source, sink
        self._process, self._complaints = process, complaints
        self._alive = True
        self._lock = threading.Lock()

    @property
    def number(self) -> int:
        """Its process number."""
        return self._process if isinstance(self._process, int) else self._process.pid

    def send(self, message: bytes) -> None:
        """Send one pickle; raises OSError if the process is gone."""
        self._sink.write(message)
        self._sink.flush()

    def receive(self) -> Any:
        """Wait for one answer; raises EOFError if the process is gone."""
        return pickle.load(self._source)  # noqa: S301  from our own worker only

    def kill(self) -> None:
        """End the process at once; whoever waits for an answer then meets its end. Any thread may call it."""
        with self._lock:
            if not self._alive:
                return
            self._alive = False
            if isinstance(self._process, int):
                os.kill(self._process, signal.SIGKILL)
                os.waitpid(self._process, 0)
            else:
                self._process.kill()
                self._process.wait()

    def close(self) -> None:
        """End the process and let go of the pipes; for the thread that talks to it, or after that."""
        self.kill()
        # What was still to be sent has nobody to read it.
        with suppress(OSError):
            self._sink.close()
        self._source.close()
        if self._complaints is not None:
            self._complaints.close()

    def complaint(self) -> str:
        """Last line that it wrote to standard error."""
        if self._complaints is None:
            return ""
        self._complaints.seek(0)
        text = self._complaints.read()[-_LONGEST_COMPLAINT:].decode("utf-8", "replace")
        return text.strip().rpartition("\n")[2]


def can_fork() -> bool:
    """Whether this process has one thread only, those of libraries counted, so that a fork is safe."""
    if not (hasattr(os, "fork") and _TASKS.is_dir()):
        return False
    try:
        names = [(task / "comm").read_text().strip() for task in _TASKS.iterdir()]
    except OSError:  # a thread that ended while it was looked at: there was more than one
        return False
    return len([name for name in names if name not in _SAFE_THREADS]) == 1


def fork_worker() -> Worker:
    """Make a worker as a fork of this process, which must have one thread."""
    (question, ask), (answers, answer) = os.pipe(), os.pipe()
    number = os.fork()
    if number == 0:
        _be_a_worker(question, answer)
    os.close(question)
    os.close(answer)
    return Worker(os.fdopen(answers, "rb"), os.fdopen(ask, "wb"), number)


def _be_a_worker(question: int, answer: int) -> None:
    """Serve and end, whatever happens, without a step into the parent's code."""
    code = 1
    try:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        _close_all_but(question, answer)
        # What prints must not print twice, nor into a pipe of the caller's.
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        warnings.resetwarnings()
        with os.fdopen(question, "rb") as source, os.fdopen(answer, "wb") as sink:
            serve(source, sink)
        code = 0
    finally:
        os._exit(code)


def _close_all_but(*kept: int) -> None:
    """Close what was inherited: ends of other workers' pipes, and the journal, whose lock it would hold."""
    for number in [int(file.name) for file in _FILES.iterdir()]:
        if number > 2 and number not in kept:
            # The listing's own is closed by now.
            with suppress(OSError):
                os.close(number)


def start_worker() -> Worker:
    """Make a worker as a new process, which imports the library anew."""
    path = os.pathsep.join(os.path.realpath(entry) for entry in sys.path)
    complaints = tempfile.TemporaryFile()  # noqa: SIM115  read when the process is gone
    process = subprocess.Popen(
        # Without -P it would look for every module in the folder it is started in first.
        [sys.executable, "-P", "-c", "from underlay.inference.batch.worker import main; main()"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=complaints,
        env={**os.environ, **_ONE_THREAD, "PYTHONPATH": path},
    )
    if process.stdout is None or process.stdin is None:
        raise OSError("a worker process has no pipes")
    return Worker(process.stdout, process.stdin, process, complaints)  # type: ignore[arg-type]  # Popen's IO[bytes] are buffered binary files
