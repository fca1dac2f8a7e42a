"""A chain on disk: complete at every moment, continued exactly, and never mistaken for another."""

import numpy as np
import pytest

import underlay as ul
from underlay.inference.journal import open_chain

NAMES = ("layer.E", "layer.thickness")
RNG = np.random.default_rng(0)
COORDS = RNG.normal(size=(20, 6, 2))
DENSITY = RNG.normal(size=(20, 6))


def random_state(step):
    return np.random.RandomState(step).get_state()


def append(file, steps):
    for step in steps:
        file.append(COORDS[step], DENSITY[step], random_state(step), (10 * step, step))


def check(before, steps):
    np.testing.assert_array_equal(before.steps[..., :-1], COORDS[:steps])
    np.testing.assert_array_equal(before.steps[..., -1], DENSITY[:steps])
    last = steps - 1
    assert (before.evaluations, before.failures) == (10 * last, last)
    restored = np.random.RandomState()
    restored.set_state(before.random_state)
    np.testing.assert_array_equal(restored.rand(5), np.random.RandomState(last).rand(5))


def test_a_chain_goes_on_where_it_stopped_and_may_grow(tmp_path):
    path = tmp_path / "a.chain"
    with open_chain(path, NAMES, 6, resume=False) as (file, _):
        append(file, range(7))
    with open_chain(path, NAMES, 6, resume=True) as (file, before):
        check(before, 7)
        append(file, range(7, 10))
    with open_chain(path, NAMES, 6, resume=True) as (file, before):
        check(before, 10)
        append(file, range(10, 20))
    with open_chain(path, NAMES, 6, resume=True) as (_, before):
        check(before, 20)


def test_a_step_that_was_written_in_part_is_none(tmp_path):
    """State and step come together: of a process that dies between the two neither is there."""
    path = tmp_path / "a.chain"
    with open_chain(path, NAMES, 6, resume=False) as (file, _):
        append(file, range(4))
        database = file._journal._file
        database.execute("BEGIN")
        database.execute("INSERT OR REPLACE INTO row SELECT 0, line, crc FROM row WHERE curve = 1")
    with open_chain(path, NAMES, 6, resume=True) as (file, before):
        check(before, 4)
        append(file, range(4, 6))
    with open_chain(path, NAMES, 6, resume=True) as (_, before):
        check(before, 6)


def test_an_existing_file_is_not_overwritten(tmp_path):
    path = tmp_path / "a.chain"
    path.write_text("notes")
    with (
        pytest.raises(ul.InputError, match="continue it with resume"),
        open_chain(path, NAMES, 6, resume=False),
    ):
        pass
    assert path.read_text() == "notes"


@pytest.mark.parametrize(
    ("names", "walkers", "message"),
    [
        (("layer.E",), 6, "the free parameters changed since"),
        (NAMES, 8, "the number of walkers changed since"),
    ],
)
def test_the_chain_of_another_problem_is_refused(tmp_path, names, walkers, message):
    path = tmp_path / "a.chain"
    with open_chain(path, NAMES, 6, resume=False) as (file, _):
        append(file, range(3))
    with pytest.raises(ul.InputError, match=message), open_chain(path, names, walkers, resume=True):
        pass


def test_other_files_are_no_chains(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("depth force")
    with (
        pytest.raises(ul.FileFormatError, match="is not a chain file"),
        open_chain(path, NAMES, 6, resume=True),
    ):
        pass
    with (
        pytest.raises(ul.FileAccessError, match="not a regular file"),
        open_chain(tmp_path, NAMES, 6, resume=True),
    ):
        pass
