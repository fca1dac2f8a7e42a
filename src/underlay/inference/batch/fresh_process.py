"""What a new process takes over of this one: no script, one thread for linear algebra, no import from here."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType

__all__ = ["start_of_a_process"]

#: One thread each: the matrices here are small, and threads of several processes would fight for the cores.
#: It also makes the last bit of every sum the same, whatever the machine and its load.
_ONE_THREAD = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
)
# A new Python would look for every module in the folder it is started in first, where the data may be.
_ENVIRONMENT = dict.fromkeys((*_ONE_THREAD, "PYTHONSAFEPATH"), "1")


@contextmanager
def start_of_a_process() -> Iterator[None]:
    """Start a process inside: it does not run the caller's script again, and Ctrl-C does not reach it."""
    script = sys.modules["__main__"]
    before = {name: os.environ.get(name) for name in _ENVIRONMENT}
    here = threading.current_thread() is threading.main_thread()
    interrupt = signal.signal(signal.SIGINT, signal.SIG_IGN) if here else None
    # multiprocessing would have the new process run the script that this module stands for.
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
