"""An HDF5 file of many curves is read curve by curve: the same curves, whatever the size of the file."""

import io
import pickle

import h5py
import numpy as np
import pandas as pd
import pytest

import underlay as ul
from support import afm_files
from support.maps import FREE, SCENE, numbers
from underlay import _door
from underlay.data.export import write_curves
from underlay.data.readers import KeptOpen, _hdf5, _source, curves_of_map, kept_open, read_from_map
from underlay.data.readers._hdf5 import Checked

COUNT = 12


def own(path):
    """Curves that underlay wrote, named, of made tests."""
    depth = np.linspace(-2e-5, 8e-5, 60)
    curves = [
        ul.synthesize(SCENE, depth, ul.Noise(force=1e-6), rng=seed).with_metadata(name=f"site {seed}")
        for seed in range(COUNT)
    ]
    write_curves(curves, path)


def exported(path):
    """Curves that afmformats wrote."""
    path.write_bytes(afm_files.hdf5(COUNT))


@pytest.fixture(params=[own, exported])
def path(request, tmp_path):
    path = tmp_path / "gel.h5"
    request.param(path)
    return path


def test_a_curve_read_alone_is_that_of_the_whole_file(path):
    whole, places = ul.read_all(path), curves_of_map(path)
    assert len(whole) == len(places) == COUNT
    for expected, place in zip(whole, places, strict=True):
        curve = read_from_map(place)
        for column in ("depth", "force", "segment"):
            np.testing.assert_array_equal(getattr(curve, column), getattr(expected, column))
        for key in ("name", "test", "path", "sha256", "format", "spring_constant"):
            assert curve.metadata.get(key) == expected.metadata.get(key), key
    np.testing.assert_array_equal(ul.read(path, test=COUNT).force, whole[-1].force)


def test_what_a_worker_is_told_does_not_grow_with_the_file(path):
    for place in curves_of_map(path):
        assert len(pickle.dumps(place)) < 1000
        assert len(place.source().data) < 100


def test_a_file_larger_than_what_is_read_at_once_is_fitted(tmp_path, monkeypatch):
    path = tmp_path / "gel.h5"
    own(path)
    same = ul.fit_many(ul.read_all(path), SCENE, FREE, workers=0)
    assert (same["status"] == "fitted").all()
    for module in (_source, _hdf5):
        monkeypatch.setattr(module, "MAX_BYTES", 60 * 8 * 2 * (COUNT - 1))
    with pytest.raises(ul.FileFormatError, match="claims more"):
        ul.read_all(path)
    table = ul.fit_many(path, SCENE, FREE, workers=0)
    assert list(table["name"]) == [f"gel.h5#{number}" for number in range(1, COUNT + 1)]
    columns = [*FREE, "rms"]
    pd.testing.assert_frame_equal(numbers(table)[columns], numbers(same)[columns], check_exact=True)


def test_a_group_that_leads_out_of_the_file_costs_its_curve_only(path):
    other = path.with_name("other.h5")
    exported(other)
    with h5py.File(path, "r+") as file:
        del file["3"]["force"]
        file["3"]["force"] = h5py.ExternalLink(str(other), "0/force")
        del file["5"]
        file["5"] = h5py.SoftLink("/4")
    places = {place.group: place for place in curves_of_map(path)}
    assert len(places) == COUNT
    for group in ("3", "5"):
        with pytest.raises(ul.FileFormatError, match="links are not followed"):
            read_from_map(places[group])
    assert len(read_from_map(places["4"])) > 0


def test_what_is_no_such_file_is_left_to_the_readers(tmp_path):
    path = tmp_path / "odd.h5"
    for content in (b"\x89HDF\r\n\x1a\n", b"\x89HDF\r\n\x1a\n" + b"x" * 2000, b"depth,force\n1,2\n"):
        path.write_bytes(content)
        assert len(curves_of_map(path)) == 0


def test_a_file_is_opened_once_for_the_curves_that_follow_each_other(path, monkeypatch):
    times = []
    monkeypatch.setattr(_hdf5, "opened", lambda file: times.append(file) or _door.opened(file))
    places = list(curves_of_map(path))
    times.clear()
    one_by_one = [read_from_map(place) for place in places]
    assert len(times) == len(one_by_one)
    times.clear()
    with KeptOpen() as kept:
        together = [read_from_map(kept_open(place, kept)) for place in places]
    assert len(times) == 1
    for alone, one in zip(one_by_one, together, strict=True):
        assert alone.metadata == one.metadata
        np.testing.assert_array_equal(alone.force, one.force)


def test_a_damaged_group_closes_the_file_and_costs_the_next_curve_nothing(path):
    with h5py.File(path, "r+") as file:
        del file["1"]
        file["1"] = h5py.SoftLink("/2")
    first, damaged, last = curves_of_map(path)[:3]
    with KeptOpen() as kept:
        read_from_map(kept_open(first, kept))
        with pytest.raises(ul.FileFormatError, match="links"):
            read_from_map(kept_open(damaged, kept))
        np.testing.assert_array_equal(read_from_map(kept_open(last, kept)).force, read_from_map(last).force)


@pytest.mark.parametrize(
    "said",
    [1.5, np.uint8(3), np.float32(2.0), True, 1 + 2j, "é", "", np.bytes_("fixed"), [1, 2], ["x", "y"], [1.5]],
    ids=repr,
)
def test_what_is_said_of_a_group_is_read_as_the_library_reads_it(said):
    with h5py.File(io.BytesIO(), "w") as file:
        file.attrs["said"] = said
        told = Checked(h5py, "a file", file, [0]).said()["said"]
        assert type(told) is type(file.attrs["said"])
        np.testing.assert_array_equal(told, file.attrs["said"])


def test_types_that_numpy_takes_for_one_another_are_read_as_what_they_are():
    """Names of numbers and plain numbers are the same to numpy, and so are words and lists."""
    with h5py.File(io.BytesIO(), "w") as file:
        file.create_dataset("named", data=[0, 1], dtype=h5py.enum_dtype({"in": 0, "out": 1}, basetype="i1"))
        file.create_dataset("plain", data=np.array([0, 1], dtype="i1"))
        file.create_dataset("swapped", data=np.array([0, 1], dtype=">i2"))
        file.create_dataset("chunked", data=np.array([0, 1], dtype="i1"), chunks=True, compression="gzip")
        file.attrs["word"], file.attrs["number"], file.attrs["list"] = "é", np.int8(3), [1.0, 2.0]
        group = Checked(h5py, "file", file, [0])
        for _ in range(2):
            for name in ("named", "plain", "swapped", "chunked", "named"):
                assert group[name].tolist() == [0, 1]
            said = group.said()
            assert (said["word"], said["number"], list(said["list"])) == ("é", 3, [1.0, 2.0])
