"""A map of JPK is read curve by curve: the same curves, whatever the size of the file."""

import io
import pickle
import struct
import zipfile

import numpy as np
import pandas as pd
import pytest

import underlay as ul
from support import afm_files
from support.maps import numbers
from underlay.data.readers import _source, curves_of_jpk_map, read_from_map

COUNT = 12
SCENE = ul.Scene(
    ul.Paraboloid(1e-5),
    ul.Layer(ul.Isotropic(1e3, 0.5), 1e-4),
    ul.RIGID,
    instrument=ul.Instrument(contact_depth=-4e-6),
)
FREE = {
    "layer.E": (1.0, 1e6),
    "instrument.contact_depth": (-5e-6, -3e-6),
    "instrument.baseline": (-1e-8, 1e-8),
}


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "gel.jpk-force-map"
    path.write_bytes(afm_files.jpk_map(COUNT))
    return path


def test_a_curve_of_a_map_is_that_of_the_whole_file(path):
    whole = ul.read_all(path)
    places = curves_of_jpk_map(path)
    assert len(whole) == len(places) == COUNT
    for expected, place in zip(whole, places, strict=True):
        curve = read_from_map(place)
        for column in ("depth", "force", "time", "segment"):
            np.testing.assert_array_equal(getattr(curve, column), getattr(expected, column))
        for key in ("name", "test", "path", "sha256", "position", "format", "spring_constant"):
            assert curve.metadata.get(key) == expected.metadata.get(key), key
    # Tenth after ninth, not after first.
    assert whole[9].force.max() > whole[8].force.max()
    np.testing.assert_array_equal(ul.read(path, test=7).force, whole[6].force)


def test_a_map_packed_again_without_its_folders_reads(path, tmp_path):
    again = tmp_path / "again.jpk-force-map"
    with zipfile.ZipFile(path) as before, zipfile.ZipFile(again, "w") as after:
        for name in before.namelist():
            if not name.endswith("/"):
                after.writestr(name, before.read(name))
    for place, expected in zip(curves_of_jpk_map(again), ul.read_all(path), strict=True):
        np.testing.assert_array_equal(read_from_map(place).force, expected.force)
    assert len(ul.read_all(again)) == COUNT


def test_what_a_curve_costs_does_not_grow_with_the_map(path, tmp_path):
    double = tmp_path / "double.jpk-force-map"
    double.write_bytes(afm_files.jpk_map(2 * COUNT))
    few, many = curves_of_jpk_map(path), curves_of_jpk_map(double)
    assert len(many) == 2 * COUNT
    assert len(many[3].source().data) == len(few[3].source().data)
    assert len(pickle.dumps(many[3])) < 4000


def test_a_map_larger_than_what_is_read_of_a_file_is_fitted(path, monkeypatch):
    small = ul.fit_many(ul.read_all(path), SCENE, FREE, workers=0)
    assert (small["status"] == "fitted").sum() == COUNT
    monkeypatch.setattr(_source, "MAX_BYTES", path.stat().st_size - 1)
    with pytest.raises(ul.FileFormatError, match="are read"):
        ul.read_all(path)
    table = ul.fit_many(path, SCENE, FREE, workers=0)
    assert list(table["name"]) == [f"{path.name}#{number}" for number in range(1, COUNT + 1)]
    # Of curves in memory all segments are fitted, of a file the loading part.
    loading = [curve.loading() for curve in curves_in(path, monkeypatch)]
    same = ul.fit_many(loading, SCENE, FREE, workers=0)
    columns = [*FREE, "rms", "sha256", "x", "y"]
    pd.testing.assert_frame_equal(numbers(table)[columns], numbers(same)[columns], check_exact=True)


def curves_in(path, monkeypatch):
    monkeypatch.undo()
    return ul.read_all(path)


def test_a_changed_map_is_not_mixed_in(path, tmp_path):
    ul.fit_many(path, SCENE, FREE, workers=0, output=tmp_path / "out")
    again = {"workers": 0, "output": tmp_path / "out", "options": ul.MapOptions(resume=True)}
    assert len(ul.fit_many(path, SCENE, FREE, **again)) == COUNT
    path.write_bytes(afm_files.jpk_map(COUNT) + b"\0")
    with pytest.raises(ul.InputError, match="the curves changed"):
        ul.fit_many(path, SCENE, FREE, **again)


def test_a_damaged_member_costs_its_curve_only(path):
    content = bytearray(path.read_bytes())
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        offset = archive.getinfo("index/4/segments/0/channels/vDeflection.dat").header_offset
        wide = archive.getinfo("index/6/header.properties").header_offset
    content[offset + 100] ^= 0xFF
    content[wide : wide + 4] = b"none"
    path.write_bytes(content)
    table = ul.fit_many(path, SCENE, FREE, workers=0)
    assert list(table.index[table["status"] == "failed"]) == [4, 6]
    assert table.loc[4, "reason"].endswith("damaged")


def test_claims_are_not_believed(path):
    content = bytearray(path.read_bytes())
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        names = archive.namelist()
    # The size that the directory claims for a member of the third curve: four gigabytes.
    entry = content.rindex(b"index/2/segments/0/channels/height.dat") - 46
    assert content[entry : entry + 4] == b"PK\x01\x02"
    content[entry + 24 : entry + 28] = struct.pack("<I", 0xFFFFFFF0)
    path.write_bytes(content)
    assert len(names) > COUNT
    with pytest.raises(ul.FileFormatError, match="claims"):
        ul.read(path, test=3)
    assert len(ul.read(path, test=2)) > 0


def test_what_is_no_map_is_left_to_the_readers(tmp_path):
    single = tmp_path / "single.jpk-force"
    single.write_bytes(afm_files.jpk())
    assert curves_of_jpk_map(single) == []
    for content in (b"", b"PK\x03\x04", b"PK\x03\x04" + b"x" * 100, b"depth,force\n1,2\n"):
        single.write_bytes(content)
        assert curves_of_jpk_map(single) == []
    with pytest.raises(ul.FileAccessError):
        curves_of_jpk_map(tmp_path / "nowhere")
    single.write_bytes(afm_files.jpk_map(COUNT))
    with pytest.raises(ul.InputError, match="holds 12 tests"):
        ul.read(single, test=13)
