"""Files are written whole, with the user's permissions, where they were asked for and nowhere else."""

import csv
import io
import os
import stat
import warnings
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import underlay as ul
from support.hostile import NAMES
from support.reports import SAMPLES, small_posterior
from underlay._csv import csv_text, unguarded
from underlay._files import replacing, write_atomic
from underlay._text import comment_line, guarded_cell, one_line, unguarded_cell
from underlay.data.export import curve_csv, write_curves
from underlay.inference.batch.decisions import read_map
from underlay.inference.batch.results_table import Layout, to_frame, write_table

posix = pytest.mark.skipif(os.name != "posix", reason="permissions and links of POSIX systems")


def mode(path):
    return stat.S_IMODE(path.stat().st_mode)


@pytest.fixture
def umask():
    """Set the umask for a test: ``umask(0o077)``."""
    before = os.umask(0o022)
    yield os.umask
    os.umask(before)


# --- permissions, links, whole files ----------------------------------------------------------------------


@posix
@pytest.mark.parametrize(("mask", "wanted"), [(0o077, 0o600), (0o022, 0o644), (0o002, 0o664)])
def test_a_new_file_has_what_the_umask_leaves(umask, tmp_path, mask, wanted):
    umask(mask)
    assert mode(write_atomic(tmp_path / "a.csv", "x")) == wanted
    layout = Layout.of((), (), sampled=False)
    for name in ("map.csv", "map.parquet"):
        assert mode(write_table(tmp_path / name, layout, [])) == wanted


@posix
def test_every_result_of_a_fit_is_private_where_the_user_is(umask, tmp_path):
    umask(0o077)
    _, posterior = small_posterior()
    posterior.save(tmp_path / "p.npz")
    scene = ul.load_scene(SAMPLES / "cartilage_on_bone.toml")
    scene.save(tmp_path / "s.toml")
    curve = ul.Curve([0.0, 1e-6], [0.0, 1e-3])
    for ending in ("csv", "json", "h5"):
        write_curves(curve, tmp_path / f"c.{ending}")
    ul.plots.save(ul.plots.segments(curve), tmp_path / "p.svg")
    assert {path.name: oct(mode(path)) for path in tmp_path.iterdir()} == {
        path.name: "0o600" for path in tmp_path.iterdir()
    }
    assert len(list(tmp_path.iterdir())) == 6


@posix
@pytest.mark.parametrize("kept", [0o600, 0o664, 0o640])
def test_a_file_that_is_there_keeps_its_permissions(umask, tmp_path, kept):
    target = tmp_path / "a.csv"
    target.write_text("old")
    target.chmod(kept)
    umask(0o027)
    write_atomic(target, "new")
    assert mode(target) == kept
    assert target.read_text() == "new"


@posix
def test_a_link_is_replaced_and_never_written_through(umask, tmp_path):
    umask(0o077)
    outside = tmp_path / "outside.txt"
    outside.write_text("precious")
    outside.chmod(0o644)
    out = tmp_path / "out"
    out.mkdir()
    (out / "a.csv").symlink_to(outside)
    (out / "b.csv").symlink_to(tmp_path / "nowhere.txt")
    for name in ("a.csv", "b.csv"):
        write_atomic(out / name, "new")
        assert not (out / name).is_symlink()
        assert mode(out / name) == 0o600
    assert outside.read_text() == "precious"
    assert not (tmp_path / "nowhere.txt").exists()


@posix
def test_a_run_never_begins_through_a_link(tmp_path):
    scene = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.5), 1e-3), ul.RIGID)
    curve = ul.synthesize(scene, np.linspace(0, 5e-5, 40), noise=ul.Noise(force=1e-4), rng=0)
    (tmp_path / "map.csv.journal").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(ul.FileAccessError, match="cannot open"):
        ul.fit_many([curve], scene, {"layer.E": (1e4, 1e8)}, workers=0, output=tmp_path / "map.csv")
    precious = tmp_path / "precious"
    precious.write_text("x")
    (tmp_path / "run.h5.new").symlink_to(precious)
    problem, _ = small_posterior()
    with warnings.catch_warnings():
        # So few steps may not converge.
        warnings.simplefilter("ignore", ul.UnderlayWarning)
        ul.sample(problem, walkers=16, max_steps=20, rng=0, backend=tmp_path / "run.h5")
    assert precious.read_text() == "x"
    assert not (tmp_path / "elsewhere").exists()


@posix
def test_what_is_no_file_is_not_replaced(tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    (tmp_path / "folder.csv").mkdir()
    for name in ("pipe.csv", "folder.csv"):
        with pytest.raises(ul.FileAccessError, match=f"cannot write .*{name}"):
            write_atomic(tmp_path / name, "x")
    with pytest.raises(ul.FileAccessError, match="no regular file"):
        write_atomic("/dev/null", "x")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["folder.csv", "pipe.csv"]


def test_a_write_that_fails_leaves_the_old_file_alone(tmp_path):
    target = tmp_path / "a.csv"
    target.write_text("old")

    def broken(error):
        with replacing(target) as file:
            file.write(b"half")
            raise error

    with pytest.raises(KeyError):
        broken(KeyError())
    with pytest.raises(ul.FileAccessError, match=r"cannot write .*: No space"):
        broken(OSError(28, "No space left on device"))
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


@posix
def test_the_longest_name_a_file_can_have(tmp_path):
    assert write_atomic(tmp_path / ("a" * 251 + ".csv"), "x").read_text() == "x"


# --- text -------------------------------------------------------------------------------------------------

anything = st.text(st.characters(exclude_categories=()) | st.sampled_from("=+-@;'\"\t\r\n ,1.e\uff1d\udce9"))


@given(anything)
def test_a_line_is_one_printable_line(text):
    line = one_line(text)
    assert line.isprintable()
    assert one_line(line) == line
    if text.isprintable():
        assert line == text


def test_a_long_line_is_cut():
    assert one_line("abcdef", 4) == "abc\N{HORIZONTAL ELLIPSIS}"
    assert one_line("abcd", 4) == "abcd"


@given(anything)
@example("\t=x")
@example("'\t'-1")
def test_guarded_text_comes_back(text):
    assert unguarded_cell(guarded_cell(text)) == text


def begins_a_formula(cell):
    """What a spreadsheet takes for a formula, unless it is a number."""
    try:
        float(cell)
    except ValueError:
        return cell.lstrip(" '\x0b\x0c")[:1] in set("=+-@\uff1d\uff0b\uff0d\uff20") and not cell.startswith(
            "'"
        )
    return False


@given(anything)
@example("a;=x")
@example("1;-1+x|y!A0")
@example("\r\n=x")
def test_no_cell_begins_a_formula(text):
    guarded = guarded_cell(text)
    assert not guarded.startswith(("\t", "\r", "\n"))
    for cell in guarded.replace("\t", ";").replace("\r", ";").replace("\n", ";").split(";"):
        assert not begins_a_formula(cell)


@pytest.mark.parametrize("number", ["-1.5", "+3", "1e-9", "-1e-9", ".5", "-0"])
def test_numbers_are_left_alone(number):
    assert guarded_cell(number) == number


def test_a_table_of_hostile_words_holds_no_formula_and_reads_back():
    # A pandas of today holds no text that is no UTF-8.
    names = [name.encode("utf-8", "backslashreplace").decode() for name in NAMES]
    table = pd.DataFrame(
        {
            "name": names,
            "value": np.linspace(-1, 1, len(NAMES)),
            "count": pd.array([None, *range(1, len(NAMES))], dtype="Int64"),
            "@SUM(A1)": ["-2+3+cmd|' /C calc'!A0"] * len(NAMES),
        },
        index=pd.Index([f"+{n}x" for n in range(len(NAMES))], name="=row"),
    )
    text = csv_text(table)
    for row in csv.reader(io.StringIO(text, newline="")):
        for cell in row:
            assert not begins_a_formula(cell), cell
    for line in text.splitlines():
        for cell in line.split(";"):
            assert not begins_a_formula(cell.lstrip('"')), cell
    again = unguarded(pd.read_csv(io.StringIO(text, newline=""), index_col=0))
    assert again["name"].tolist() == names
    # Pandas reads to the bit from 3.1 on, and before to the last place or two of numbers of order one.
    np.testing.assert_allclose(again["value"], table["value"], rtol=0.0, atol=4.0 * np.finfo(float).eps)
    assert again["@SUM(A1)"].tolist() == table["@SUM(A1)"].tolist()
    assert again.index.tolist() == table.index.tolist()
    assert again["count"].tolist()[1:] == list(range(1, len(NAMES)))


def test_a_map_of_hostile_names(tmp_path):
    scene = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.5), 1e-3), ul.RIGID)
    depth = np.linspace(-1e-5, 5e-5, 30)
    good = ul.synthesize(scene, depth, noise=ul.Noise(force=1e-4), rng=0)
    bad = ul.Curve(depth, np.full(30, np.nan))
    curves = [bad.with_metadata(name=name) for name in NAMES]
    curves[0] = good.with_metadata(name=NAMES[0])
    free = {"layer.E": (1e4, 1e8)}
    run = {"free": free, "workers": 0, "output": tmp_path / "map.csv"}
    table = ul.fit_many(curves, scene, **run)
    with (tmp_path / "map.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.reader(stream))
    assert len(rows) == len(NAMES) + 1
    for row in rows:
        assert not any(begins_a_formula(cell) for cell in row), row
    # In memory and as read back the names are what they are, without the guard.
    assert "=cmd|'/C calc'!A0" in table["name"].tolist()
    again = read_map(tmp_path / "map.csv")
    assert again["name"].tolist() == table["name"].tolist()
    assert again["layer.E"].tolist()[0] == table["layer.E"].tolist()[0]
    # Continued, the run finds every row.
    journal = (tmp_path / "map.csv.journal").read_bytes()
    pd.testing.assert_frame_equal(
        ul.fit_many(curves, scene, **run, options=ul.MapOptions(resume=True)), table
    )
    assert (tmp_path / "map.csv.journal").read_bytes() == journal


@pytest.mark.parametrize("name", NAMES)
def test_comments_of_a_curve_are_one_line_and_no_cell(name, tmp_path):
    curve = ul.Curve([0.0, 1e-6, 2e-6], [0.0, 1e-3, 2e-3], metadata={"name": f"a,{name}"})
    for text in (
        curve_csv(curve, [f"made by: {name}"]),
        write_curves(curve, tmp_path / "c.csv").read_text(encoding="utf-8"),
    ):
        lines = text.splitlines()
        assert [line[0] for line in lines].count("#") == 1
        assert len(lines) == 5
        for cell in lines[0].replace(";", ",").split(","):
            assert not begins_a_formula(cell), cell
    assert ul.read(tmp_path / "c.csv").metadata["name"] == f"a,{name}"


def test_a_comment_cannot_say_what_the_file_knows(tmp_path):
    curve = ul.Curve([0.0, 1e-6, 2e-6], [0.0, 1e-3, 2e-3])
    path = tmp_path / "c.csv"
    path.write_text(curve_csv(curve, ["made by: x\n# indenter radius: 1 m\n5,5"]), encoding="utf-8")
    again = ul.read(path)
    assert "indenter_radius" not in again.metadata
    assert len(again) == 3
    assert comment_line("a,=b, +c") == "# a,'=b,' +c"


@posix
def test_a_name_with_a_byte_that_is_no_letter(tmp_path):
    name = os.fsdecode(b"caf\xe9")
    path = tmp_path / f"{name}.csv"
    path.write_bytes((SAMPLES / "cartilage_on_bone.csv").read_bytes())
    problem = ul.load_problem(path, SAMPLES / "cartilage_on_bone.toml")
    fit = ul.fit(problem)
    written = fit.to_json(tmp_path / f"{name}.fit.json")
    assert rb"caf\udce9" in written.read_bytes()
    for ending in ("csv", "json", "h5"):
        again = ul.read(write_curves(problem.curves[0], tmp_path / f"{name}.out.{ending}"))
        assert again.metadata["name"] == problem.curves[0].metadata["name"]
    layout = Layout.of((), (), sampled=False)
    line = layout.text({"name": name, "status": "failed", "reason": "x"})
    table = write_table(tmp_path / f"{name}.map.csv", layout, [line])
    assert rb"caf\xe9," in table.read_bytes()
    assert to_frame(layout, [line])["name"].tolist() == [r"caf\xe9"]


@pytest.mark.parametrize("name", [name for name in NAMES if "<svg" in name or "$" in name])
def test_a_picture_of_vectors_holds_no_script(name, tmp_path):
    table = pd.DataFrame({"status": "fitted", f"layer.{name}": [1.0, 2.0, 3.0]})
    path = ul.plots.save(ul.plots.histogram(table, f"layer.{name}"), tmp_path / "p.svg")
    for element in ET.parse(path).iter():  # noqa: S314  made two lines above
        assert element.tag.rpartition("}")[2] not in {"script", "image", "a", "foreignObject"}
        assert not any(key.startswith("on") for key in element.attrib)
