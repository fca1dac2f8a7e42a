"""Reports of data that try to be code: the cells that run are the templates', and a page shows words as words."""

import ast
import html
import json
import os
import re
import subprocess
import sys
from dataclasses import replace

import nbformat
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
from support.reports import SAMPLES, cells_of, page_text, small_posterior
from underlay._csv import csv_text
from underlay._files import write_atomic
from underlay.data.export import curve_csv, write_curves
from underlay.report import labels, posterior_tables, render, tables, words
from underlay.report.notebook import Source, filled, html_page, import_path, make_notebook
from underlay.report.reading import segments_of_file, segments_part
from underlay.report.render import problem_source
from underlay.report.spoken import markdown_text

anything = st.lists(
    st.sampled_from(
        [*NAMES, "\n```python\n", "```", "\n", "`", "$", "\\", "'", '"', "_", "*", "[", "](", "<", "&"]
    )
    | st.text(st.characters(exclude_categories=()), max_size=5),
    max_size=6,
).map("".join)

# --- cells ------------------------------------------------------------------------------------------------


def all_cells(words_, problem):
    """Every template, filled with data alone."""
    a, b, c, d = words_
    facts = {"to repeat": c, f"curve 1 taken from {a}": b}
    measured = segments_part({1: a, 2: d})
    parts = {"time_part": filled("relaxation", {}), "adhesion_part": filled("adhesion", {})}
    parts |= {"bond_part": filled("bonding", {}), "log_part": filled("fit_log", {})}
    parts["pointwise_part"] = filled("pointwise", {})
    common = {"title": a, "facts": facts, "files": [b, c], **parts}
    load = Source(problem_source(problem, [c, d]))
    return (
        *filled("fit", {**common, "load": load, "segments_part": measured}),
        *filled("fit", {**common, "load": render._load_source([a, d]), "segments_part": segments_of_file()}),
        *filled(
            "posterior",
            {
                **common,
                "posterior": d,
                "load": Source(""),
                "segments_part": (),
                "scene_part": filled("posterior_missing", {"missing": c}),
            },
        ),
        *filled("map", {**common, "table": b}),
    )


class _Blank(ast.NodeTransformer):
    def visit_Constant(self, node):
        return ast.Constant(type(node.value).__name__)


def shape(source):
    """What Python a cell is, whatever text stands in it."""
    tree = ast.parse(TransformerManager().transform_cell(source))
    return ast.dump(_Blank().visit(tree))


@pytest.fixture(scope="module")
def problem():
    return small_posterior()[0]


@pytest.fixture(scope="module")
def templates(problem):
    """What the cells are where no data want anything: (is it code, its shape or its number of lines)."""
    return [what(cell) for cell in all_cells(("p", "q", "r", "s"), problem)]


def what(cell):
    return (True, shape(cell.source), cell.alt) if cell.code else (False, cell.source.count("\n"), "")


@settings(max_examples=25)
@given(data=st.tuples(anything, anything, anything, anything))
@example(data=("\n```python\nopen('x', 'w')\n```\n",) * 4)
def test_the_cells_are_those_of_the_templates_whatever_the_data_are(problem, templates, data):
    made = all_cells(data, problem)
    assert [what(cell) for cell in made] == templates
    notebook = make_notebook(made, data[0])
    assert [cell.cell_type == "code" for cell in notebook.cells] == [code for code, _, _ in templates]
    assert [cell.source for cell in notebook.cells] == [cell.source for cell in made]
    assert notebook.metadata["title"].isprintable()
    json.dumps(notebook, ensure_ascii=False).encode("utf-8")


def test_data_arrive_in_the_cells_as_they_are():
    for name in NAMES:
        _, cell, *_, last = filled(
            "map", {"title": "", "table": name, "facts": {name: name}, "files": [name]}
        )
        for source, times in ((cell.source, 1), (last.source, 3)):
            tree = ast.parse(TransformerManager().transform_cell(source))
            texts = [node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)]
            assert texts.count(name) == times


def test_a_placeholder_in_data_stays_what_it_is():
    (cell,) = filled("posterior_missing", {"missing": "${title} $missing"})
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
    wanted = "".join(f"Title: {' '.join(words.noted(text)[6:].split())}".split())
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
    (folder / "index.html.j2").write_text("{{ 1 / 0 }}", encoding="utf-8")
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
    laid = {f"{name}.py" for name in TRAPS} | {"home", "matplotlibrc", "index.html.j2", MAP}
    assert {path.name for path in folder.iterdir()} - laid == {"report.html", "report.ipynb"}


def test_the_executed_cells_are_the_templates(trapped):
    _, page = trapped
    ran = [cell for cell in cells_of(page.with_suffix(".ipynb")) if cell["cell_type"] == "code"]
    plain = filled("map", {"title": "", "table": "", "facts": {"to repeat": ""}, "files": [""]})
    wanted = [shape(cell.source) for cell in plain if cell.code]
    assert [shape("".join(cell["source"])) for cell in ran] == wanted


def test_a_notebook_of_a_hostile_curve_has_the_cells_of_any(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scene = SAMPLES / "cartilage_on_bone.toml"
    curve = ul.read(SAMPLES / "cartilage_on_bone.csv")
    plain = render.file_notebook(SAMPLES / "cartilage_on_bone.csv", scene, tmp_path, "x")
    path = tmp_path / file_name(NAMES[0], ".csv")
    path.write_text(curve_csv(curve, [NAMES[0]]), encoding="utf-8")
    made = render.file_notebook(path, scene, tmp_path, NAMES[0])
    assert [cell.cell_type for cell in made.cells] == [cell.cell_type for cell in plain.cells]
    # A name in the metadata of the file, and one in memory.
    told = write_curves(curve.with_metadata(name=NAMES[1]), tmp_path / "told.csv")
    problem = ul.load_problem(told, scene)
    assert problem.curves[0].metadata["name"] == NAMES[1]
    monkeypatch.setattr(render, "write_report", lambda notebook, _: notebook)
    made = ul.report(ul.fit(problem), tmp_path / "report.html")
    assert [cell.cell_type for cell in made.cells] == [cell.cell_type for cell in plain.cells]
    assert made.metadata["title"].isprintable()
    assert not (tmp_path / CANARY).exists()


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


EVERY = " ".join(NAMES)


@pytest.fixture(scope="module")
def shared_posterior(tmp_path_factory):
    """A posterior that somebody sent, as it is loaded: (file, posterior)."""
    given = small_posterior()[1]
    path = tmp_path_factory.mktemp("shared") / file_name(NAMES[0][:40], ".npz")
    replace(
        given,
        problem=None,
        missing=EVERY,
        names=(NAMES[0], "![a](https://example.invalid/k.png)$x$<script>window.ran = true</script>"),
        diagnostics=replace(given.diagnostics, reason=EVERY),
    ).save(path)
    return path, ul.Posterior.load(path)


@pytest.fixture(scope="module")
def hostile_pages(trapped, shared_posterior, tmp_path_factory):
    """Pages of hostile names: of a map, and of cells of every kind with what a shared posterior makes of them."""
    _, posterior = shared_posterior
    cells = [
        cell
        for name in NAMES
        for cell in (
            *filled("map", {"title": name, "table": name, "facts": {name: name}, "files": [name]}),
            *filled("posterior_missing", {"missing": name}),
        )
    ]
    notebook = make_notebook(cells, EVERY)
    shown_ = nbformat.v4.new_code_cell("")
    tables_ = [
        posterior_tables.posterior_table(posterior),
        posterior_tables.posterior_diagnostics_table(posterior),
        tables.facts_table({name: name for name in NAMES}),
    ]
    shown_.outputs = [
        nbformat.v4.new_output("display_data", {"text/markdown": words.posterior_summary(posterior)}),
        *(nbformat.v4.new_output("display_data", {"text/html": table.to_html()}) for table in tables_),
        nbformat.v4.new_output("stream", text=words.noted(EVERY), name="stderr"),
    ]
    notebook.cells.append(shown_)
    page = tmp_path_factory.mktemp("pages") / "cells.html"
    page.write_text(html_page(notebook), encoding="utf-8")
    return {"map": trapped[1], "cells": page}


def test_a_shared_posterior_makes_the_cells_of_any(shared_posterior, tmp_path):
    path, posterior = shared_posterior
    assert posterior.names[0] == NAMES[0]
    made = render.posterior_notebook(path, tmp_path / "page.html", "x")
    replace(small_posterior()[1], problem=None, missing="x").save(tmp_path / "plain.npz")
    plain = render.posterior_notebook(tmp_path / "plain.npz", tmp_path / "page.html", "x")
    assert [cell.cell_type for cell in made.cells] == [cell.cell_type for cell in plain.cells]
    for cell, same in zip(made.cells, plain.cells, strict=True):
        if cell.cell_type == "code":
            assert shape(cell.source) == shape(same.source)
    # Its names are drawn, not set as formulas.
    ul.plots.save(ul.plots.corner(posterior), tmp_path / "corner.png")


def test_a_page_shows_hostile_names_as_text(hostile_pages):
    for page in hostile_pages.values():
        text = page_text(page)
        for name in NAMES:
            assert " ".join(words.noted(name)[6:].split()).replace("\\udce9", "\\xe9") in text.replace(
                "\\udce9", "\\xe9"
            )
        assert not re.search(r"<(script|iframe|link|base|svg|math|a)\b", page.read_text(encoding="utf-8"))
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
            assert all(url.startswith("data:image/png") for url in asked[1:])
            assert tab.evaluate("window.ran === undefined && document.scripts.length === 0")
            assert tab.evaluate("document.querySelectorAll('a, iframe, object, embed, form').length") == 0
            assert tab.evaluate("[...document.images].every(i => i.src.startsWith('data:image/png;base64,'))")
            assert tab.evaluate("location.href").startswith("file:")
