"""Tasks in a worker process, so that the page keeps responding: with progress, a stop, and a message if it dies.

The tasks are the methods of one object that lives in the process and remembers what it has read and fitted
(`underlay.app.tasks`). The last argument of each method is a function that sends intermediate results.

On Linux, workers are forked from an idle process that has the needed modules loaded: they share its memory and
start at once. Elsewhere each worker loads the modules itself.
"""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from importlib import import_module
from multiprocessing.connection import Connection, wait
from multiprocessing.process import parent_process
from typing import Any, TypeVar

from underlay.errors import UnderlayError
from underlay.inference.batch.processes import start_of_a_process

Tell = Callable[[Any], None]
_Of = TypeVar("_Of")

# Forking is safe on Linux only: system libraries of macOS do not survive it, Windows has none.
_START = "forkserver" if sys.platform == "linux" else "spawn"
_LOADED = ("underlay.app.tasks", "underlay.app.preloaded")
# A start changes what the whole program has, such as its environment: one at a time.
_STARTING = threading.Lock()
_STOPPED = "stopped; what was finished is kept"
_SAID, _DONE, _REFUSED, _FAILED = "said", "done", "refused", "failed"


class WorkError(UnderlayError):
    """A task failed, was refused or was stopped; the message is one sentence for people."""


class Worker:
    """A process that does one task after another; started at the first call, and again after it was stopped.

    Parameters
    ----------
    made_by : str
        Module and class, ``"underlay.app.tasks:Analyst"``, whose methods are the tasks; loaded in the process only.
    *arguments : Any
        Arguments of the class; plain values.
    """

    def __init__(self, made_by: str, *arguments: Any) -> None:
        self._made_by = (made_by, arguments)
        self._process: Any = None
        self._connection: Connection | None = None
        self._turn = asyncio.Lock()
        # All that waits for the process waits here, and the page answers meanwhile.
        self._waiting = ThreadPoolExecutor(1, "underlay")
        self._stopped = self._closed = False

    @property
    def is_busy(self) -> bool:
        """Whether a task is running."""
        return self._turn.locked()

    @property
    def process_id(self) -> int | None:
        """Id of the process in the operating system; None where there is none."""
        return None if self._process is None else self._process.pid

    async def call(self, task: str, *arguments: Any, heard: Tell | None = None) -> Any:
        """Run a task by name and return its result; its intermediate results are passed to `heard`.

        Raises
        ------
        WorkError
            If the task refuses its input, fails, is stopped, or its process dies: the message says which.
        """
        async with self._turn:
            if self._closed:
                raise WorkError(_STOPPED)
            self._stopped = False
            try:
                connection = await self._wait(self._started)
                if self._stopped:
                    self.stop()  # which was asked for while there was no process yet
                    raise WorkError(_STOPPED)
                await self._wait(connection.send, (task, arguments))
                while True:
                    what, value = await self._wait(connection.recv)
                    if what == _SAID:
                        if heard is not None:
                            heard(value)
                    elif what == _DONE:
                        return value
                    else:
                        raise WorkError(value)
            except (EOFError, OSError) as error:
                raise WorkError(await self._wait(self._epitaph, task)) from error

    async def _wait(self, what: Callable[..., _Of], *arguments: Any) -> _Of:
        return await asyncio.get_running_loop().run_in_executor(self._waiting, what, *arguments)

    def ask_to_stop(self) -> None:
        """Make a task that sends progress end at its next report, with the results so far."""
        if self._process is None:
            self._stopped = True
        elif self.is_busy and self._connection is not None:
            with suppress(OSError):
                self._connection.send(_STOPPED)

    def stop(self) -> None:
        """Kill the process, whatever it is doing; the next call starts another."""
        self._stopped = True
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._process = None

    def close(self) -> None:
        """Kill the process; later calls are refused."""
        self._closed = True
        self.stop()

    def _started(self) -> Connection:
        if self._process is not None and self._process.is_alive() and self._connection is not None:
            return self._connection
        self._process = None
        if self._connection is not None:
            self._connection.close()
        self._connection, theirs = multiprocessing.Pipe()
        process = _context().Process(target=_serve, args=(theirs, *self._made_by))
        with _STARTING, start_of_a_process():
            process.start()
        # The only other end is the process's now: its death is the end of the pipe.
        theirs.close()
        if self._closed:
            process.kill()
            process.join()
            raise WorkError(_STOPPED)
        self._process = process
        return self._connection

    def _epitaph(self, task: str) -> str:
        if self._stopped:
            return _STOPPED
        if self._process is not None:
            self._process.join(1.0)
            code, self._process = self._process.exitcode, None
        else:
            code = None
        how = f"signal {-code}" if code is not None and code < 0 else f"code {code}"
        return (
            f"the process that did this ({task}) ended without a word ({how}), perhaps for want of memory; nothing "
            "else is lost: try again"
        )


def load_ahead() -> None:
    """Start the process from which workers are forked (Linux only), which loads their modules; returns at once."""
    if _START != "forkserver":
        return
    from multiprocessing.forkserver import ensure_running  # noqa: PLC0415  there is none on Windows

    _context()
    with _STARTING, start_of_a_process():
        ensure_running()


def _context() -> Any:
    context: Any = multiprocessing.get_context(_START)
    context.set_forkserver_preload(list(_LOADED))
    return context


def _serve(connection: Connection, made_by: str, arguments: tuple[Any, ...]) -> None:
    """Run tasks sent through `connection`, in the worker process, until the parent process is gone."""
    # Ctrl-C reaches the whole group of processes; the parent decides what ends.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    module, _, name = made_by.partition(":")
    tasks = getattr(import_module(module), name)(*arguments)
    while True:
        try:
            message = connection.recv()
        except (EOFError, OSError):
            return
        if message == _STOPPED:
            continue  # what should have stopped was done already
        task, given = message
        connection.send(_answer(tasks, task, given, _teller(connection)))


def _teller(connection: Connection) -> Tell:
    """Return the function by which a task sends results; it raises KeyboardInterrupt if a stop was asked for."""

    def tell(value: Any) -> None:
        connection.send((_SAID, value))
        if connection.poll():
            connection.recv()
            raise KeyboardInterrupt

    return tell


def _answer(tasks: object, task: str, given: tuple[Any, ...], tell: Tell) -> tuple[str, Any]:
    try:
        return _DONE, getattr(tasks, task)(*given, tell)
    except UnderlayError as error:
        from underlay.app.form import in_the_form  # noqa: PLC0415  not loaded before a task is refused

        return _REFUSED, in_the_form(str(error))
    except KeyboardInterrupt:
        return _REFUSED, _STOPPED
    except Exception as error:  # noqa: BLE001  whatever it is, the page says it and lives on
        return (
            _FAILED,
            f"this failed, which is a fault of underlay ({type(error).__name__}: {error}); please report it",
        )


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
