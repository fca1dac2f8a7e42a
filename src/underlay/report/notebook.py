"""Jupyter notebooks that a user can continue from: made from templates, and executed.

A template is a page of Markdown. Each fenced block that starts with three backticks and ``python`` becomes a code
cell; the text between two of them becomes a Markdown cell.

A placeholder such as ``${title}`` stands for data. The template is split into cells before placeholders are filled,
so that no data can begin or end a cell. In code a placeholder becomes the Python literal of its value, in Markdown
one line of text without markup.

The notebook runs in a process of its own: ``python -m underlay.report.notebook FOLDER -f CONNECTION``.
"""

from __future__ import annotations

import importlib
import os
import re
import sys
import tempfile
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from string import Template
from types import ModuleType
from typing import Any, NamedTuple

from underlay._files import write_atomic
from underlay._text import one_line
from underlay.errors import FitError, missing_extra

_FENCE = re.compile(r"^```python\n(.*?)^```\s*$", re.DOTALL | re.MULTILINE)
# Marks of Markdown, of HTML and of addresses that become links by themselves. One underscore between letters,
# as file names have it, marks nothing. A dollar or a backslash would still begin mathematics in a notebook
# if it were written as an entity: only code is left alone there.
_MARKS = re.compile(r"[`*\[\]<>&~!|#@]|(?<![^\W_])_|_(?![^\W_])|(?<=:)/|(?<=www)\.", re.IGNORECASE)
_MATHEMATICS = re.compile(r"[$\\]+")
# Letters: the longest file name has 255.
_LONGEST = 300
# A cell that takes longer than this hangs; the slowest cell of a template takes seconds.
_LONGEST_CELL = 600
# Variables that have a Python run something else first, or go on after its program.
_NOT_HANDED_ON = frozenset({"PYTHONSTARTUP", "PYTHONINSPECT"})


class Cell(NamedTuple):
    """One cell of a notebook: its source, and whether that is code (otherwise Markdown)."""

    source: str
    code: bool = False


def report_library(name: str) -> ModuleType:
    """Import and return one of the libraries of the extra ``report``, by its module name.

    Raises
    ------
    MissingExtraError
        If it is not installed.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise missing_extra(f"a notebook needs {name}", "report") from error


def write_notebook(template: str, values: Mapping[str, str], path: Path) -> Path:
    """Fill a template, run it in the folder of `path`, and write it there with its outputs.

    Parameters
    ----------
    template : str
        Name of a file in ``templates``, without its ending.
    values : mapping of str to str
        What its placeholders stand for; ``title`` is also the title of the notebook.
    path : Path
        The notebook file (``.ipynb``) to write.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    MissingExtraError
        If the extra ``report`` is not installed.
    FitError
        If a cell fails.
    """
    made = execute(make_notebook(filled(template, values), values["title"]), path.parent)
    return write_atomic(path, str(report_library("nbformat").writes(made)) + "\n")


def filled(template: str, values: Mapping[str, str]) -> tuple[Cell, ...]:
    """Return the cells of a template with its placeholders filled.

    Parameters
    ----------
    template : str
        Name of a file in ``templates``, without its ending.
    values : mapping of str to str
        What its placeholders stand for.
    """
    text = (resources.files("underlay.report") / "templates" / f"{template}.md").read_text(encoding="utf-8")
    in_code = {name: repr(value) for name, value in values.items()}
    in_words = {name: markdown_text(value, _LONGEST) for name, value in values.items()}
    # What the pattern captures, the code, stands at the odd places.
    cells = [Cell(part.strip(), code=bool(place % 2)) for place, part in enumerate(_FENCE.split(text))]
    return tuple(
        Cell(Template(cell.source).substitute(in_code if cell.code else in_words), cell.code)
        for cell in cells
        if cell.source
    )


def make_notebook(cells: tuple[Cell, ...], title: str) -> Any:
    """Return cells as an ``nbformat`` notebook, not executed; `title` goes into its metadata.

    Raises
    ------
    MissingExtraError
        If the extra ``report`` is not installed.
    """
    v4 = report_library("nbformat").v4
    made = [
        v4.new_code_cell(cell.source) if cell.code else v4.new_markdown_cell(cell.source) for cell in cells
    ]
    for number, entry in enumerate(made):
        # Without this every notebook gets random names for its cells, and no two are alike.
        entry["id"] = f"cell-{number}"
    kernel = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    return v4.new_notebook(cells=made, metadata={**kernel, "title": one_line(title, _LONGEST)})


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
        raise FitError(f"the notebook stopped: {error.ename}: {error.evalue}") from error
    except client.exceptions.DeadKernelError as error:
        raise FitError(f"the Python that runs the notebook ended: {error}") from error
    except client.exceptions.CellTimeoutError as error:
        raise FitError(
            f"a cell of the notebook ran longer than {_LONGEST_CELL} s; run the notebook by hand"
        ) from error
    return notebook


def _environment(own: str, folder: Path) -> dict[str, str]:
    """Return the environment variables of the kernel: the caller's, made safe against files in a folder of data.

    `own` is the kernel's temporary folder, `folder` that of the notebook. No file of a data folder is imported or
    run.
    """
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
    """Return the import path of this process without folders of data, for a kernel to import the same packages.

    Left out are `folder`, the working directory, that of the running script, and relative entries: a ``pandas.py``
    beside a curve must not be imported as pandas. The folder underlay was loaded from comes last.
    """
    script = getattr(sys.modules.get("__main__"), "__file__", None)
    data = {folder.resolve(), Path.cwd().resolve()} | ({Path(script).resolve().parent} if script else set())
    own = Path(__file__).resolve().parents[2]
    entries = [Path(entry) for entry in sys.path if entry]
    found = [entry for entry in entries if entry.is_absolute() and entry.resolve() not in data | {own}]
    return [os.fspath(entry) for entry in (*found, own)]


def _kernel_manager(own: str, folder: Path) -> Any:
    """Return a manager that starts the kernel with this very Python; an installed "python3" kernel may be another.

    `own` is the kernel's temporary folder, `folder` that of the notebook.
    """
    manager = report_library("jupyter_client.manager")
    spec = report_library("jupyter_client.kernelspec")
    command = [sys.executable, "-m", "underlay.report.notebook", os.fspath(folder), "-f", "{connection_file}"]
    # All that the two say to each other stays in a folder of their own.
    kernel = manager.AsyncKernelManager(connection_file=os.path.join(own, "kernel.json"))  # noqa: PTH118  a name
    if os.name == "posix":
        # Sockets in the file system: no port is opened for a notebook.
        kernel.transport, kernel.ip = "ipc", os.path.join(own, "kernel")  # noqa: PTH118  a prefix, not a file
    kernel._kernel_spec = spec.KernelSpec(argv=command, display_name="underlay", language="python")  # noqa: SLF001  no public way to name a command
    return kernel


def markdown_text(text: object, longest: int | None = None) -> str:
    """Return `text` as one line of Markdown that shows it literally: no markup, no link, no formula.

    Parameters
    ----------
    text : object
        Text from a file, or a name.
    longest : int, optional
        Number of characters to which it is cut; as in `one_line`.
    """
    plain = _MARKS.sub(lambda mark: f"&#{ord(mark[0])};", one_line(text, longest))
    return _MATHEMATICS.sub(lambda mark: f"`{mark[0]}`", plain)


def _run_kernel(folder: str, *told: str) -> None:
    """Run the Jupyter kernel of one notebook in `folder`, until it is ended; `told` are the kernel's arguments.

    The process was started in an empty folder: no module in `folder` is imported, no file there read as a setting.
    """
    # matplotlib takes its settings from the folder in which it is first imported: here the empty one.
    import matplotlib as mpl  # noqa: F401, PLC0415  its settings
    from ipykernel.kernelapp import IPKernelApp  # noqa: PLC0415  this process alone

    os.chdir(folder)
    # The folder is not put on the path, nor is what a user's own sessions remember.
    IPKernelApp.launch_instance(
        [*told, "--InteractiveShellApp.ignore_cwd=True", "--HistoryManager.enabled=False"]
    )


if __name__ == "__main__":
    _run_kernel(*sys.argv[1:])
