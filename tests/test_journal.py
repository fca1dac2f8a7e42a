"""The record of a run: cut at any byte, changed in any line, written to by two."""

import pytest

from underlay.errors import FileFormatError, InputError
from underlay.inference.batch.journal import Journal

IDENTITY = {"hashes": {"scene": "aa", "manifest": "bb"}, "columns": ["name", "x"], "curves": 4}
ROWS = [(2, "c,3.0"), (0, 'ä,"1,5"'), (3, "d,"), (1, "b,2.0")]
IN_ORDER = [text for _, text in sorted(ROWS)]


def write(path, rows=ROWS):
    with Journal(path, IDENTITY, resume=False) as journal:
        for row in rows:
            journal.append([row])


def test_rows_come_back_in_the_order_of_the_curves(tmp_path):
    path = tmp_path / "j"
    with Journal(path, IDENTITY, resume=False) as journal:
        assert journal.append(ROWS[:3]) == 3
        assert journal.append([ROWS[1], ROWS[3]]) == 1
        assert list(journal.lines()) == IN_ORDER
    with Journal(path, IDENTITY, resume=True) as journal:
        assert journal.done == 4
        assert list(journal.lines()) == IN_ORDER


def test_cut_at_any_byte_it_goes_on(tmp_path):
    """Whole lines are kept, a cut one is written again, and the end is the same as without the cut."""
    path = tmp_path / "j"
    write(path)
    whole = path.read_bytes()
    ends = [i + 1 for i, byte in enumerate(whole) if byte == ord("\n")]
    for cut in range(len(whole) + 1):
        path.write_bytes(whole[:cut])
        with Journal(path, IDENTITY, resume=True) as journal:
            assert journal.done == sum(end <= cut for end in ends[1:])
            assert sum(journal.append([row]) for row in ROWS) == 4 - sum(end <= cut for end in ends[1:])
            assert list(journal.lines()) == IN_ORDER
        assert path.read_bytes() == whole


def test_a_changed_byte_costs_that_row_only(tmp_path):
    path = tmp_path / "j"
    write(path)
    whole = bytearray(path.read_bytes())
    header = whole.index(b"\n") + 1
    for position in range(header, len(whole)):
        if whole[position] == ord("\n"):
            continue
        damaged = bytearray(whole)
        damaged[position] ^= 0x01
        path.write_bytes(damaged)
        with Journal(path, IDENTITY, resume=True) as journal:
            # A bit that makes an end of line out of a digit spoils one line too.
            assert journal.done == 3
            journal.append(ROWS)
            assert list(journal.lines()) == IN_ORDER


def test_another_run_is_refused_and_named(tmp_path):
    path = tmp_path / "j"
    write(path)
    before = path.read_bytes()
    other = {**IDENTITY, "hashes": {"scene": "aa", "manifest": "cc"}}
    with pytest.raises(InputError, match="the manifest changed"):
        Journal(path, other, resume=True)
    with pytest.raises(InputError, match="holds a run already"):
        Journal(path, IDENTITY, resume=False)
    with pytest.raises(InputError, match="other columns"):
        Journal(path, {**IDENTITY, "columns": ["name"]}, resume=True)
    assert path.read_bytes() == before
    path.write_text("name,x\nsomething else\n", encoding="utf-8")
    with pytest.raises(FileFormatError):
        Journal(path, IDENTITY, resume=True)


def test_two_runs_into_one_output_are_refused(tmp_path):
    pytest.importorskip("fcntl")
    path = tmp_path / "j"
    with Journal(path, IDENTITY, resume=False), pytest.raises(InputError, match="another run"):
        Journal(path, IDENTITY, resume=True)
