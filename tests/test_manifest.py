"""Per-curve values: read with units, checked row by row, matched to the curves one to one."""

import pandas as pd
import pytest

import underlay as ul
from underlay.inference.batch.manifest import read_manifest

SCENE = ul.Scene(ul.Paraboloid(5e-4), ul.Layer(ul.Isotropic(1e6, 0.45), 1.5e-3), ul.RIGID)


def manifest(tmp_path, text):
    path = tmp_path / "manifest.csv"
    path.write_text(text, encoding="utf-8")
    return read_manifest(path, SCENE)


def test_units_in_header_or_cell(tmp_path):
    read = manifest(
        tmp_path,
        "file,name,thickness (mm),indenter.radius,layer.nu,x (um),y\na.csv,first,1.2,0.4 mm,0.4,5,2 mm\n",
    )
    (entry,) = read.for_curves(["a.csv"])
    assert (entry.name, entry.x, entry.y) == ("first", 5e-6, 2e-3)
    assert entry.values == {"layer.thickness": 1.2e-3, "indenter.radius": 4e-4, "layer.nu": 0.4}
    assert read.paths == ("layer.thickness", "indenter.radius", "layer.nu")


@pytest.mark.parametrize("separator", [";", "\t"])
def test_other_separators_and_a_byte_order_mark(tmp_path, separator):
    path = tmp_path / "manifest.csv"
    path.write_bytes(f"\ufefffile{separator}thickness (mm)\na{separator}2\n".encode())
    (entry,) = read_manifest(path, SCENE).for_curves(["a"])
    assert entry.values == {"layer.thickness": 2e-3}


def test_a_sharp_inside_a_row_is_no_comment(tmp_path):
    read = manifest(tmp_path, "# of today\nfile,thickness (mm)\nsite #3.csv,2\n")
    (entry,) = read.for_curves(["site #3.csv"])
    assert entry.values == {"layer.thickness": 2e-3}


def test_a_table_in_memory_is_si():
    read = read_manifest(pd.DataFrame({"file": ["a"], "layer.thickness": [2e-3], "x": [float("nan")]}), SCENE)
    (entry,) = read.for_curves(["a"])
    assert entry.values == {"layer.thickness": 2e-3}
    assert entry.x is None


def test_rows_go_with_their_curves_in_any_order(tmp_path):
    read = manifest(tmp_path, "file,thickness (mm)\nb.csv,2\ndata/a.csv,1\n")
    assert [entry.file for entry in read.for_curves(["data/a.csv", "b.csv"])] == ["data/a.csv", "b.csv"]
    read = manifest(tmp_path, "file,thickness (mm)\nb.csv,2\n./a.csv,1\n")
    assert [entry.values["layer.thickness"] for entry in read.for_curves(["a.csv", "b.csv"])] == [1e-3, 2e-3]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name,thickness (mm)\na,1\n", "no column 'file'"),
        ("file,thickness (mm)\n", "no rows"),
        ("file,thickness (mm)\na,1\na,2\n", "line 3.*'a' has a row already"),
        ("file,name\na,n\nb,n\n", "the name 'n' is taken"),
        ("file,thickness\na,1\n", "has no unit"),
        ("file,thickness (kPa)\na,1\n", "line 2, column layer.thickness.*pressure"),
        ("file,thickness (mm)\na,thick\n", "line 2"),
        ("file,thickness (mm)\na,-1\n", r"line 2 \(a\).*positive"),
        ("file,thickness (mm)\na,\n", "no layer.thickness"),
        ("file,layer.nu\na,0.7\n", r"line 2 \(a\).*nu"),
        ("file,thicknes (mm)\na,1\n", "did you mean 'thickness'"),
        ("file,layer.thicknes (mm)\na,1\n", "did you mean 'layer.thickness'"),
        ("file,zzzz (mm)\na,1\n", r"unknown column 'zzzz \(mm\)'\. Known are"),
        ("file,thickness (mm),layer.thickness (mm)\na,1,1\n", "two columns"),
        ("file,thickness (mm)\n,1\n", "no file"),
        ("file,thickness (mm)\na,1,2,3\nb,2\n", "more cells than there are names"),
        (
            "file,thickness (mm)\n" + "," * 140_000,
            "line 2 has more cells than there are names: 140001 under 2",
        ),
        ("file" + ",x" * 140_000, "more cells than the 1000 allowed"),
        # One row over many lines: what is counted by line does not see it.
        ("file,thickness (mm)\na" + ',"\n"' * 40_000, "more cells than there are names"),
        ("# a\n\nfile,thickness (mm)\n# b\na,-1\n", r"line 5 \(a\)"),
    ],
)
def test_bad_manifests_say_where(tmp_path, text, message):
    with pytest.raises(ul.InputError, match=message):
        manifest(tmp_path, text)


def test_files_that_are_no_manifest(tmp_path):
    with pytest.raises(ul.FileAccessError):
        read_manifest(tmp_path / "none.csv", SCENE)
    path = tmp_path / "binary.csv"
    path.write_bytes(bytes(range(256)))
    with pytest.raises(ul.FileFormatError):
        read_manifest(path, SCENE)
    with pytest.raises(ul.InputError):
        manifest(tmp_path, "")
