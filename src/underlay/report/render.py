"""Reports: a notebook made for a result, executed, kept, and shown as one HTML page."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from underlay._files import require_writable_folder, write_atomic
from underlay.errors import InputError
from underlay.inference.fitting.fit_result import Fit
from underlay.inference.from_files import load_problem
from underlay.inference.problem import Problem
from underlay.inference.sampling.posterior import Posterior
from underlay.report.execution import execute
from underlay.report.measured import beyond_loading, segments_part
from underlay.report.notebook import make_notebook, report_library, template_text
from underlay.report.page import html_page
from underlay.report.problem_source import problem_source, write_inputs, write_measured

__all__ = [
    "file_notebook",
    "map_notebook",
    "notebook_text",
    "page_path",
    "posterior_notebook",
    "report",
    "write_report",
]


def report(
    result: Fit | Posterior | pd.DataFrame,
    path: str | os.PathLike[str] = "report.html",
    *,
    problem: Problem | None = None,
) -> Path:
    """Write a report: one HTML file, and beside it the executed notebook and what went in.

    Parameters
    ----------
    result : Fit, Posterior or DataFrame
        What `fit`, `sample` or `fit_many` returned.
    path : path, default "report.html"
        The page. The notebook gets the same name with the ending ``.ipynb``; what went in is kept in a folder
        of that name and the ending ``.inputs``. From there the notebook repeats a fit; a posterior, which may
        have taken hours, is kept there as it is.
    problem : Problem, optional
        What was sampled: a posterior does not hold its scene, and its report shows one only with it.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    MissingExtraError
        If the extra ``report`` is not installed.
    InputError
        If `path` does not end in ``.html``, `result` is neither, or `problem` is not that of the posterior.
    FileAccessError
        If the folder cannot be written.
    FitError
        If the notebook does not run.
    """
    target = page_path(path)
    report_library("nbclient")
    inputs = target.parent / f"{target.stem}.inputs"
    repeat = {"to repeat": f"run {target.stem}.ipynb"}
    if isinstance(result, pd.DataFrame):
        table = require_writable_folder(inputs) / "map.csv"
        write_atomic(table, result.to_csv(index=False))
        return write_report(_map_notebook("all sites", repeat, f"{inputs.name}/{table.name}"), target)
    if isinstance(result, Fit):
        problem = result.problem
    elif not isinstance(result, Posterior):
        raise InputError(f"a report is of a Fit, a Posterior or a map; got {type(result).__name__}")
    elif problem is not None and problem.names != result.names:
        raise InputError(
            f"this posterior is of {', '.join(result.names)}; the problem frees {', '.join(problem.names)}"
        )
    if problem is not None:
        repeat |= _origins(problem)
    files = [] if problem is None else write_inputs(problem, inputs)
    names = [file.relative_to(target.parent).as_posix() for file in files]
    measured = {} if problem is None else write_measured(problem, inputs)
    wholes = {number: file.relative_to(target.parent).as_posix() for number, file in measured.items()}
    load = "" if problem is None else problem_source(problem, names)
    name = "one curve" if problem is None else _title(problem)
    if isinstance(result, Fit):
        notebook = _fit_notebook(name, load, repeat, names, segments_part(wholes))
    else:
        saved = require_writable_folder(inputs) / "posterior.npz"
        result.save(saved)
        names = [saved.relative_to(target.parent).as_posix(), *names]
        notebook = _posterior_notebook(name, load, repeat, names, segments_part(wholes))
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
    names = [_seen_from(folder, path) for path in (curve, scene)]
    segments = _file_segments(curve, scene)
    return _fit_notebook(Path(curve).name, _load_source(names), {"to repeat": command}, names, segments)


def posterior_notebook(
    posterior: str | os.PathLike[str],
    folder: Path,
    command: str,
    files: tuple[str | os.PathLike[str], str | os.PathLike[str]] | None = None,
) -> Any:
    """Return the notebook, not executed, of a saved posterior; see `file_notebook`.

    `files` are the curve and the scene file that were sampled, if they are to be shown.
    """
    names = [_seen_from(folder, path) for path in (posterior, *(files or ()))]
    load = _load_source(names[1:]) if files else ""
    title = Path(files[0]).name if files else Path(posterior).name
    segments = _file_segments(*files) if files else ""
    return _posterior_notebook(title, load, {"to repeat": command}, names, segments)


def map_notebook(table: str | os.PathLike[str], folder: Path, command: str) -> Any:
    """Return the notebook, not executed, of the table of a map; see `file_notebook`."""
    return _map_notebook(Path(table).name, {"to repeat": command}, _seen_from(folder, table))


def _map_notebook(name: str, facts: Mapping[str, str], table: str) -> Any:
    return make_notebook(
        "map",
        {
            "title": f"A map of indentation tests: {name}",
            "table": repr(table),
            "facts": repr(dict(facts)),
            "files": repr(table),
        },
    )


def _fit_notebook(name: str, load: str, facts: Mapping[str, str], files: Sequence[str], segments: str) -> Any:
    return make_notebook(
        "fit",
        {
            "title": f"Indentation of a layer: {name}",
            "load": load,
            "segments_part": segments,
            "facts": repr({**facts, "random numbers": "none"}),
            "files": ", ".join(map(repr, files)),
        },
    )


def _posterior_notebook(
    name: str, load: str, facts: Mapping[str, str], files: Sequence[str], segments: str
) -> Any:
    return make_notebook(
        "posterior",
        {
            "title": f"Uncertainty of an indentation test: {name}",
            "posterior": repr(files[0]),
            "load": load,
            "segments_part": segments,
            "scene_part": template_text("posterior_scene") if load else "",
            "facts": repr(dict(facts)),
            "files": ", ".join(map(repr, files)),
        },
    )


def _title(problem: Problem) -> str:
    name = problem.curves[0].metadata.get("name") or "one curve"
    more = len(problem.curves) - 1
    return f"{name} and {more} more" if more else str(name)


def _origins(problem: Problem) -> dict[str, str]:
    """Which files the curves of a problem were read from, before they were copied."""
    known = [(curve.metadata.get("path"), curve.metadata.get("sha256")) for curve in problem.curves]
    return {
        f"curve {n} taken from": f"{path}, SHA-256 {sha}" for n, (path, sha) in enumerate(known, 1) if path
    }


def _file_segments(curve: str | os.PathLike[str], scene: str | os.PathLike[str]) -> str:
    """Return the part that draws the segments of a curve file, if it holds more than loading."""
    part = load_problem(curve, scene).curves[0]
    return segments_part(None if beyond_loading(part) is not None else {})


def _load_source(names: Sequence[str]) -> str:
    return f"problem = ul.load_problem({names[0]!r}, {names[1]!r})"


def _seen_from(folder: Path, path: str | os.PathLike[str]) -> str:
    return Path(os.path.relpath(path, folder)).as_posix()


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
