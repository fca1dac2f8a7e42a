"""The one door: what no file may do to a command, whatever kind of file it is meant to be.

Every command here runs in a process of its own with a limit on its time and its memory.
"""

import io
import json
import os
import subprocess
import sys
import zipfile

import numpy as np
import pytest

import underlay as ul
from support.posterior_cases import halfspace_curve, halfspace_problem
from underlay._door import (
    FileKind,
    parse_json,
    parse_toml,
    printable,
    read_bytes,
    read_start,
    read_text,
    sha256_of,
    understood,
)
from underlay.data.curve import check_fittable
from underlay.inference.batch.decisions import read_map
from underlay.inference.batch.manifest import read_manifest
from underlay.inference.journal import open_chain
from underlay.scene.scene_file import read_scene_file
from underlay.units import parse_quantity

KIND = FileKind("a test file", 1000, "write another")
SCENE = """
[indenter]
shape = "sphere"
radius = "0.5 mm"
[layer]
E = "0.4 MPa"
nu = 0.45
[fit]
layer.E = { min = "1 kPa", max = "100 MPa" }
"""
CURVE = "depth (um),force (uN)\n" + "".join(f"{d},{d**1.5}\n" for d in range(50))
needs_pipes = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes on this system")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(SCENE)
    (tmp_path / "curve.csv").write_text(CURVE)
    (tmp_path / "curves").mkdir()
    (tmp_path / "curves" / "a.csv").write_text(CURVE)
    return tmp_path


#: Runs commands one after the other as the command line does, and says how each ended.
COMMANDS = """
import contextlib, io, json, resource, sys
resource.setrlimit(resource.RLIMIT_DATA, (3 * 2**30, 3 * 2**30))
from underlay.cli.app import main
for words in json.loads(sys.argv[1]):
    said = io.StringIO()
    sys.argv = ["underlay", *words.split()]
    try:
        with contextlib.redirect_stderr(said):
            main()
        code = 0
    except SystemExit as end:
        code = end.code
    print(json.dumps([words, code, said.getvalue()]), flush=True)
"""


def refused(*commands):
    """What commands say that must each end with exit code 2 and one line, in bounded time and memory."""
    done = subprocess.run(
        [sys.executable, "-c", COMMANDS, json.dumps(commands)],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    ended = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("[")]
    assert [words for words, _, _ in ended] == list(commands)
    for words, code, said in ended:
        assert code == 2, (words, said[-2000:])
        assert said.count("\n") == 1, (words, said)
        assert len(said) < 2000, words
    return [said for _, _, said in ended]


# --- files that are none ----------------------------------------------------------------------------------


@needs_pipes
@pytest.mark.skipif(not os.path.exists("/dev/zero"), reason="no such device on this system")  # noqa: PTH110
def test_pipes_and_devices_are_refused_by_every_command(folder):
    for name in ("pipe", "pipe.npz", "pipe.json", "pipe.csv"):
        os.mkfifo(folder / name)
    (folder / "zero.json").symlink_to("/dev/zero")
    told = refused(
        "report pipe",
        "report pipe.npz",
        "report pipe.json",
        "report zero.json",
        "fit pipe --scene scene.toml",
        "fit curve.csv --scene pipe",
        "map curves --scene scene.toml --manifest pipe.csv",
        "map curves --scene scene.toml --manifest zero.json",
    )
    assert all("pipe or device" in said for said in told)


@needs_pipes
def test_every_way_in_refuses_a_pipe(folder):
    pipe = folder / "pipe.h5"
    os.mkfifo(pipe)
    reads = [
        lambda: read_bytes(pipe, KIND),
        lambda: read_text(pipe, KIND),
        lambda: read_start(pipe, 4),
        lambda: sha256_of(pipe),
        lambda: read_map(pipe),
    ]
    for read in reads:
        with pytest.raises(ul.FileAccessError, match="pipe or device"):
            read()
    with (
        pytest.raises(ul.FileAccessError, match="not a regular file"),
        open_chain(pipe, ("layer.E",), 4, resume=True),
    ):
        pass


def test_a_file_is_read_up_to_its_bound(tmp_path):
    path = tmp_path / "x"
    path.write_bytes(b"a" * 1000)
    assert read_bytes(path, KIND) == b"a" * 1000
    assert read_start(path, 7) == b"a" * 7
    path.write_bytes(b"a" * 1001)
    with pytest.raises(
        ul.FileFormatError, match="more than the 0 MB that are read of a test file; write another"
    ):
        read_bytes(path, KIND)


@pytest.mark.skipif(not os.path.exists("/proc/self/status"), reason="no such files on this system")  # noqa: PTH110
def test_what_a_file_says_of_its_size_is_not_believed():
    """Files of the operating system say that they are empty."""
    with pytest.raises(ul.FileFormatError, match="holds more than"):
        read_bytes("/proc/self/status", FileKind("a test file", 10, "write another"))


def test_every_exception_of_a_parser_becomes_ours():
    for error in (
        KeyError("depth"),
        RecursionError(),
        MemoryError(),
        zipfile.BadZipFile("x"),
        OverflowError("y"),
    ):
        with (
            pytest.raises(
                ul.FileFormatError, match=r"^f\.dat is not a test file, or damaged: .*; write another$"
            ),
            understood("f.dat", KIND),
        ):
            raise error
    with pytest.raises(KeyboardInterrupt), understood("f.dat", KIND):
        raise KeyboardInterrupt


def test_names_of_files_are_one_printable_line():
    assert printable("a\nb\udce9") == "a\\nb\\xe9"


# --- JSON and TOML ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    ["[" * 100_000, '{"a":' * 60 + "1" + "}" * 60, "1" * 5000, "1" * 30, "[[], []" + ",[]" * 2_000_000 + "]"],
    ids=["deep", "rather deep", "digits", "some digits", "many"],
)
def test_json_without_bounds(text):
    with pytest.raises(ul.FileFormatError), understood("x.json", KIND):
        parse_json(text)


@pytest.mark.parametrize(
    "text",
    [
        ".".join(["a"] * 20_000) + " = 1",
        "[" + ".".join(['"a"'] * 20_000) + "]",
        "a = " + "[" * 100_000,
        "a = " + "{b=" * 100_000,
        "a = " + "1" * 5000,
        "a = " + "1" * 4000,
        "a = 0x" + "f" * 5000,
        '"' * 900_000,
        '"""\\' * 200_000,
    ],
)
def test_toml_without_bounds(text, tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE + text)
    with pytest.raises(ul.FileFormatError, match=r"scene\.toml is not a scene file"):
        read_scene_file(path)


def test_dots_in_strings_and_comments_of_toml_are_no_key():
    dots = ".".join("abcdefghijklmnopqrstuvwxyz")
    text = f'a = "{dots}" # {dots}\nb = """\n{dots}"""\nc = \'{dots}\'\nd = 0.{"1" * 40}\n'
    assert parse_toml(text)["a"] == dots


def test_damaged_records_on_the_command_line(folder):
    texts = {"deep": "[" * 100_000, "digits": '{"a":' + "1" * 5000 + "}", "byte": "\udce9"}
    for name, text in texts.items():
        (folder / f"{name}.json").write_bytes(text.encode("utf-8", "surrogateescape"))
    told = refused(*(f"report {name}.json" for name in texts))
    assert all("is not a result of underlay fit" in said for said in told)


# --- sizes ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("1e-320 m", "length"),
        ("1e-304 m", "length"),
        ("1e200 Pa", "pressure"),
        ("-1e-100 N", "force"),
    ],
)
def test_a_quantity_that_nothing_has_is_refused(text, kind):
    with pytest.raises(ul.UnitError, match="is not physical: its size must be from 1e-60 to 1e"):
        parse_quantity(text, kind)


def test_zero_and_small_offsets_are_quantities():
    assert parse_quantity("0 m", "length") == 0.0
    assert parse_quantity("1e-40 N", "force") == 1e-40


@pytest.mark.parametrize("radius", ["1e-320 m", "1e-20 m"])
def test_a_radius_below_the_smallest_size(radius, tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE.replace("0.5 mm", radius))
    with pytest.raises(ul.InputError, match="is not physical"):
        read_scene_file(path)


def test_depths_that_are_no_lengths():
    curve = halfspace_curve()
    with pytest.raises(ul.CurveError, match="not a physical length"):
        check_fittable(ul.Curve(curve.depth * 1e-300, curve.force))


def test_curves_that_are_none_on_the_command_line(folder):
    """A constant force, depths of 1e-304 m, and lines longer than Python's csv module takes."""
    lines, long = CURVE.splitlines(), '"' + "x" * 140_000 + '"'
    made = {
        "constant": ["depth (um),force (uN)", *(f"{d},3" for d in range(50))],
        "tiny": ["depth (m),force (uN)", *(f"{d}e-304,{d}" for d in range(50))],
        "names": [f"{lines[0]},{long}", *lines[1:]],
        "cell": [*lines[:20], f"{lines[20]},{long}", *lines[21:]],
        "before": [long, *lines],
    }
    for name, rows in made.items():
        (folder / f"{name}.csv").write_text("\n".join(rows))
    told = refused(*(f"fit {name}.csv --scene scene.toml" for name in made))
    for said, words in zip(
        told, ("no contact", "not a physical length", "names.csv", "140", "before.csv"), strict=True
    ):
        assert words in said


# --- arrays and chains ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    path = tmp_path_factory.mktemp("posterior") / "posterior.npz"
    with pytest.warns(ul.UnderlayWarning, match="not converged"):
        posterior = ul.sample(
            halfspace_problem(), walkers=16, max_steps=60, rng=1, progress=False, method="emcee"
        )
    posterior.save(path)
    return path.read_bytes()


def npy(header, data=b""):
    text = repr(header).encode().ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + data


def array(values):
    stream = io.BytesIO()
    np.save(stream, values, allow_pickle=True)
    return stream.getvalue()


def changed(saved, path, name, content):
    """The saved posterior with one member replaced, or without it where `content` is None."""
    with zipfile.ZipFile(io.BytesIO(saved)) as old, zipfile.ZipFile(path, "w") as new:
        for member in old.namelist():
            if member != f"{name}.npy":
                new.writestr(member, old.read(member))
            elif content is not None:
                new.writestr(member, content)
    return path


class Evil:
    """What a pickle would run."""

    def __reduce__(self):
        return os._exit, (7,)


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("chain", None, "lacks 'chain'"),
        (
            "chain",
            npy({"descr": "<f8", "fortran_order": False, "shape": (10**6, 10**6)}),
            "declares the shape",
        ),
        ("chain", npy({"descr": "<f8", "fortran_order": False, "shape": (-1,)}), "declares the shape"),
        (
            "chain",
            npy({"descr": "|O", "fortran_order": False, "shape": (1,)}, b"."),
            "neither numbers nor text",
        ),
        ("chain", array(np.array([Evil()], dtype=object)), "neither numbers nor text"),
        ("chain", array(np.ones((3, 3, 9))), "chain must be numbers of shape"),
        ("chain", array(np.full((3, 16, 2), np.nan)), "finite draws"),
        ("chain", array(np.ones((0, 16, 2))), "finite draws"),
        ("chain", b"text", "magic"),
        ("log_posterior", array(np.ones(4)), "log_posterior must be"),
        ("predictive/0/model", array(np.ones((5, 3))), "predictive/0/model must be"),
        ("about", array(np.array("[" * 200_000)), "nested too deeply"),
        ("about", array(np.array("{}")), "lacks 'format'"),
        ("about", None, "lacks 'about'"),
    ],
)
def test_arrays_that_are_not_what_they_say(saved, name, content, told, tmp_path):
    with pytest.raises(ul.FileFormatError, match=r"p\.npz is not a saved posterior, or damaged: ") as caught:
        ul.Posterior.load(changed(saved, tmp_path / "p.npz", name, content))
    assert told in str(caught.value)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (["names"], 3),
        (["names"], ["layer.E", "layer.E"]),
        (["priors"], [1, 2]),
        (["truth"], {"layer.E": "text"}),
        (["curves"], -1),
        (["curves"], 10**15),
        (["derived"], ["nothing"]),
        (["diagnostics"], None),
        (["diagnostics", "rhat"], "text"),
        (["diagnostics", "steps"], 1.5),
        (["diagnostics", "converged"], "yes"),
        (["diagnostics", "failure_region"], {"layer.E": [1.0]}),
        (["problem"], 7),
        (["problem", "tests"], [3]),
        (["problem", "free"], {"layer.E": 3}),
    ],
)
def test_documents_with_values_of_another_kind(saved, path, value, tmp_path):
    with np.load(io.BytesIO(saved)) as file:
        about = json.loads(str(file["about"]))
    part = about
    for key in path[:-1]:
        part = part[key]
    part[path[-1]] = value
    with pytest.raises(ul.FileFormatError, match=r"p\.npz is "):
        ul.Posterior.load(changed(saved, tmp_path / "p.npz", "about", array(np.array(json.dumps(about)))))


@pytest.mark.parametrize("change", ["state", "words", "nan", "gap"])
def test_chains_that_are_none(change, tmp_path):
    """Rows with a right checksum and size, of numbers that are no chain."""
    path, names = tmp_path / "a.chain", ("layer.E", "layer.thickness")
    with open_chain(path, names, 4, resume=False) as (file, _):
        state = list(np.random.RandomState(1).get_state())
        for step in range(3):
            coords = np.full((4, 2), np.nan if change == "nan" else 1.0)
            if change == "state":
                state[2] = np.nan
            elif change == "words":
                state[1] = np.full(624, 0.5)
            file.append(coords, np.ones(4), tuple(state), (1, 0))
            file.steps += change == "gap" and step == 1
    told = r"a\.chain is not a chain file, or damaged"
    with pytest.raises(ul.FileFormatError, match=told), open_chain(path, names, 4, resume=True):
        pass


# --- tables -----------------------------------------------------------------------------------------------


def test_manifests_that_are_no_tables(tmp_path):
    scene = halfspace_problem().base_scenes[0]
    path = tmp_path / "m.csv"
    for content in (
        b"\xff\xfe\x00",
        b"file" + b"," * 5000,
        b'file,name\na.csv,"' + b"x" * 200_000 + b'"\n',
        b"",
        b'"',
    ):
        path.write_bytes(content)
        with pytest.raises(ul.InputError, match=r"m\.csv"):
            read_manifest(path, scene)


def test_a_manifest_whose_rows_are_longer_than_its_header(tmp_path):
    """A comma at the end of each row shifted every number under the name of its neighbour."""
    path = tmp_path / "m.csv"
    path.write_text("file,radius (um),x (mm)\na.csv,500,1,\nb.csv,510,2,\n")
    with pytest.raises(ul.FileFormatError, match="more cells than there are names"):
        read_manifest(path, halfspace_problem().base_scenes[0])


def test_tables_of_maps_whose_numbers_are_none(tmp_path):
    path = tmp_path / "map.csv"
    for header, row in {
        "name,status,verdict,reason,layer.E,layer.E.stderr": "a,fitted,good,,text,1",
        "name,status,verdict,reason,layer.E.stderr": "a,fitted,good,,1",
        "name,status,verdict": "a,fitted,good",
        "name,status,verdict,reason,x,y": "a,fitted,good,,1,[]",
        "name,status,verdict,reason,layer.E,layer.E.stderr,layer.E.instrument": "a,fitted,good,,1,1,halfspace",
        "name,status,verdict,reason,layer.E": "a,fitted,good,,1" + "," * 140_000,
        "name,status,verdict,reason,seconds": "a,fitted,good,,1\na" + ',"\n"' * 40_000,
    }.items():
        path.write_text(f"{header}\n{row}\n")
        with pytest.raises(ul.FileFormatError, match=r"map\.csv is not the table of a map"):
            read_map(path)
    (tmp_path / "map.parquet").write_bytes(b"PAR1" + b"\xff" * 100 + b"PAR1")
    with pytest.raises(ul.FileFormatError, match=r"map\.parquet is not the table of a map"):
        read_map(tmp_path / "map.parquet")


# --- names ------------------------------------------------------------------------------------------------


@pytest.mark.skipif(sys.platform != "linux", reason="file names are bytes on Linux")
def test_a_name_that_is_no_text(folder):
    """A byte 0xE9 in the name of a curve: it is fitted, and its results can be written and read."""
    with open(os.fsencode(folder) + b"/na\xe9me.csv", "w") as file:  # noqa: PTH123  a name of bytes
        file.write(CURVE)
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "underlay",
            "fit",
            b"na\xe9me.csv",
            "--scene",
            "scene.toml",
            "--output",
            "out",
        ],
        capture_output=True,
        check=False,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    assert b"Traceback" not in done.stderr
    record = next((folder / "out").glob("*.fit.json"))
    json.loads(record.read_text(encoding="utf-8"))
