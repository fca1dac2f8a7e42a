"""What is loaded, and when: nobody waits for a library that he does not use."""

import ast
import inspect
import json
import os
import subprocess
import sys

import pytest
import typer

import underlay as ul
from support.reports import SAMPLES
from underlay.cli.app import app

HEAVY = {
    "dask",
    "emcee",
    "lmfit",
    "numpy",
    "matplotlib",
    "pandas",
    "pint",
    "scipy",
    "scipy.stats",
    "tomlkit",
}


#: Runs the command line in a fresh interpreter, as a shell does.
COMMAND = """
import sys
from underlay.cli import main
sys.argv = {words!r}
try:
    main()
except SystemExit as stop:
    assert not stop.code
"""


def loaded_by(*words):
    return loaded_after(COMMAND.format(words=["underlay", *map(str, words)]))


def fresh(code, given=""):
    """What a fresh interpreter writes that runs `code`."""
    done = subprocess.run(
        [sys.executable, "-c", code],
        input=given,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout


def loaded_after(code):
    """Heavy modules that a fresh interpreter holds after `code`."""
    return HEAVY & set(fresh(f"{code}\nimport sys; print(*sys.modules)").splitlines()[-1].split())


LAW = """
import underlay as ul
ul.contact_law(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e6, 0.4), 1e-3), ul.RIGID, max_depth=1e-5)
"""


@pytest.mark.parametrize(
    ("code", "allowed"),
    [("import underlay", set()), ("import underlay.mechanics", set()), (LAW, {"numpy", "scipy"})],
)
def test_what_is_loaded(code, allowed):
    assert loaded_after(code) <= allowed


def test_help_and_version_load_no_command():
    assert loaded_by("--help") == set()
    assert loaded_by("--version") == set()


#: Each text runs in a fork of one interpreter that has loaded what every command begins with, so that none is taken
#: for its neighbour.
FORKS = """
import json, os, sys, typer
for name, text in json.loads(sys.stdin.read()).items():
    if not os.fork():
        exec(text)
        print(json.dumps([name, list(sys.modules)]), flush=True)
        os._exit(0)
    assert not os.wait()[1], name
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_the_help_of_a_command_loads_nothing_of_what_it_does():
    commands = typer.main.get_command(app).commands
    heads = {}
    for name, command in commands.items():
        tree = ast.parse(inspect.getsource(sys.modules[command.callback.__module__]))
        heads[name] = "\n".join(
            ast.unparse(node) for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom)
        )
    # The control: a module that is loaded is told.
    done = fresh(FORKS, json.dumps(heads | {"control": "import numpy"}))
    found = dict(map(json.loads, done.splitlines()))
    assert set(found) == {*commands, "control"}
    assert HEAVY & set(found.pop("control")) == {"numpy"}
    assert not {name: HEAVY & set(loaded) for name, loaded in found.items() if HEAVY & set(loaded)}


def test_a_plain_fit_loads_no_pictures():
    sample = SAMPLES / "gel_on_glass"
    assert loaded_by("fit", sample.with_suffix(".csv"), "--scene", sample.with_suffix(".toml")) <= {
        *("numpy", "pandas", "scipy")  # arrays, tables, laws
    }


@pytest.mark.parametrize("name", ul.__all__)
def test_every_public_name_can_be_had(name):
    assert getattr(ul, name) is not None
    assert name in dir(ul)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_a_report_and_a_picture_are_the_functions_whatever_was_loaded_before():
    texts = {
        "report": "import underlay.report.plots.style, underlay as ul\n"
        "assert ul.report.__module__ == 'underlay.report.render'",
        "pictures": "import underlay.report.plots.map, underlay.report.plots.fit\n"
        "from underlay.report import plots\n"
        "assert all(callable(picture) for picture in (plots.fit, plots.map, plots.scene))",
        "one": "from underlay.report import plots\nplots.fit",
    }
    # What takes the time is the same for all, and nothing of ours.
    done = fresh(f"import matplotlib.pyplot, pandas\n{FORKS}", json.dumps(texts))
    found = {name: set(loaded) for name, loaded in map(json.loads, done.splitlines())}
    assert set(found) == set(texts)
    assert "underlay.report.plots.style" in found["report"]
    # A picture of a fit loads no statistics.
    assert "scipy.stats" not in found["one"]


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="fitt"):
        ul.fitt  # noqa: B018
