"""Notebook templates: Markdown with fenced Python, one fence a cell, and the notebook made of one.

A template is a page of Markdown. Each fenced block that starts with three backticks and ``python`` becomes a
code cell; what stands between two of them becomes a Markdown cell. Words after ``python`` say how the cell
looks in a report: ``alt="..."`` describes the picture it makes, and the first line of a fence may be a
placeholder such as ``${load}``, filled with the caller's source.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Mapping
from importlib import resources
from string import Template
from types import ModuleType
from typing import Any

from underlay.errors import MissingExtraError

__all__ = ["make_notebook", "report_library", "template_text"]

_FENCE = re.compile(r"^```python(?P<info>[^\n]*)\n(?P<code>.*?)^```\s*$", re.DOTALL | re.MULTILINE)
_ALT = re.compile(r'alt="([^"]*)"')


def report_library(name: str) -> ModuleType:
    """Import one of the libraries of the extra ``report``.

    Raises
    ------
    MissingExtraError
        If it is not installed.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise MissingExtraError(f"a report needs {name}: pip install 'underlay[report]'") from error


def make_notebook(template: str, values: Mapping[str, str]) -> Any:
    """Fill a template and return it as a notebook, not executed.

    Parameters
    ----------
    template : str
        Name of a file in ``templates``, without its ending.
    values : mapping of str to str
        Text for its placeholders.

    Raises
    ------
    MissingExtraError
        If the extra ``report`` is not installed.
    """
    text = template_text(template)
    v4 = report_library("nbformat").v4
    cells = []
    for number, (code, info, source) in enumerate(_blocks(Template(text).substitute(values))):
        cell = v4.new_code_cell(source) if code else v4.new_markdown_cell(source)
        # Without this every notebook gets random names for its cells, and no two reports are alike.
        cell["id"] = f"cell-{number}"
        if alt := _ALT.search(info):
            cell["metadata"]["alt"] = alt.group(1)
        cells.append(cell)
    kernel = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    return v4.new_notebook(cells=cells, metadata={**kernel, "title": values["title"]})


def template_text(name: str) -> str:
    """Return the text of a template."""
    return (resources.files("underlay.report") / "templates" / f"{name}.md").read_text(encoding="utf-8")


def _blocks(text: str) -> list[tuple[bool, str, str]]:
    """(is it code, info words, source) of every block that is not empty."""
    blocks, end = [], 0
    for fence in _FENCE.finditer(text):
        blocks.append((False, "", text[end : fence.start()].strip()))
        blocks.append((True, fence["info"], fence["code"].strip("\n")))
        end = fence.end()
    blocks.append((False, "", text[end:].strip()))
    return [block for block in blocks if block[2]]
