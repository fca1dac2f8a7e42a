"""A Markov chain on disk that survives a kill at any moment: the journal of its steps.

Row 0 of the journal is the state of the random generator after the last step, with counters; row n is the n-th
step: scaled coordinates and log-posterior of every walker. Both are written together or not at all. The
distribution that moves propose from is not stored: the same problem and seed give it again.
"""

from __future__ import annotations

import base64
import binascii
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from underlay._arrays import FloatArray
from underlay._door import FileKind, PathLike, understood
from underlay.inference.journal import Journal

#: numpy's legacy generator state, as emcee keeps it: name, 624 words, position, has_gauss, cached gauss.
RandomState: TypeAlias = tuple[str, Any, int, int, float]
# Bytes that a file may have: what a sampler could hold in memory.
_KIND = FileKind("a chain file", 8_000_000_000, "begin a new one under another name")
# Words of the Mersenne Twister; after them position, has_gauss, cached gauss and two counters.
_WORDS = 624
_STATE_SIZE = _WORDS + 5


class Chain(NamedTuple):
    """The chain that a file held when it was opened.

    `steps` is (steps, walkers, parameters + 1), the scaled coordinates and the log-posterior; `random_state` is
    that of the generator after the last step; `evaluations` and `failures` count model evaluations so far, and
    those of them that failed.
    """

    steps: FloatArray
    random_state: RandomState
    evaluations: int
    failures: int


class ChainFile:
    """An open chain file; `open_chain` makes one.

    Parameters
    ----------
    journal : Journal
        Open, with the steps so far.
    """

    def __init__(self, journal: Journal) -> None:
        self._journal = journal
        self.steps = max(journal.done - 1, 0)

    def append(
        self,
        coords: FloatArray,
        log_posterior: FloatArray,
        random_state: RandomState,
        counts: tuple[int, int],
    ) -> None:
        """Write one step: coordinates (walkers, parameters), log-posterior (walkers,), counters.

        `counts` are the numbers of evaluations and of failures so far.
        """
        # 32-bit words and counters below 2^53 are exact in float64.
        state = np.concatenate([np.asarray(random_state[1], dtype=np.float64), random_state[2:], counts])
        step = np.column_stack([coords, log_posterior])
        self._journal.append([(0, _text(state)), (self.steps + 1, _text(step))], anew=True)
        self.steps += 1


@contextmanager
def open_chain(
    path: PathLike, names: tuple[str, ...], walkers: int, *, resume: bool
) -> Iterator[tuple[ChainFile, Chain | None]]:
    """Open a file for a chain of so many walkers, begun where there is none.

    With `resume` a chain that is there is continued, and given too.

    Raises
    ------
    InputError
        If the file exists and `resume` is not set (a chain is never overwritten), if it holds a chain of other
        parameters or another number of walkers, or another run has it open.
    FileAccessError
        If it cannot be opened or written.
    FileFormatError
        If it is no chain file, or damaged.
    """
    identity = {"hashes": {"free parameters": list(names), "number of walkers": walkers}}
    size = walkers * (len(names) + 1)

    def is_row(number: int, text: str) -> bool:
        return number >= 0 and len(_numbers(text)) == (size if number else _STATE_SIZE)

    with Journal(Path(path), identity, is_row, resume=resume, what=_KIND.name, rows="steps") as journal:
        before = None
        if journal.done:
            with understood(path, _KIND):
                before = _read(journal, (-1, walkers, len(names) + 1))
        yield ChainFile(journal), before


def _text(numbers: FloatArray) -> str:
    return base64.b64encode(np.asarray(numbers, dtype="<f8").tobytes()).decode()


def _numbers(text: str) -> FloatArray:
    """The numbers of a row; none where it is no such text."""
    try:
        return np.frombuffer(base64.b64decode(text, validate=True), dtype="<f8")
    except (binascii.Error, ValueError):
        return np.empty(0)


def _read(journal: Journal, shape: tuple[int, int, int]) -> Chain:
    """The chain of a journal's rows.

    Raises
    ------
    ValueError
        If a step is missing, a number is not finite, or the state is none of the generator.
    """
    state, *rows = map(_numbers, journal.lines())
    if not all(map(journal.has, range(journal.done))):
        raise ValueError("a step is missing")
    steps = np.array(rows).reshape(shape)
    words, position, counts = state[:_WORDS], state[_WORDS], state[_WORDS + 3 :]
    whole = np.isfinite(state).all() and (words == np.floor(words)).all() and (counts >= 0.0).all()
    if not (whole and (words >= 0.0).all() and (words < 2.0**32).all() and 0.0 <= position <= _WORDS):
        raise ValueError("it holds no state of the generator")
    if not np.isfinite(steps).all():
        raise ValueError("it holds numbers that are not finite")
    has_gauss, cached = int(state[_WORDS + 1]), float(state[_WORDS + 2])
    random_state = ("MT19937", words.astype(np.uint32), int(position), has_gauss, cached)
    return Chain(steps, random_state, int(counts[0]), int(counts[1]))
