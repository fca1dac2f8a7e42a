"""The journal of a map or a Markov chain under way: an SQLite database to which rows are written as they come.

It has two tables: ``run`` identifies the run (of a map, hashes of scene, manifest and curves; only the same run may
continue it), ``row`` holds its rows, each with a checksum. The process may be killed and the disk may fill at any
moment: complete rows stay. The table or the posterior that people read is made from it.

A journal is checked before it is used: it is opened for reading first, must hold these two tables and nothing else,
and a row that does not belong to this run is made again.

Of a Markov chain (`open_chain`) row 0 is the state of the random generator after the last step, with counters; row
n is the n-th step: scaled coordinates and log-posterior of every walker. Both are written together or not at all.
The distribution that moves propose from is not stored: the same problem and seed give it again.
"""

from __future__ import annotations

import base64
import binascii
import json
import sqlite3
import stat
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self, TypeAlias

import numpy as np

from underlay._arrays import FloatArray
from underlay._door import FileKind, PathLike, understood
from underlay.errors import FileAccessError, FileFormatError, InputError, UnderlayError

# "ulay": marks the database as a journal of underlay; and the version of its layout.
_APPLICATION, _FORM = 0x756C6179, 1
_TABLES = (
    "CREATE TABLE run (identity TEXT NOT NULL)",
    "CREATE TABLE row (curve INTEGER PRIMARY KEY, line TEXT NOT NULL, crc INTEGER NOT NULL)",
)
# Bytes of the longest value that is read: the hashes and columns of a run take some thousand, a row of a map some
# hundred, a step of a chain eleven per number.
_LONGEST = 1_000_000
# Endings of the database and of SQLite's companion files.
_ENDINGS = ("", "-wal", "-shm", "-journal")
#: numpy's legacy generator state, as emcee keeps it: name, 624 words, position, has_gauss, cached gauss.
RandomState: TypeAlias = tuple[str, Any, int, int, float]
# The file of a chain, with the bytes that a sampler could hold in memory.
_KIND = FileKind("a chain file", 8_000_000_000, "begin a new one under another name")
# Words of the Mersenne Twister; after them position, has_gauss, cached gauss and two counters.
_WORDS = 624
_STATE_SIZE = _WORDS + 5


class Journal:
    """Numbered rows of text, in a file or in memory. A context manager.

    Parameters
    ----------
    path : Path or None
        The file; None for a journal in memory, which is lost when it is closed.
    identity : mapping
        Identifies the run: ``hashes`` (what an input is called, and its SHA-256 or value), and anything else.
    is_row : callable
        Whether a number and a text are a row of this run.
    resume : bool
        Continue the file if it exists. Otherwise it must not exist.
    what, rows : str
        What messages call the file and its rows.

    Raises
    ------
    InputError
        If the file exists and `resume` is not set, or it belongs to another run, or another process is writing to
        it.
    FileFormatError
        If it is no such file, or a damaged one.
    FileAccessError
        If it cannot be read or written.
    """

    def __init__(
        self,
        path: Path | None,
        identity: Mapping[str, Any],
        is_row: Callable[[int, str], bool],
        *,
        resume: bool,
        what: str = "the journal of a map",
        rows: str = "curves",
    ) -> None:
        self._there: set[int] = set()
        self._what, self._rows = what, rows
        self.path = path or Path("the journal in memory")
        if path is None:
            self._file = _connected(":memory:")
            self._begin(identity)
            return
        _require_regular(path)
        existed = path.exists()
        if existed and not resume:
            raise InputError(
                f"{path} holds a run already: continue it with resume (--resume), or choose another output"
            )
        with self._reported():
            begun = existed and self._is_begun(identity)
            self._file = _open(path, "rwc")
            try:
                self._lock()
                if begun:
                    self._find_rows(is_row)
                else:
                    self._begin(identity)
            except BaseException:
                self._file.close()
                raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    @property
    def done(self) -> int:
        """Number of rows there are."""
        return len(self._there)

    def has(self, index: int) -> bool:
        """Whether the row of this number is there."""
        return index in self._there

    def append(self, rows: Iterable[tuple[int, str]], *, anew: bool = False) -> int:
        """Append rows (number, text), all or none of them; return how many were written.

        Rows that are there are kept, or with `anew` replaced.

        Raises
        ------
        FileAccessError
            If the disk is full or gone; what was there before is kept.
        """
        fresh = {index: _plain(text) for index, text in rows if anew or not self.has(index)}
        with self._reported():
            self._write(fresh)
        self._there.update(fresh)
        return len(fresh)

    def sync(self) -> None:
        """Move everything from SQLite's write-ahead log into the database file."""
        with self._reported():
            self._file.execute("PRAGMA wal_checkpoint")

    def lines(self) -> Iterator[str]:
        """The texts of the rows, in the order of their numbers."""
        with self._reported():
            for (line,) in self._file.execute("SELECT line FROM row ORDER BY curve"):
                yield line.decode()

    def _is_begun(self, identity: Mapping[str, Any]) -> bool:
        """Whether the file holds this run, and not just an empty database; read without writing.

        Raises
        ------
        FileFormatError, InputError
            If it is damaged, no journal, or that of another run.
        """
        with closing(_open(self.path, "ro")) as file:
            schema = [_text(sql) for (sql,) in file.execute("SELECT sql FROM sqlite_master ORDER BY rowid")]
            marks = [
                file.execute(f"PRAGMA {mark}").fetchone()[0] for mark in ("application_id", "user_version")
            ]
            if not schema and not any(marks):
                return False
            if schema != list(_TABLES) or marks != [_APPLICATION, _FORM]:
                raise FileFormatError(f"{self.path} is not {self._what}; choose another output")
            if file.execute("PRAGMA quick_check(1)").fetchall() != [(b"ok",)]:
                raise FileFormatError(_damaged(self.path))
            runs = file.execute("SELECT identity FROM run LIMIT 2").fetchall()
        self._require_same(runs, identity)
        return True

    def _require_same(self, runs: list[tuple[Any]], identity: Mapping[str, Any]) -> None:
        text = _text(runs[0][0]) if len(runs) == 1 else ""
        if text == _identity_text(identity):
            return
        try:
            hashes = json.loads(text)["hashes"]
            changed = [what for what, value in identity["hashes"].items() if hashes.get(what) != value]
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise FileFormatError(_damaged(self.path)) from error
        what = (
            f"the {' and the '.join(changed)} changed since"
            if changed
            else "other columns were asked for when"
        )
        raise InputError(
            f"{self.path} belongs to another run: {what} it was begun. Results of both together would "
            "mislead: put back what changed, or choose another output"
        )

    def _lock(self) -> None:
        """Lock out other processes, and set the write-ahead mode in which a kill cannot cut a commit."""
        for pragma in ("locking_mode = EXCLUSIVE", "journal_mode = WAL", "synchronous = NORMAL"):
            self._file.execute(f"PRAGMA {pragma}").fetchall()
        # In this mode the lock is taken only by the first write.
        self._file.execute("BEGIN EXCLUSIVE")
        self._file.execute("COMMIT")

    def _begin(self, identity: Mapping[str, Any]) -> None:
        with self._transaction():
            for sql in _TABLES:
                self._file.execute(sql)
            self._file.execute("INSERT INTO run VALUES (?)", (_identity_text(identity),))
            self._file.execute(f"PRAGMA application_id = {_APPLICATION}")
            self._file.execute(f"PRAGMA user_version = {_FORM}")

    def _find_rows(self, is_row: Callable[[int, str], bool]) -> None:
        """Find the rows that are there, and delete those with a wrong checksum or form: they are made again."""
        foreign = []
        for curve, line, crc in self._file.execute("SELECT curve, line, crc FROM row"):
            text = _text(line)
            if crc == zlib.crc32(text.encode()) and is_row(curve, text):
                self._there.add(curve)
            else:
                foreign.append((curve,))
        if foreign:
            with self._transaction():
                self._file.executemany("DELETE FROM row WHERE curve = ?", foreign)

    def _write(self, rows: Mapping[int, str]) -> None:
        with self._transaction():
            self._file.executemany(
                "INSERT OR REPLACE INTO row VALUES (?, ?, ?)",
                [(index, text, zlib.crc32(text.encode())) for index, text in rows.items()],
            )

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self._file.execute("BEGIN")
        try:
            yield
            self._file.execute("COMMIT")
        except BaseException:
            # SQLite has rolled back by itself where the disk is full.
            if self._file.in_transaction:
                self._file.execute("ROLLBACK")
            raise

    @contextmanager
    def _reported(self) -> Iterator[None]:
        """Convert errors of SQLite to errors of this library."""
        try:
            yield
        except sqlite3.Error as error:
            raise self._in_our_words(error) from error
        except UnicodeDecodeError as error:  # SQLite quotes the damaged bytes, which Python cannot decode
            raise FileFormatError(_damaged(self.path)) from error

    def _in_our_words(self, error: sqlite3.Error) -> UnderlayError:
        code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_ERROR) & 0xFF
        if code in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED):
            return InputError(f"another run is writing to {self.path}; wait for it, or end it")
        if code == sqlite3.SQLITE_NOTADB:
            return FileFormatError(f"{self.path} is not {self._what}; choose another output")
        if code in (
            sqlite3.SQLITE_FULL,
            sqlite3.SQLITE_IOERR,
            sqlite3.SQLITE_CANTOPEN,
            sqlite3.SQLITE_READONLY,
            sqlite3.SQLITE_PERM,
            sqlite3.SQLITE_AUTH,
        ):
            return FileAccessError(
                f"cannot write {self.path}: {error}; {self.done} {self._rows} are kept: make room and continue "
                "with resume (--resume)"
            )
        return FileFormatError(_damaged(self.path))


def _open(path: Path, mode: str) -> sqlite3.Connection:
    return _connected(f"{path.resolve().as_uri()}?mode={mode}")


def _connected(database: str) -> sqlite3.Connection:
    file = sqlite3.connect(database, uri=True, timeout=0.0, isolation_level=None)
    # Text is checked here, not by SQLite's decoder.
    file.text_factory = bytes
    file.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, _LONGEST)
    # Functions named in a foreign schema are not called, and a damaged page is noticed when it is read.
    file.execute("PRAGMA trusted_schema = OFF")
    file.execute("PRAGMA cell_size_check = ON")
    return file


def _require_regular(path: Path) -> None:
    """Raise FileAccessError where the journal or a companion file of SQLite is a link, pipe, device or folder."""
    for name in (f"{path.name}{end}" for end in _ENDINGS):
        companion = path.with_name(name)
        try:
            mode = companion.lstat().st_mode
        except FileNotFoundError:
            continue
        except OSError as error:
            raise FileAccessError(f"cannot open {companion}: {error.strerror or error}") from error
        if not stat.S_ISREG(mode):
            raise FileAccessError(f"cannot open {companion}: it is not a regular file; choose another output")


def _identity_text(identity: Mapping[str, Any]) -> str:
    return json.dumps(identity, sort_keys=True)


def _plain(text: str) -> str:
    """Text that UTF-8 can encode: undecodable bytes of file names become escapes."""
    return text.encode(errors="backslashreplace").decode()


def _text(value: object) -> str:
    """Text of a database cell; empty where it holds no bytes."""
    return value.decode(errors="replace") if isinstance(value, bytes) else ""


def _damaged(path: Path) -> str:
    return f"{path} is damaged and cannot be continued: move it away, or choose another output"


# --- a Markov chain -------------------------------------------------------------------------------------


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
        self._journal.append([(0, _packed(state)), (self.steps + 1, _packed(step))], anew=True)
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
                before = _chain_of(journal, (-1, walkers, len(names) + 1))
        yield ChainFile(journal), before


def _packed(numbers: FloatArray) -> str:
    return base64.b64encode(np.asarray(numbers, dtype="<f8").tobytes()).decode()


def _numbers(text: str) -> FloatArray:
    """The numbers of a row; none where it is no such text."""
    try:
        return np.frombuffer(base64.b64decode(text, validate=True), dtype="<f8")
    except (binascii.Error, ValueError):
        return np.empty(0)


def _chain_of(journal: Journal, shape: tuple[int, int, int]) -> Chain:
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
