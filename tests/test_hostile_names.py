"""Reports of data that try to be code: a page shows words as words, and the cells that run are the templates'."""

import ast
import html
import json
import os
import re
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from IPython.core.inputtransformer2 import TransformerManager
from markdown_it import MarkdownIt
from nbconvert.filters.markdown_mistune import markdown2html_mistune

import underlay as ul
from support.chromium import browser, chromium
from support.hostile import CANARY, NAMES, file_name
from support.reports import SAMPLES, page_text
from underlay._csv import csv_text
from underlay._files import write_atomic
from underlay._text import one_line
from underlay.report import labels
from underlay.report.notebook import filled, import_path, make_notebook, markdown_text
from underlay.units import printed

anything = st.lists(
    st.sampled_from(
        [*NAMES, "\n```python\n", "```", "\n", "`", "$", "\\", "'", '"', "_", "*", "[", "](", "<", "&"]
    )
    | st.text(st.characters(exclude_categories=()), max_size=5),
    max_size=6,
).map("".join)

# --- cells ------------------------------------------------------------------------------------------------


def all_cells(words_):
    """Every template, filled with data alone."""
    a, b, c, _ = words_
    return (
        *filled("fit", {"title": a, "curve": b, "scene": c}),
        *filled("posterior", {"title": b, "posterior": c}),
        *filled("map", {"title": c, "table": a}),
    )


class _Blank(ast.NodeTransformer):
    def visit_Constant(self, node):
        return ast.Constant(type(node.value).__name__)


def shape(source):
    """What Python a cell is, whatever text stands in it."""
    tree = ast.parse(TransformerManager().transform_cell(source))
    return ast.dump(_Blank().visit(tree))


@pytest.fixture(scope="module")
def templates():
    """What the cells are where no data want anything: (is it code, its shape or its number of lines)."""
    return [what(cell) for cell in all_cells(("p", "q", "r", "s"))]


def what(cell):
    return (True, shape(cell.source)) if cell.code else (False, cell.source.count("\n"))


@settings(max_examples=25)
@given(data=st.tuples(anything, anything, anything, anything))
@example(data=("\n```python\nopen('x', 'w')\n```\n",) * 4)
def test_the_cells_are_those_of_the_templates_whatever_the_data_are(templates, data):
    made = all_cells(data)
    assert [what(cell) for cell in made] == templates
    notebook = make_notebook(made, data[0])
    assert [cell.cell_type == "code" for cell in notebook.cells] == [code for code, _ in templates]
    assert [cell.source for cell in notebook.cells] == [cell.source for cell in made]
    assert notebook.metadata["title"].isprintable()
    json.dumps(notebook, ensure_ascii=False).encode("utf-8")


def test_data_arrive_in_the_cells_as_they_are():
    for name in NAMES:
        _, cell, *_ = filled("map", {"title": "", "table": name})
        tree = ast.parse(TransformerManager().transform_cell(cell.source))
        texts = [node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)]
        assert texts.count(name) == 1


def test_a_placeholder_in_data_stays_what_it_is():
    cell, *_ = filled("map", {"title": "${title} $missing", "table": ""})
    assert "`$`{title} `$`missing" in cell.source


# --- words ------------------------------------------------------------------------------------------------

COMMONMARK = MarkdownIt("gfm-like", {"linkify": False, "html": True})


def shown(markup):
    """Words of some HTML, and the tags it has."""
    text = html.unescape(re.sub(r"<[^>]*>", "", markup))
    return "".join(text.split()), set(re.findall(r"<\s*([a-zA-Z0-9]+)", markup))


@settings(max_examples=100)
@given(anything)
def test_words_in_markdown_are_shown_as_they_are(text):
    source = f"# Title: {markdown_text(text)}"
    assert "\n" not in source
    wanted = "".join(f"Title: {' '.join(one_line(text).split())}".split())
    # The page's converter sets an anchor at every heading.
    for page in (markdown2html_mistune(source.removeprefix("# ")), COMMONMARK.render(source)):
        seen, tags = shown(page)
        assert tags <= {"h1", "p", "code"}
        assert seen == wanted
    # A notebook sets as mathematics what stands between dollars or behind a backslash, but not in code.
    assert not re.search(r"[$\\]", re.sub(r"`[$\\]+`", "", source))


def test_usual_names_stay_readable():
    for name in ("cartilage_on_bone.csv", "site-1 (2).txt", "Probe 3, links", "R-hat is 1.0012"):
        assert markdown_text(name) == name


def test_names_of_parameters_hold_nothing_but_paths():
    assert labels.label("layer.E[1]") == "layer modulus (curve 2)"
    assert labels.label("substrate.layers[0].E") == "layer 2 modulus"
    assert labels.label("x[<b>]$") == "x[?b?]?"
    for name in NAMES:
        assert re.fullmatch(r"[\w.\[\]?]*", labels.label(f"layer.{name}"), re.ASCII)


# --- the kernel -------------------------------------------------------------------------------------------

TRAPS = (
    *("pandas", "numpy", "underlay", "sitecustomize", "usercustomize", "json"),
    *("ipykernel_launcher", "IPython", "ipython_config", "ipython_kernel_config", "startup"),
)
MAP = file_name(NAMES[0], ".csv")


def hostile_map():
    """A table of a map in which every word is hostile."""
    printable = [name.encode("utf-8", "backslashreplace").decode() for name in NAMES]
    column = "layer.<script>window.ran = true</script>![a](https://example.invalid/i.png)$x$"
    return pd.DataFrame(
        {
            "name": printable,
            "path": printable,
            "x": np.arange(len(NAMES)) % 7 * 1e-3,
            "y": np.arange(len(NAMES)) // 7 * 1e-3,
            "status": "failed",
            "verdict": printable,
            "reason": printable[::-1],
            column: np.linspace(1.0, 2.0, len(NAMES)),
            f"{column}.stderr": 1.0,
        }
    )


@pytest.fixture(scope="module")
def trapped(tmp_path_factory):
    """The page of a hostile map, made by the command line in a folder full of traps: (folder, page)."""
    folder = tmp_path_factory.mktemp("trapped")
    write_atomic(folder / MAP, csv_text(hostile_map()))
    startup = folder / "home" / ".ipython" / "profile_default" / "startup"
    startup.mkdir(parents=True)
    trap = f"open({str(folder / CANARY)!r} + __name__, 'w').close()\nraise SystemExit(3)\n"
    for name in TRAPS:
        (folder / f"{name}.py").write_text(trap, encoding="utf-8")
    (startup / "first.py").write_text(trap, encoding="utf-8")
    (startup.parent / "ipython_kernel_config.py").write_text(trap, encoding="utf-8")
    (folder / "matplotlibrc").write_text("figure.dpi: 13\n", encoding="utf-8")
    told = {
        **os.environ,
        "HOME": str(folder / "home"),
        "PYTHONPATH": os.pathsep.join(import_path(folder)),
        "PYTHONSTARTUP": str(folder / "startup.py"),
    }
    told.pop("IPYTHONDIR", None)
    program = "from underlay.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-P", "-c", program, "report", MAP],
        cwd=folder,
        env=told,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return folder, folder / "report.html"


def test_nothing_beside_the_data_runs(trapped):
    folder, page = trapped
    assert not list(folder.rglob(f"{CANARY}*"))
    assert "Traceback" not in page_text(page)


def test_nothing_else_is_written(trapped):
    folder, _ = trapped
    laid = {f"{name}.py" for name in TRAPS} | {"home", "matplotlibrc", MAP}
    assert {path.name for path in folder.iterdir()} - laid == {"report.html"}


def test_the_kernel_looks_for_modules_where_none_of_the_data_lie(tmp_path, monkeypatch):
    work = tmp_path / "work"
    work.mkdir()
    monkeypatch.chdir(work)
    for entry in ("", ".", str(work), str(tmp_path / "out")):
        monkeypatch.syspath_prepend(entry)
    found = import_path(tmp_path / "out")
    assert not {"", ".", str(work), str(tmp_path / "out")} & set(found)
    assert all(os.path.isabs(entry) for entry in found)  # noqa: PTH117


# --- pages ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def hostile_pages(trapped, tmp_path_factory):
    """Pages of hostile names: of a map, and of a fit whose curve carries every one of them."""
    curve = ul.read(SAMPLES / "cartilage_on_bone.csv")
    evil = {
        "name": " ".join(NAMES),
        "path": NAMES[0],
        "sha256": NAMES[1],
        "notes": NAMES,
        "scene_path": NAMES[2],
    }
    scene = ul.load_scene(SAMPLES / "cartilage_on_bone.toml")
    free = {"layer.E": None, "instrument.contact_depth": None, "instrument.baseline": None}
    fit = ul.fit(ul.Problem(scene, curve.with_metadata(**evil), free))
    page = tmp_path_factory.mktemp("pages") / "fit.html"
    return {"map": trapped[1], "fit": ul.report(fit, page, command=" ".join(NAMES))}


def test_a_page_shows_hostile_names_as_text(hostile_pages):
    for page in hostile_pages.values():
        text = page_text(page)
        for name in NAMES:
            shown_ = " ".join(printed(one_line(name)).split())
            assert shown_.replace("\\udce9", "\\xe9") in text.replace("\\udce9", "\\xe9")
        assert not re.search(r"<(script|iframe|link|base|math|a)\b", page.read_text(encoding="utf-8"))
    assert "layer.?script?window.ran" in page_text(hostile_pages["map"])


@pytest.mark.skipif(chromium() is None, reason="no Chromium on this machine: the page is not opened")
def test_in_a_browser_nothing_runs_and_nothing_is_fetched(hostile_pages):
    with browser() as tab:
        for page in hostile_pages.values():
            events = tab.open(page.as_uri(), width=1400, scheme="light")
            assert not [e for e in events if e["method"] in {"Runtime.exceptionThrown", "Log.entryAdded"}]
            asked = [
                e["params"]["request"]["url"] for e in events if e["method"] == "Network.requestWillBeSent"
            ]
            assert asked[0].startswith("file:")
            assert all(url.startswith("data:image/png;base64,") for url in asked[1:])
            assert tab.evaluate("window.ran === undefined && document.scripts.length === 0")
            assert tab.evaluate("document.querySelectorAll('a, iframe, object, embed, form').length") == 0
            assert tab.evaluate("[...document.images].every(i => i.src.startsWith('data:image/png;base64,'))")
            assert tab.evaluate("location.href").startswith("file:")
