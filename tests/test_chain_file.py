"""A chain on disk: complete at every moment, continued exactly, and never mistaken for another."""

import numpy as np
import pytest

import underlay as ul
from underlay.inference.sampling import chain_file
from underlay.inference.sampling.chain_file import open_chain

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
    path = tmp_path / "chain.h5"
    with open_chain(path, NAMES, (10, 6), resume=False) as (file, _):
        append(file, range(7))
    with open_chain(path, NAMES, (10, 6), resume=True) as (file, before):
        check(before, 7)
        append(file, range(7, 10))
    with open_chain(path, NAMES, (20, 6), resume=True) as (file, before):
        check(before, 10)
        append(file, range(10, 20))
    with open_chain(path, NAMES, (5, 6), resume=True) as (_, before):
        check(before, 20)
    assert [entry.name for entry in tmp_path.iterdir()] == ["chain.h5"]


@pytest.mark.parametrize("written", ["chain", "state", None])
def test_a_death_between_any_two_writes_loses_no_step(tmp_path, written):
    path = tmp_path / "chain.h5"
    with open_chain(path, NAMES, (10, 6), resume=False) as (file, _):
        append(file, range(4))
        # The next step dies: its data may be there in part, its counter is not.
        if written is not None:
            file._chain[4] = 99.0
        if written == "state":
            file._state[(4 + 1) % 2] = 99.0
    with open_chain(path, NAMES, (10, 6), resume=True) as (file, before):
        check(before, 4)
        append(file, range(4, 6))
    with open_chain(path, NAMES, (10, 6), resume=True) as (_, before):
        check(before, 6)


def test_steps_do_not_change_the_size_of_the_file(tmp_path):
    path = tmp_path / "chain.h5"
    with open_chain(path, NAMES, (10, 6), resume=False) as (file, _):
        before = path.stat().st_size
        append(file, range(10))
        assert path.stat().st_size == before


def test_an_existing_file_is_not_overwritten(tmp_path):
    path = tmp_path / "chain.h5"
    path.write_text("notes")
    with (
        pytest.raises(ul.InputError, match=r"continue it \(resume\)"),
        open_chain(path, NAMES, (10, 6), resume=False),
    ):
        pass
    assert path.read_text() == "notes"


@pytest.mark.parametrize(
    ("names", "walkers", "message"),
    [
        (("layer.E",), 6, r"of another problem: its parameters are layer\.E, layer\.thickness"),
        (NAMES, 8, "holds 6 walkers and 8 are asked for"),
    ],
)
def test_the_chain_of_another_problem_is_refused(tmp_path, names, walkers, message):
    path = tmp_path / "chain.h5"
    with open_chain(path, NAMES, (10, 6), resume=False) as (file, _):
        append(file, range(3))
    with pytest.raises(ul.InputError, match=message), open_chain(path, names, (10, walkers), resume=True):
        pass


def test_other_files_are_no_chains(tmp_path):
    text, table = tmp_path / "a.txt", tmp_path / "b.h5"
    text.write_text("depth force")
    with (
        pytest.raises(ul.InputError, match="is not a chain file"),
        open_chain(text, NAMES, (10, 6), resume=True),
    ):
        pass
    with chain_file.h5py.File(table, "w") as file:
        file["x"] = 1.0
    with (
        pytest.raises(ul.InputError, match="of this version"),
        open_chain(table, NAMES, (10, 6), resume=True),
    ):
        pass
    with (
        pytest.raises(ul.FileAccessError, match="is a directory"),
        open_chain(tmp_path, NAMES, (10, 6), resume=True),
    ):
        pass


def test_without_the_extra_the_error_names_it(tmp_path, monkeypatch):
    monkeypatch.setattr(chain_file, "h5py", None)
    path = tmp_path / "chain.h5"
    with (
        pytest.raises(ul.MissingExtraError, match=r"pip install '\.\[uq\]'"),
        open_chain(path, NAMES, (10, 6), resume=False),
    ):
        pass
