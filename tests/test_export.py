"""Curves to files and back, bit for bit, whole or not at all; and files that are not to be trusted."""

import json

import numpy as np
import pytest

import underlay as ul
from support import afm_files
from support import instrument_files as files
from underlay.data.export import METADATA_MARK, write_curves, write_json


@pytest.fixture
def curve(tmp_path):
    path = tmp_path / "jpk.bin"
    path.write_bytes(afm_files.jpk(("extend", "pause", "retract")))
    return ul.read(path).with_truth({"layer.E": 1234.5})


@pytest.mark.parametrize("ending", ["csv", "json", "h5", "hdf5"])
def test_what_is_written_is_read_back_bit_for_bit(ending, curve, tmp_path):
    again = ul.read(write_curves(curve, tmp_path / f"out.{ending}"))
    for column in ("depth", "force", "time", "segment"):
        np.testing.assert_array_equal(getattr(again, column), getattr(curve, column))
    assert again.truth["layer.E"] == 1234.5
    for key in ("name", "spring_constant", "position", "header"):
        assert again.metadata[key] == curve.metadata[key]
    # Where the file came from, and where its content came from, are two things.
    assert again.metadata["origin"]["sha256"] == curve.metadata["sha256"]
    assert again.metadata["sha256"] != curve.metadata["sha256"]


@pytest.mark.parametrize("ending", ["json", "h5"])
def test_many_curves_in_one_file(ending, tmp_path):
    path = tmp_path / "m.txt"
    path.write_bytes(files.mach1(12))
    curves = ul.read_all(path)
    again = ul.read_all(write_curves(curves, tmp_path / f"all.{ending}"))
    assert [one.metadata["block"] for one in again] == [one.metadata["block"] for one in curves]


@pytest.mark.parametrize("ending", ["csv", "json", "h5"])
def test_a_bare_curve(ending, tmp_path):
    bare = ul.Curve([0.0, 1e-300, 0.1 + 0.2], [1.0, -2.0, 3e5])
    again = ul.read(write_curves(bare, tmp_path / f"bare.{ending}"))
    np.testing.assert_array_equal(again.depth, bare.depth)
    assert again.time is None
    assert again.segment is None
    assert again.truth is None


def test_a_written_table_has_its_units_in_the_header(curve, tmp_path):
    lines = write_curves(curve, tmp_path / "out.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0].startswith(f"# {METADATA_MARK}")
    assert lines[1] == "depth (m),force (N),time (s),segment"


def test_refusals_leave_the_old_file_as_it_was(curve, tmp_path):
    old = tmp_path / "out.csv"
    old.write_text("precious")
    with pytest.raises(ul.InputError, match="a CSV holds one curve, not 2"):
        write_curves([curve, curve], old)
    with pytest.raises(ul.InputError, match=r"end it in \.csv, \.json"):
        write_curves(curve, tmp_path / "out.xyz")
    with pytest.raises(ul.InputError, match="no curve to write"):
        write_curves([], old)
    with pytest.raises(ul.FileAccessError, match="cannot write"):
        write_curves(curve, tmp_path / "nowhere" / "out.csv")
    assert old.read_text() == "precious"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["jpk.bin", "out.csv"]


def test_records_of_results(tmp_path):
    path = write_json(
        {"E": {"value": 1.5e6, "stderr": float("nan"), "unit": "Pa"}, "notes": ("a", "b")},
        tmp_path / "r.json",
    )
    assert json.loads(path.read_text()) == {
        "E": {"value": 1.5e6, "stderr": None, "unit": "Pa"},
        "notes": ["a", "b"],
    }


@pytest.mark.parametrize(
    "about",
    [
        {"metadata": {"source": 1, "depth": 2, "self": 3, "values": 4, "notes": 5, "name": [], "units": 7}},
        {"metadata": {"indenter_radius": "large", "search_criterion": [], "spring_constant": True}},
        {"metadata": 3, "truth": 4},
        [1, 2, 3],
        "text",
    ],
)
def test_metadata_of_a_file_are_not_trusted(about, tmp_path):
    text = f"# {METADATA_MARK} {json.dumps(about)}\ndepth (m),force (N)\n1,2\n3,4\n"
    path = tmp_path / "x.csv"
    path.write_text(text)
    metadata = ul.read(path).metadata
    assert isinstance(metadata["name"], str)
    assert isinstance(metadata["notes"], tuple)
    for number in ("indenter_radius", "search_criterion", "spring_constant"):
        assert isinstance(metadata.get(number, 0.0), float)


@pytest.mark.parametrize(
    "content",
    [
        '{"format": "underlay-curves", "curves": 3}',
        '{"format": "underlay-curves", "curves": [3]}',
        '{"format": "underlay-curves", "curves": [{"depth": [1, 2]}]}',
        '{"format": "underlay-curves", "curves": [{"depth": ["a"], "force": [1]}]}',
        '{"format": "underlay-curves", "curves": [{"depth": [[1]], "force": [[1]]}]}',
        '{"format": "underlay-curves", "curves": [{"depth": [1], "force": [1], "segment": ["up"]}]}',
        '{"format": "underlay-curves", "curves": [{"depth": [1e999], "force": [1]}]}',
        '{"format": "underlay-curves", "curves": ' + "[" * 100_000,
        '{"format": "underlay-curves", "curves": []}',
    ],
)
def test_json_that_is_not_ours_after_all(content, tmp_path):
    path = tmp_path / "x.json"
    path.write_text(content)
    with pytest.raises(ul.UnderlayError):
        ul.read_all(path)


@pytest.mark.parametrize("ending", [".csv", ".json", ".h5"])
def test_further_columns_come_back(ending, tmp_path):
    made = ul.Curve([0.0, 1e-6, 2e-6], [0.0, 1e-3, 3e-3], columns={"force_scatter": [1e-4, np.nan, 2e-4]})
    again = ul.read(write_curves(made, tmp_path / f"curve{ending}"))
    np.testing.assert_array_equal(again.columns["force_scatter"], [1e-4, np.nan, 2e-4])
