"""Notebooks from templates, executed, and as one HTML page.

Notebooks from templates: Markdown with fenced Python, split into cells first and filled cell by cell.

A template is a page of Markdown. Each fenced block that starts with three backticks and ``python`` becomes a
code cell; what stands between two of them becomes a Markdown cell. Words after ``python`` say how the cell
looks in a report: ``alt="..."`` describes the picture it makes.

A placeholder such as ``${title}`` stands for data. Because the cells are there before the data come, no data
can begin or end one. In code a placeholder becomes the literal of its value, in Markdown one line of words
without markup. Two kinds of value are not data: `Source`, which is Python written by this package, and cells
of another template, which take the place of a placeholder that stands alone on a line of Markdown.

Execute a notebook with the Python that runs this, and say in one line what stopped it.

An executed notebook as one HTML page: pictures inside, no script, nothing fetched.
"""

from __future__ import annotations

import importlib
import os
import re
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from string import Template
from types import ModuleType
from typing import Any, TypeAlias

from underlay._text import one_line
from underlay.errors import FitError, missing_extra
from underlay.report.spoken import markdown_text

__all__ = [
    "Cell",
    "Source",
    "Value",
    "execute",
    "filled",
    "html_page",
    "import_path",
    "make_notebook",
    "report_library",
    "with_sections",
]

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
        raise missing_extra(f"a report needs {name}", "report") from error


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


# A cell that takes longer than this hangs; the slowest cell of a report takes seconds.
_LONGEST_CELL = 600


def execute(notebook: Any, folder: Path) -> Any:
    """Run all cells of a notebook in `folder` and return it with its outputs.

    Raises
    ------
    MissingExtraError
        If the extra ``report`` is not installed.
    FitError
        If a cell fails; says which error it was.
    """
    client = report_library("nbclient")
    report_library("ipykernel")
    try:
        with tempfile.TemporaryDirectory(prefix="underlay-") as own, (Path(own) / "log").open("w") as log:
            runner = client.NotebookClient(notebook, km=_kernel_manager(own, folder), timeout=_LONGEST_CELL)
            # What the kernel says of itself is not what a user asked for. It is ours, so the runner ends it.
            runner.execute(cwd=own, env=_environment(own, folder), stderr=log, cleanup_kc=True)
    except client.exceptions.CellExecutionError as error:
        raise FitError(f"the notebook of the report stopped: {error.ename}: {error.evalue}") from error
    except client.exceptions.DeadKernelError as error:
        raise FitError(f"the Python that makes the report ended: {error}") from error
    except client.exceptions.CellTimeoutError as error:
        raise FitError(
            f"a cell of the report ran longer than {_LONGEST_CELL} s; run the notebook by hand"
        ) from error
    return notebook


# Variables that have a Python run something else first, or go on after its program.
_NOT_HANDED_ON = frozenset({"PYTHONSTARTUP", "PYTHONINSPECT"})


def _environment(own: str, folder: Path) -> dict[str, str]:
    """Environment of the kernel: the caller's, but nothing that lies in a folder of data is imported or run."""
    theirs = {name: value for name, value in os.environ.items() if name not in _NOT_HANDED_ON}
    return theirs | {
        "PYTHONPATH": os.pathsep.join(import_path(folder)),
        # Python then does not put the folder it is started in on its path; what it starts inherits that.
        "PYTHONSAFEPATH": "1",
        "MPLBACKEND": "module://matplotlib_inline.backend_inline",
        # An empty profile: no start-up files and no settings of the user's own notebooks.
        "IPYTHONDIR": os.path.join(own, "ipython"),  # noqa: PTH118  a name, not a file
    }


def import_path(folder: Path) -> list[str]:
    """Search path of this process, so that the kernel imports the same packages, without folders of data.

    Left out are `folder`, the working directory, that of the script that runs, and relative entries: a
    ``pandas.py`` that lies beside a curve is not pandas. The folder underlay was loaded from comes last.
    """
    script = getattr(sys.modules.get("__main__"), "__file__", None)
    data = {folder.resolve(), Path.cwd().resolve()} | ({Path(script).resolve().parent} if script else set())
    own = Path(__file__).resolve().parents[2]
    entries = [Path(entry) for entry in sys.path if entry]
    found = [entry for entry in entries if entry.is_absolute() and entry.resolve() not in data | {own}]
    return [os.fspath(entry) for entry in (*found, own)]


def _kernel_manager(own: str, folder: Path) -> Any:
    """Manager of a kernel of this very Python: an installed kernel named python3 may be another one's."""
    manager = report_library("jupyter_client.manager")
    spec = report_library("jupyter_client.kernelspec")
    command = [sys.executable, "-m", "underlay.report.kernel", os.fspath(folder), "-f", "{connection_file}"]
    # All that the two say to each other stays in a folder of their own.
    kernel = manager.AsyncKernelManager(connection_file=os.path.join(own, "kernel.json"))  # noqa: PTH118  a name
    if os.name == "posix":
        # Sockets in the file system: no port is opened for a report.
        kernel.transport, kernel.ip = "ipc", os.path.join(own, "kernel")  # noqa: PTH118  a prefix, not a file
    kernel._kernel_spec = spec.KernelSpec(argv=command, display_name="underlay", language="python")  # noqa: SLF001  no public way to name a command
    return kernel


_TEMPLATES = Path(__file__).parent / "templates"


# What words and tables are made of. Anything else in them is shown as text, not acted on.
_WORDS = ("h1", "h2", "h3", "h4", "p", "br", "hr", "strong", "em", "code", "pre", "sub", "sup")


_BLOCKS = ("ul", "ol", "li", "blockquote", "div", "span", "table", "thead", "tbody", "tr", "th", "td")


_ATTRIBUTES = {"*": ["id"], "th": ["scope"]}


# pandas writes one before each table; the page has its own.
_TABLE_STYLE = re.compile(r"<style scoped>.*?</style>", re.DOTALL)


def html_page(notebook: Any) -> str:
    """Return the page of an executed notebook.

    Raises
    ------
    MissingExtraError
        If the extra ``report`` is not installed.
    """
    exporter = report_library("nbconvert").HTMLExporter(
        template_name="page",
        extra_template_basedirs=[str(_TEMPLATES)],
        exclude_anchor_links=True,
    )
    exporter.register_filter("safe_html", _safe_html)
    style = (_TEMPLATES / "page" / "page.css").read_text(encoding="utf-8")
    body, _ = exporter.from_notebook_node(notebook, resources={"page_style": style})
    return str(body)


def _safe_html(text: str) -> str:
    """Return markup with what a report does not need shown as text: names of files and notes are in it."""
    cleaned = report_library("bleach").clean(
        _TABLE_STYLE.sub("", text), tags={*_WORDS, *_BLOCKS}, attributes=_ATTRIBUTES
    )
    return str(cleaned)
