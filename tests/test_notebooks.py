"""The notebooks run from a clean checkout, are committed with their outputs, and assert their claims."""

import ast
import re

import nbformat
import pytest

from support.notebooks import FOLDER, executed, notebooks


@pytest.mark.parametrize("path", notebooks(), ids=lambda path: path.stem)
def test_notebook_is_committed_with_outputs_and_asserts_its_claims(path):
    notebook = nbformat.read(path, as_version=4)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert any(cell.outputs for cell in code), "run python tests/support/notebooks.py"
    assert not [output for cell in code for output in cell.outputs if output.output_type == "error"]
    last = re.sub(r"^%.*$", "", code[-1].source, flags=re.MULTILINE)
    asserted = [node for node in ast.walk(ast.parse(last)) if isinstance(node, ast.Assert)]
    assert asserted, "the last cell asserts what the text claims"
    assert not any(isinstance(node.test, ast.Constant) for node in asserted)


def shown(notebook):
    """Number of each cell that shows something other than a warning."""
    return [
        number
        for number, cell in enumerate(notebook.cells)
        if any(output.get("name") != "stderr" for output in cell.get("outputs", []))
    ]


@pytest.mark.parametrize("path", notebooks(), ids=lambda path: path.stem)
def test_notebook_runs(path):
    ran, committed = executed(path), nbformat.read(path, as_version=4)
    assert shown(ran) == shown(committed), "its outputs are old: run python tests/support/notebooks.py"


def test_every_figure_of_the_readme_is_there():
    readme = (FOLDER.parent / "README.md").read_text(encoding="utf-8")
    figures = re.findall(r"!\[([^\]]*)\]\(([^)]+)\)", readme)
    assert figures
    for alt, name in figures:
        assert len(alt) > 20, name
        assert (FOLDER.parent / name).read_bytes().startswith(b"\x89PNG"), name
