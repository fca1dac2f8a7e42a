"""Tables as people save, pack and code them: read right, or refused with what to do, never as something else."""

import bz2
import gzip
import io
import lzma
import tarfile
import zipfile

import numpy as np
import pytest

import underlay as ul
from support.compound_file import xls

POINTS = 60
DEPTH = np.linspace(0.0, 10.0, POINTS)  # um
FORCE = 0.3 * (DEPTH / 10.0) ** 1.5  # mN
TABLE = "depth (um),force (mN)\n" + "".join(
    f"{depth:.4f},{force:.5f}\n" for depth, force in zip(DEPTH, FORCE, strict=True)
)


@pytest.fixture
def put(tmp_path):
    def write(content, name="curve.csv"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


def is_whole(curve):
    np.testing.assert_allclose(curve.depth, DEPTH * 1e-6, atol=1e-10, rtol=0)
    np.testing.assert_allclose(curve.force, FORCE * 1e-3, atol=1e-8, rtol=0)


def tarred():
    content = io.BytesIO()
    with tarfile.open(fileobj=content, mode="w") as archive:
        entry = tarfile.TarInfo("curve.csv")
        entry.size = len(TABLE)
        archive.addfile(entry, io.BytesIO(TABLE.encode()))
    return content.getvalue()


@pytest.mark.parametrize(
    ("packed", "told"),
    [
        (bz2.compress(TABLE.encode()), r"compressed by bzip2 \(.bz2\)"),
        (lzma.compress(TABLE.encode()), r"compressed by xz \(.xz\)"),
        (b"\x28\xb5\x2f\xfd" + bytes(60), r"compressed by Zstandard \(.zst\)"),
        (b"7z\xbc\xaf\x27\x1c" + bytes(60), r"an archive of 7-Zip \(.7z\)"),
        (b"Rar!\x1a\x07\x01" + bytes(60), r"an archive of RAR \(.rar\)"),
        (tarred(), r"an archive of tar \(.tar\)"),
    ],
    ids=["bz2", "xz", "zst", "7z", "rar", "tar"],
)
@pytest.mark.parametrize("in_zip", [False, True])
def test_a_packed_curve_says_how_to_unpack_it(packed, told, in_zip, put):
    if in_zip:
        content = io.BytesIO()
        with zipfile.ZipFile(content, "w") as archive:
            archive.writestr("curve.csv.packed", packed)
        packed = content.getvalue()
    with pytest.raises(
        ul.FileFormatError, match=rf"{told}, which is not read here: unpack it, or pack .*\.zip"
    ):
        ul.read(put(packed))


@pytest.mark.parametrize("in_zip", [False, True])
def test_a_curve_compressed_by_gzip_is_read(in_zip, put):
    packed = gzip.compress(TABLE.encode())
    if in_zip:
        content = io.BytesIO()
        with zipfile.ZipFile(content, "w") as archive:
            archive.writestr("curve.csv.gz", packed)
        packed = content.getvalue()
    is_whole(ul.read(put(packed)))


@pytest.mark.parametrize("order", ["le", "be"])
@pytest.mark.parametrize("unit", ["um", "µm", "\u03bcm"])
@pytest.mark.parametrize("in_zip", [False, True])
def test_utf_16_without_its_mark_is_read(order, unit, in_zip, put):
    coded = TABLE.replace("um", unit).encode(f"utf-16-{order}")
    if in_zip:
        content = io.BytesIO()
        with zipfile.ZipFile(content, "w") as archive:
            archive.writestr("curve.csv", coded)
        coded = content.getvalue()
    is_whole(ul.read(put(coded)))


# --- quoted numbers


def quoted(separator, names='"depth (um)"{}"force (mN)"'):
    rows = (f'"{d:.4f}"{separator}"{f:.5f}"'.replace(".", ",") for d, f in zip(DEPTH, FORCE, strict=True))
    return names.format(separator) + "\n" + "\n".join(rows)


@pytest.mark.parametrize("separator", [";", ",", "\t"])
@pytest.mark.parametrize("names", ['"depth (um)"{}"force (mN)"', "depth (um){}force (mN)"])
def test_decimal_commas_in_quotes_are_decimals(separator, names, put):
    is_whole(ul.read(put(quoted(separator, names=names))))


def test_a_comma_in_quotes_that_may_be_of_thousands_is_refused(put):
    rows = "\n".join(f'"{1000 + 10 * i:,}",{i}' for i in range(40))
    with pytest.raises(
        ul.FileFormatError, match=r"'depth \(nm\)': the separator of '1,000' may be of a decimal or of"
    ):
        ul.read(put(f"depth (nm),force (uN)\n{rows}"))


# --- results, a row for each test

RNG = np.random.default_rng(5)
PEAK_FORCE = np.repeat([1.0, 10.0, 100.0, 1000.0], 5) * RNG.uniform(0.999, 1.001, 20)
PEAK_DEPTH = 0.24 * PEAK_FORCE**0.5 * RNG.uniform(0.9, 1.1, 20)
#: Name and unit of each column, and what it holds, as ASMEC's program writes them.
ASMEC = (
    ("No.", "", [str(i) for i in range(1, 21)]),
    ("File", "", [f"Sample12_B7_{i:04d}.DAT" for i in range(1, 21)]),
    ("F", "mN", [f"{value:.3f}" for value in PEAK_FORCE]),
    ("h", "µm", [f"{value:.3f}" for value in PEAK_DEPTH]),
    ("H", "GPa", [f"{value:.3f}" for value in RNG.uniform(0.5, 1.5, 20)]),
    ("E", "GPa", [f"{value:.2f}" for value in RNG.uniform(12.0, 70.0, 20)]),
    ("Wtot", "nJ", [f"{value:.3f}" for value in PEAK_FORCE * PEAK_DEPTH / 3.0]),
    ("NIT", "%", ["27.69"] * 20),
)


def results(without=(), order=None):
    kept = [column for column in ASMEC if column[0] not in without]
    cells = np.array([column[2] for column in kept])
    return [
        [c[0] for c in kept],
        [c[1] for c in kept],
        *cells[:, slice(None) if order is None else order].T.tolist(),
    ]


@pytest.mark.parametrize(
    ("without", "order", "told"),
    [
        ((), None, "the column 'File' names each row, as 'Sample12_B7_0001.DAT'"),
        (("File",), None, "it has 'Wtot', 'NIT'"),
        (
            ("File", "Wtot"),
            RNG.permutation(20),
            "it has 'H', 'E', and its depths and forces leap from row to row",
        ),
    ],
)
@pytest.mark.parametrize("kind", ["csv", "xls"])
def test_a_table_of_results_is_no_curve(without, order, told, kind, put):
    rows = results(without, order)
    text = "\n".join(";".join(row) for row in rows)
    path = put(text if kind == "csv" else xls({"Results": rows}), f"summary.{kind}")
    with pytest.raises(
        ul.FileFormatError, match=f"is a table of results, a row for each test.*: {told}. Export the"
    ):
        ul.read(path)
    # Who knows better names both columns.
    named = ul.read(path, columns={"depth": "h (um)", "force": "F (mN)"})
    np.testing.assert_allclose(np.sort(named.force), np.sort(PEAK_FORCE.round(3)) * 1e-3, rtol=1e-9)


@pytest.mark.parametrize(
    ("head", "spread", "told"),
    [
        (
            "HM (N/mm^2);F (mN);h (um)",
            0.0,
            "its depths leap from row to row while its forces are all the same",
        ),
        ("HM (N/mm^2);F (mN);h (um)", 0.004, "its depths and forces leap from row to row"),
        ("E (GPa);F (mN);h (um);Test no.", None, "the column 'Test no.' numbers its rows"),
    ],
)
def test_a_table_of_results_without_names_is_no_curve(head, spread, told, put):
    """Many tests to one load, as of a Fischer microhardness tester; and loads in order, with numbers alone."""
    forces = PEAK_FORCE if spread is None else 300.0 * (1.0 + spread * RNG.uniform(-1.0, 1.0, 20))
    depths = PEAK_DEPTH if spread is None else RNG.uniform(2.0, 3.0, 20)
    rows = [
        f"{70 + i % 3};{f:.3f};{d:.3f}" + (f";{i + 1}" if spread is None else "")
        for i, (f, d) in enumerate(zip(forces, depths, strict=True))
    ]
    with pytest.raises(ul.FileFormatError, match=f"is a table of results.* and {told}"):
        ul.read(put("\n".join([head, *rows])))


def test_a_curve_that_carries_its_modulus_and_its_clock_is_no_table_of_results(put):
    """Continuous stiffness, with noise before the contact, a text that differs in every row, and 30 cycles."""
    swing = DEPTH[-1] / 10.0 * np.abs(np.arange(600) / 10.0 % 2.0 - 1.0)
    depth = np.concatenate((np.linspace(-1.0, 0.0, 60), DEPTH / 10.0, swing))
    force = np.clip(depth, 0.0, None) ** 1.5 + 1e-3 * RNG.standard_normal(len(depth))
    rows = [
        f"08:00:{i / 10:07.4f} AM,26 Nov 2026,{d:.5f},{f:.6f},{70 + f:.2f},{d:.5f} um,{0.1 * i:.1f}"
        for i, (d, f) in enumerate(zip(depth, force, strict=True))
    ]
    head = "Clock,Date,h (um),F (mN),E (GPa),Stage,t (s)\n"
    curve = ul.read(put(head + "\n".join(rows)))
    np.testing.assert_allclose(curve.depth, depth * 1e-6, atol=1e-11, rtol=0)


# --- what is not read, and several tests


def test_a_second_column_that_may_be_the_force_or_the_depth_is_noted(put):
    rows = "\n".join(f"{d:.4f},{d / 2:.4f},{f:.5f},{2 * f:.5f}" for d, f in zip(DEPTH, FORCE, strict=True))
    path = put("Displacement (um),depth (um),load (mN),force (mN)\n" + rows)
    depth, force = ul.read(path).metadata["notes"]
    assert depth.startswith(
        "the depth is read from 'depth (um)'; not read: 'Displacement (um)', which may be one"
    )
    assert force.startswith(
        "the force is read from 'force (mN)'; not read: 'load (mN)', which may be one too"
    )
    chosen = ul.read(path, columns={"depth": "Displacement", "force": "load"})
    is_whole(chosen)
    assert chosen.metadata["notes"] == ()


def test_tests_one_below_the_other_are_several_and_segments_whose_time_begins_again_are_not(put):
    def rows(depths, forces):
        return "".join(
            f"{d:.4f},{f:.5f},{0.1 * i:.1f}\n" for i, (d, f) in enumerate(zip(depths, forces, strict=True))
        )

    head, way_in, way_out = "h (um),F (mN),t (s)\n", rows(DEPTH, FORCE), rows(DEPTH[::-1], FORCE[::-1])
    tests = ul.read_all(put(head + 3 * way_in))
    assert [len(test) for test in tests] == [60, 60, 60]
    (note,) = tests[0].metadata["notes"]
    assert note.startswith(
        "the table holds 3 tests one below the other: the depth begins again in row 61, 121;"
    )
    assert ul.read(put(head + way_in + way_out)).metadata["notes"] == ()
