"""Notebooks from templates: Markdown with fenced Python, split into cells first and filled cell by cell.

A template is a page of Markdown. Each fenced block that starts with three backticks and ``python`` becomes a
code cell; what stands between two of them becomes a Markdown cell. Words after ``python`` say how the cell
looks in a report: ``alt="..."`` describes the picture it makes.

A placeholder such as ``${title}`` stands for data. Because the cells are there before the data come, no data
can begin or end one. In code a placeholder becomes the literal of its value, in Markdown one line of words
without markup. Two kinds of value are not data: `Source`, which is Python written by this package, and cells
of another template, which take the place of a placeholder that stands alone on a line of Markdown.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from string import Template
from types import ModuleType
from typing import Any, TypeAlias

from underlay._text import one_line
from underlay.errors import MissingExtraError
from underlay.report.markdown import markdown_text

__all__ = ["Cell", "Source", "Value", "filled", "make_notebook", "report_library", "with_sections"]

_FENCE = re.compile(r"^```python(?P<info>[^\n]*)\n(?P<code>.*?)^```\s*$", re.DOTALL | re.MULTILINE)
_ALT = re.compile(r'alt="([^"]*)"')
_PART = re.compile(r"^\$\{(\w+)\}$", re.MULTILINE)
# Letters: the longest file name has 255.
_LONGEST = 300


@dataclass(frozen=True)
class Source:
    """Python written by this package, in which every word of data is a literal."""

    text: str


@dataclass(frozen=True)
class Cell:
    """One cell: its source, whether that is code, and what the picture it makes shows."""

    source: str
    code: bool = False
    alt: str = ""


#: What a placeholder may stand for.
Value: TypeAlias = "str | Sequence[str] | Mapping[str, str] | Mapping[int, str] | Source | tuple[Cell, ...]"


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


def filled(template: str, values: Mapping[str, Value]) -> tuple[Cell, ...]:
    """Return the cells of a template, filled.

    Parameters
    ----------
    template : str
        Name of a file in ``templates``, without its ending.
    values : mapping
        What its placeholders stand for.
    """
    text = (resources.files("underlay.report") / "templates" / f"{template}.md").read_text(encoding="utf-8")
    cells: list[Cell] = []
    for cell in _cells(text):
        if cell.code:
            source = Template(cell.source).substitute(
                {name: _literal(value) for name, value in values.items()}
            )
            cells.append(Cell(source.strip("\n"), code=True, alt=cell.alt))
        else:
            cells += _filled_words(cell.source, values)
    return tuple(cell for cell in cells if cell.source)


def with_sections(notebook: Any, sections: Iterable[str]) -> Any:
    """Return a notebook with further sections at its end, each the text of a template without placeholders."""
    cells = (cell for text in sections for cell in _cells(text) if cell.source)
    for cell in cells:
        notebook.cells.append(_entry(cell, len(notebook.cells)))
    return notebook


def make_notebook(cells: Sequence[Cell], title: str) -> Any:
    """Return cells as a notebook, not executed, of which `title` is a part of its metadata.

    Raises
    ------
    MissingExtraError
        If the extra ``report`` is not installed.
    """
    v4 = report_library("nbformat").v4
    made = [_entry(cell, number) for number, cell in enumerate(cells)]
    kernel = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    return v4.new_notebook(cells=made, metadata={**kernel, "title": one_line(title, _LONGEST)})


def _entry(cell: Cell, number: int) -> Any:
    v4 = report_library("nbformat").v4
    entry = v4.new_code_cell(cell.source) if cell.code else v4.new_markdown_cell(cell.source)
    # Without this every notebook gets random names for its cells, and no two reports are alike.
    entry["id"] = f"cell-{number}"
    if cell.alt:
        entry["metadata"]["alt"] = cell.alt
    return entry


def _cells(text: str) -> Iterator[Cell]:
    """Split a template; what is between two fences may be empty."""
    end = 0
    for fence in _FENCE.finditer(text):
        yield Cell(text[end : fence.start()].strip())
        alt = _ALT.search(fence["info"])
        yield Cell(fence["code"].strip("\n"), code=True, alt=alt.group(1) if alt else "")
        end = fence.end()
    yield Cell(text[end:].strip())


def _filled_words(text: str, values: Mapping[str, Value]) -> Iterator[Cell]:
    """Fill Markdown; where a placeholder alone on a line stands for cells, they come in its place."""
    words = {name: markdown_text(value, _LONGEST) for name, value in values.items()}
    begin = 0
    for part in _PART.finditer(text):
        inner = values[part[1]]
        if isinstance(inner, tuple):
            yield Cell(Template(text[begin : part.start()].strip()).substitute(words))
            yield from inner
            begin = part.end()
    yield Cell(Template(text[begin:].strip()).substitute(words))


def _literal(value: Value) -> str:
    return value.text if isinstance(value, Source) else repr(value)
