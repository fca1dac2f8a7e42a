"""The record of a run: killed at any moment, changed in any byte, made by another, written to by two."""

import os
import shutil
import sqlite3
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import underlay as ul
from underlay.inference.journal import Journal

IDENTITY = {"hashes": {"scene": "aa", "manifest": "bb"}, "columns": ["name", "x"], "curves": 4}
ROWS = [(2, "c,3.0"), (0, 'ä,"1,5"'), (3, "d,"), (1, "b,2.0")]
IN_ORDER = [text for _, text in sorted(ROWS)]


def is_row(number, text):
    return 0 <= number < 4 and text.count(",") in (1, 2)


def journal(path, *, resume=True, identity=IDENTITY):
    return Journal(path, identity, is_row, resume=resume)


@pytest.fixture
def path(tmp_path):
    """A journal of all four rows."""
    path = tmp_path / "j"
    with journal(path, resume=False) as file:
        for row in ROWS:
            file.append([row])
    return path


def change(path, *statements):
    with sqlite3.connect(path) as file:
        for statement in statements:
            file.execute(statement)
    file.close()


def test_rows_come_back_in_the_order_of_the_curves(tmp_path):
    path = tmp_path / "j"
    # In memory (None) as in a file.
    for where in (None, path):
        with journal(where, resume=False) as file:
            assert file.append(ROWS[:3]) == 3
            assert [file.has(index) for index in range(4)] == [True, False, True, True]
            assert file.append([ROWS[1], ROWS[3]]) == 1
            assert list(file.lines()) == IN_ORDER
    with journal(path) as file:
        assert file.done == 4
        assert list(file.lines()) == IN_ORDER


KILLED = """
import os, sys
from pathlib import Path
from test_journal import ROWS, journal
with journal(Path(sys.argv[1]), resume=False) as file:
    for row in ROWS[:3]:
        file.append([row])
    os.kill(os.getpid(), 9)
"""


def test_cut_at_any_byte_it_goes_on(tmp_path):
    """What a killed process leaves, cut anywhere: whole rows are kept, the others are written again."""
    path = tmp_path / "left"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])}
    subprocess.run([sys.executable, "-c", KILLED, path], env=environment, check=False)
    log = (tmp_path / "left-wal").read_bytes()
    kept = []
    for cut in [*range(0, len(log), 499), len(log)]:
        copy = tmp_path / f"cut-{cut}"
        shutil.copy(path, copy)
        copy.with_name(f"{copy.name}-wal").write_bytes(log[:cut])
        with journal(copy) as file:
            kept.append(file.done)
            assert file.append(ROWS) == 4 - kept[-1]
            assert list(file.lines()) == IN_ORDER
    assert kept == sorted(kept)
    assert set(kept) == {0, 1, 2, 3}


def test_a_changed_bit_costs_its_row_or_is_one_error(path):
    """Nothing but the rows that were written ever comes back."""
    whole = path.read_bytes()
    rng = np.random.default_rng(1)
    lost = refused = 0
    where = [whole.index(b"c,3.0"), *rng.integers(0, len(whole), 300)]
    for position in where:
        damaged = bytearray(whole)
        damaged[position] ^= 1 << int(rng.integers(8))
        path.write_bytes(damaged)
        for end in ("-wal", "-shm"):
            path.with_name(path.name + end).unlink(missing_ok=True)
        try:
            with journal(path) as file:
                lost += file.done < 4
                assert set(file.lines()) <= set(IN_ORDER)
                file.append(ROWS)
                assert list(file.lines()) == IN_ORDER
        except ul.UnderlayError:
            refused += 1
    assert lost
    assert refused


@pytest.mark.parametrize(
    "statement",
    [
        "CREATE TRIGGER t AFTER INSERT ON row BEGIN DELETE FROM row; END",
        "CREATE VIEW v AS SELECT load_extension('x')",
        "CREATE TABLE more (a)",
        "PRAGMA user_version = 7",
        "PRAGMA application_id = 7",
        "DROP TABLE run",
    ],
)
def test_what_is_more_or_less_than_a_journal_is_refused(path, statement):
    change(path, statement)
    before = path.read_bytes()
    with pytest.raises(ul.FileFormatError, match="not the journal of a map"):
        journal(path)
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE row SET line = 'no row', crc = 0 WHERE curve = 2",
        "UPDATE row SET line = x'ff00', crc = 'x' WHERE curve = 2",
        "UPDATE row SET curve = 99 WHERE curve = 2",
        "UPDATE row SET curve = -1 WHERE curve = 2",
        "UPDATE row SET line = 'c,4.0' WHERE curve = 2",
    ],
)
def test_a_row_that_is_none_is_fitted_again(path, statement):
    change(path, statement)
    with journal(path) as file:
        assert file.done == 3
        file.append(ROWS)
        assert list(file.lines()) == IN_ORDER


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE run SET identity = '[[['",
        "UPDATE run SET identity = '7'",
        "UPDATE run SET identity = x'ff'",
        "UPDATE run SET identity = zeroblob(2000000)",
        "UPDATE row SET line = zeroblob(2000000) WHERE curve = 2",
        "INSERT INTO run VALUES ('{}')",
        "DELETE FROM run",
    ],
)
def test_a_journal_of_nonsense_is_one_error(path, statement):
    change(path, statement)
    with pytest.raises(ul.FileFormatError, match="damaged and cannot be continued"):
        journal(path)


def test_damage_that_sqlite_quotes_is_one_error(path):
    """Its message holds the bytes of the schema, which need not be text."""
    data = path.read_bytes()
    place = data.index(b"PRIMARY KEY")
    path.write_bytes(data[: place + 9] + b"\xfe" + data[place + 10 :])
    with pytest.raises(ul.FileFormatError, match="damaged"):
        journal(path)


def test_another_run_is_refused_and_named(path):
    before = path.read_bytes()
    other = {**IDENTITY, "hashes": {"scene": "aa", "manifest": "cc"}}
    with pytest.raises(ul.InputError, match="the manifest changed"):
        journal(path, identity=other)
    with pytest.raises(ul.InputError, match="holds a run already"):
        journal(path, resume=False)
    with pytest.raises(ul.InputError, match="other columns"):
        journal(path, identity={**IDENTITY, "columns": ["name"]})
    assert path.read_bytes() == before
    path.write_text("name,x\nsomething else\n" * 100, encoding="utf-8")
    with pytest.raises(ul.FileFormatError, match="not the journal"):
        journal(path)


def test_two_runs_into_one_output_are_refused(tmp_path):
    path = tmp_path / "j"
    with journal(path, resume=False), pytest.raises(ul.InputError, match="another run"):
        journal(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with a name on this system")
@pytest.mark.parametrize("end", ["", "-wal"])
def test_a_pipe_in_the_place_of_the_file_is_refused(tmp_path, end):
    os.mkfifo(tmp_path / f"j{end}")
    with pytest.raises(ul.FileAccessError, match="not a regular file"):
        journal(tmp_path / "j")


def test_what_cannot_be_written_is_one_error(tmp_path):
    with pytest.raises(ul.FileAccessError, match="cannot write"):
        journal(tmp_path / "nowhere" / "j")
