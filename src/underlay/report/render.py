"""Reports: a notebook made for a result, executed, kept, and shown as one HTML page."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from underlay._files import require_writable_folder, write_atomic
from underlay.errors import InputError
from underlay.inference.fit_result import Fit
from underlay.report.execution import execute
from underlay.report.notebook import make_notebook, report_library
from underlay.report.page import html_page
from underlay.report.problem_source import problem_source, write_inputs

__all__ = ["file_notebook", "report", "write_report"]


def report(result: Fit, path: str | os.PathLike[str] = "report.html") -> Path:
    """Write a report of a fit: one HTML file, and beside it the executed notebook and what went in.

    Parameters
    ----------
    result : Fit
        What `fit` returned.
    path : path, default "report.html"
        The page. The notebook gets the same name with the ending ``.ipynb``; curves and scenes go into a
        folder of that name and the ending ``.inputs``, from which the notebook repeats the fit.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    MissingExtraError
        If the extra ``report`` is not installed.
    InputError
        If `path` does not end in ``.html``, or `result` is not a fit.
    FileAccessError
        If the folder cannot be written.
    FitError
        If the notebook does not run.
    """
    target = page_path(path)
    if not isinstance(result, Fit):
        raise InputError(f"a report is made of a Fit; got {type(result).__name__}")
    files = write_inputs(result.problem, target.parent / f"{target.stem}.inputs")
    names = [file.relative_to(target.parent).as_posix() for file in files]
    name = result.curves[0].metadata.get("name") or "one curve"
    notebook = make_notebook(
        "fit",
        {
            "title": f"Indentation of a layer: {name}",
            "load": problem_source(result.problem, names),
            "facts": repr({"to repeat": f"run {target.stem}.ipynb", "random numbers": "none"}),
            "files": ", ".join(map(repr, names)),
        },
    )
    return write_report(notebook, target)


def file_notebook(
    curve: str | os.PathLike[str], scene: str | os.PathLike[str], folder: Path, command: str
) -> Any:
    """Return the notebook, not executed, that fits a curve file as a scene file says.

    Parameters
    ----------
    curve, scene : path
        The files.
    folder : Path
        Where the notebook will stand: it names the files from there.
    command : str
        What repeats it.
    """
    names = [Path(os.path.relpath(name, folder)).as_posix() for name in (curve, scene)]
    return make_notebook(
        "fit",
        {
            "title": f"Indentation of a layer: {Path(curve).name}",
            "load": f"problem = ul.load_problem({names[0]!r}, {names[1]!r})",
            "facts": repr({"to repeat": command, "random numbers": "none"}),
            "files": ", ".join(map(repr, names)),
        },
    )


def write_report(notebook: Any, path: Path) -> Path:
    """Execute a notebook, write it beside `path`, and write its page to `path`."""
    executed = execute(notebook, path.parent)
    write_atomic(path.with_suffix(".ipynb"), notebook_text(executed))
    return write_atomic(path, html_page(executed))


def notebook_text(notebook: Any) -> str:
    """Return a notebook as the text of its file."""
    return str(report_library("nbformat").writes(notebook)) + "\n"


def page_path(path: str | os.PathLike[str]) -> Path:
    """Return `path` as a place where a page can be written.

    Raises
    ------
    InputError
        If it does not end in ``.html``.
    FileAccessError
        If its folder cannot be written.
    """
    target = Path(path).absolute()
    if target.suffix.lower() not in {".html", ".htm"}:
        raise InputError(f"a report is an HTML file, e.g. report.html; got {target.name!r}")
    require_writable_folder(target.parent)
    return target
