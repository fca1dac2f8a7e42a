"""A Markov chain on disk that survives a kill at any moment: an HDF5 file filled in place.

The file is laid out once, at its full size (sparse until used), with contiguous datasets. From then on every step
overwrites reserved bytes and nothing of the file's own structure changes, so a process that dies between two steps
leaves a valid file. A step counts only once its counter is written, after its data; the random generator's state
alternates between two slots, so that the one that belongs to the counter is always complete.

Layout: ``chain`` (steps, walkers, parameters + 1), the scaled coordinates and the log-posterior; ``state`` (2,
629), the Mersenne Twister's words and the counters; ``steps`` (1,). The distribution that moves propose from is not
stored: the same problem and seed give it again. Files of earlier versions, which also hold a mixture, are read.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from underlay._arrays import FloatArray
from underlay._door import FileKind, PathLike, parse_json, require_regular, understood
from underlay.errors import FileAccessError, InputError, missing_extra

try:
    import h5py
except ImportError:  # an optional extra; opening a file says so
    h5py = None


#: numpy's legacy generator state, as emcee keeps it: name, 624 words, position, has_gauss, cached gauss.
RandomState: TypeAlias = tuple[str, Any, int, int, float]
# Format that is written, and older ones that are read.
_FORMAT, _OLDER = "underlay chain 3", ("underlay chain 1", "underlay chain 2")
# Bytes that a file may have: what a sampler could hold in memory; on the disk a chain is sparse until it is used.
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
    file : h5py.File
        Open for reading and writing.
    """

    def __init__(self, file: Any) -> None:
        self._file = file
        self._chain, self._state, self._steps = file["chain"], file["state"], file["steps"]
        self.steps = int(self._steps[0])

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
        self._chain[self.steps] = np.column_stack([coords, log_posterior])
        self._state[(self.steps + 1) % 2] = _packed(random_state, counts)
        self._file.flush()
        self.steps += 1
        self._steps[0] = self.steps
        self._file.flush()


@contextmanager
def open_chain(
    path: PathLike, names: tuple[str, ...], shape: tuple[int, int], *, resume: bool
) -> Iterator[tuple[ChainFile, Chain | None]]:
    """Open a file for a chain of `shape` = (steps, walkers), laid out anew where there is none.

    With `resume` a chain that is there is continued, and given too.

    Raises
    ------
    InputError
        If the file exists and `resume` is not set (a chain is never overwritten); if it is no chain file, or one of
        other parameters or another number of walkers.
    FileAccessError
        If it cannot be opened or written, or another run has it open.
    MissingExtraError
        If h5py is not installed.
    """
    before = None
    if Path(path).exists():
        if not resume:
            raise InputError(f"{os.fspath(path)} exists: continue it (resume), or give another name")
        with _opened(path, "r+") as file:
            with understood(path, _KIND):
                before = _read(file, path, names, shape[1])
            if len(file["chain"]) >= shape[0]:
                yield ChainFile(file), before
                return
    _put_new(path, names, shape, before)
    with _opened(path, "r+") as file:
        yield ChainFile(file), before


def _packed(random_state: RandomState, counts: tuple[int, int]) -> FloatArray:
    # 32-bit words and counters below 2^53 are exact in float64.
    return np.concatenate([np.asarray(random_state[1], dtype=np.float64), random_state[2:], counts])


@contextmanager
def _opened(path: PathLike, mode: str) -> Iterator[Any]:
    if h5py is None:
        raise missing_extra("keeping a chain in a file needs h5py", "uq", "sample without a backend")
    if mode == "r+":
        require_regular(path, _KIND)
    try:
        file = h5py.File(os.fspath(path), mode)
    except BlockingIOError as error:
        raise FileAccessError(f"{os.fspath(path)} is in use by another run") from error
    except OSError as error:
        if mode == "r+" and Path(path).is_file() and not h5py.is_hdf5(os.fspath(path)):
            raise InputError(f"{os.fspath(path)} is not a chain file: {error}") from error
        raise FileAccessError(f"cannot open {os.fspath(path)}: {error}") from error
    with file:
        yield file


def _reserve(file: Any, name: str, shape: tuple[int, ...]) -> None:
    """Make a contiguous HDF5 dataset whose bytes are allocated now and not initialised."""
    plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plist.set_layout(h5py.h5d.CONTIGUOUS)
    plist.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    plist.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    space = h5py.h5s.create_simple(shape)
    h5py.h5d.create(file.id, name.encode(), h5py.h5t.IEEE_F64LE, space, dcpl=plist)


def _read(file: Any, path: PathLike, names: tuple[str, ...], walkers: int) -> Chain:
    where = os.fspath(path)
    if file.attrs.get("format") not in (_FORMAT, *_OLDER):
        raise InputError(f"{where} is not a chain file of this version (format {file.attrs.get('format')!r})")
    stored = tuple(map(str, parse_json(file.attrs["parameters"])))
    if stored != names:
        raise InputError(
            f"{where} holds the chain of another problem: its parameters are {', '.join(stored)}; "
            f"this problem has {', '.join(names)}"
        )
    _check_layout(file, len(names))
    if file["chain"].shape[1] != walkers:
        raise InputError(
            f"{where} holds {file['chain'].shape[1]} walkers and {walkers} are asked for; a chain goes on "
            "with as many as it began with"
        )
    steps = _steps(file)
    state = file["state"][steps % 2]
    return Chain(
        steps=file["chain"][:steps],
        random_state=(
            "MT19937",
            state[:_WORDS].astype(np.uint32),
            int(state[_WORDS]),
            int(state[_WORDS + 1]),
            float(state[_WORDS + 2]),
        ),
        evaluations=int(state[_WORDS + 3]) if steps else 0,
        failures=int(state[_WORDS + 4]) if steps else 0,
    )


def _check_layout(file: Any, parameters: int) -> None:
    """Raise ValueError where a file's datasets differ from those of a new file in shape, kind or storage."""
    shapes = {"chain": (None, None, parameters + 1), "state": (2, _STATE_SIZE), "steps": (1,)}
    size = file.id.get_filesize()
    for name, shape in shapes.items():
        if not isinstance(file.get(name, getlink=True), h5py.HardLink):
            raise ValueError(f"{name} leads out of the file")  # noqa: TRY004  of a file, not of an argument
        entry = file[name]
        fits = (
            isinstance(entry, h5py.Dataset)
            and entry.dtype == np.float64
            and entry.ndim == len(shape)
            and all(wanted in (None, found) for wanted, found in zip(shape, entry.shape, strict=True))
        )
        # Contiguous: a dataset cannot claim more bytes than the file holds, and no filter runs when it is read.
        if not fits or entry.chunks is not None or entry.external or entry.is_virtual or entry.nbytes > size:
            raise ValueError(f"{name} is not laid out as a chain's")


def _steps(file: Any) -> int:
    """Number of completed steps in the file, after a check of the chain and of the generator's state."""
    steps = float(file["steps"][0])
    if not (steps.is_integer() and 0.0 <= steps <= len(file["chain"])):
        raise ValueError(f"it counts {steps} steps and has room for {len(file['chain'])}")
    state = file["state"][int(steps) % 2]
    words, position, counts = state[:_WORDS], state[_WORDS], state[_WORDS + 3 :]
    whole = np.isfinite(state).all() and (words == np.floor(words)).all() and (counts >= 0.0).all()
    if steps and not (
        whole and (words >= 0.0).all() and (words < 2.0**32).all() and 0.0 <= position <= _WORDS
    ):
        raise ValueError("it holds no state of the generator")
    if not np.isfinite(file["chain"][: int(steps)]).all():
        raise ValueError("it holds numbers that are not finite")
    return int(steps)


def _put_new(path: PathLike, names: tuple[str, ...], shape: tuple[int, int], before: Chain | None) -> None:
    """Write a new chain file, with the steps that were `before`, and move it to `path` when it is complete."""
    temporary = Path(f"{os.fspath(path)}.new")
    # Left by a killed run, or a symbolic link that would lead out of the output.
    temporary.unlink(missing_ok=True)
    with _opened(temporary, "x") as file:
        _reserve(file, "chain", (*shape, len(names) + 1))
        _reserve(file, "state", (2, _STATE_SIZE))
        _reserve(file, "steps", (1,))
        file["steps"][0] = 0
        file.attrs["format"] = _FORMAT
        file.attrs["parameters"] = json.dumps(names)
        if before is not None:
            steps = len(before.steps)
            file["chain"][:steps] = before.steps
            file["state"][steps % 2] = _packed(before.random_state, (before.evaluations, before.failures))
            file["steps"][0] = steps
    temporary.replace(path)
