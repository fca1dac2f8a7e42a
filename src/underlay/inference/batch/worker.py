"""A worker process: curves in through one pipe, rows out through another, as pickles."""

from __future__ import annotations

import os
import pickle
import signal
import sys
import time
from typing import BinaryIO

from underlay.inference.batch.work import Workshop

__all__ = ["main", "serve"]

# Rows are sent at least this often (s), so that little is lost with a process.
_EVERY = 0.2


def serve(source: BinaryIO, sink: BinaryIO) -> None:
    """Answer chunks of curves with rows until the source ends.

    The first pickle is (model, layout), answered by None; each later one is a list of curves, answered by
    one or more (rows, whether that was all).
    """
    model, layout = pickle.load(source)  # noqa: S301  from the parent process only
    workshop = Workshop(model, layout)
    _send(sink, None)
    while True:
        try:
            places = pickle.load(source)  # noqa: S301  from the parent process only
        except EOFError:
            return
        rows: list[tuple[int, str]] = []
        sent = time.monotonic()
        for row in workshop.rows(places):
            rows.append(row)
            if time.monotonic() - sent > _EVERY:
                _send(sink, (rows, False))
                rows, sent = [], time.monotonic()
        _send(sink, (rows, True))


def _send(sink: BinaryIO, content: object) -> None:
    pickle.dump(content, sink, protocol=pickle.HIGHEST_PROTOCOL)
    sink.flush()


def main() -> None:
    """Serve through standard input and output: the program of a worker that was started anew."""
    # Ctrl-C reaches the whole group of processes; the parent decides what ends.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answers = os.fdopen(os.dup(1), "wb")
    # Whatever prints must not print into the answers.
    os.dup2(2, 1)
    try:
        serve(sys.stdin.buffer, answers)
    except BrokenPipeError:
        # The parent is gone: there is nobody to answer.
        os._exit(1)
