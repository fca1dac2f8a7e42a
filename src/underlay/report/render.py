"""Reports: a notebook made for a result, executed, kept, and shown as one HTML page.

A problem as files and Python source: what a notebook needs to state it again, to the last bit.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd

from underlay._csv import csv_text
from underlay._files import require_own_folder, require_writable_folder, write_atomic
from underlay._text import comment_line
from underlay.data.curve import RECORDED, Curve, recorded
from underlay.data.readers.delimited import COMMENTED_NUMBERS
from underlay.errors import InputError
from underlay.inference.from_files import load_problem
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.priors import Prior
from underlay.inference.problem import Problem
from underlay.inference.sampling.posterior import Posterior
from underlay.mechanics.solver import Solver
from underlay.mechanics.solvers import Auto, solver_record
from underlay.report.adhesion_tables import adhesion_part
from underlay.report.fit_files import pointwise_part
from underlay.report.notebook import (
    Cell,
    Source,
    Value,
    execute,
    filled,
    html_page,
    make_notebook,
    report_library,
    with_sections,
)
from underlay.report.reading import beyond_loading, segments_of_file, segments_part
from underlay.scene.noise import Noise
from underlay.scene.scene import Scene, has_face
from underlay.scene.scene_file import read_scene_file

__all__ = [
    "file_notebook",
    "map_notebook",
    "notebook_text",
    "page_path",
    "posterior_notebook",
    "problem_source",
    "report",
    "require_same_parameters",
    "write_inputs",
    "write_measured",
    "write_report",
]


def write_inputs(problem: Problem, folder: Path) -> list[Path]:
    """Write every curve and scene of a problem into `folder`; return the files, curve and scene in turn.

    Raises
    ------
    FileAccessError
        If the folder cannot be written.
    """
    require_own_folder(folder)
    written = []
    for number, (curve, scene) in enumerate(zip(problem.curves, problem.base_scenes, strict=True), start=1):
        written.append(write_atomic(folder / f"curve-{number}.csv", _exact_csv(curve)))
        written.append(scene.save(folder / f"scene-{number}.toml"))
    return written


def write_measured(problem: Problem, folder: Path) -> dict[int, Path]:
    """Write into `folder` each whole curve that holds more than loading; return the files by number from 1.

    Raises
    ------
    FileAccessError
        If the folder cannot be written.
    """
    wholes = {number: beyond_loading(curve) for number, curve in enumerate(problem.curves, start=1)}
    found = {number: whole for number, whole in wholes.items() if whole is not None}
    if found:
        require_own_folder(folder)
    return {
        number: write_atomic(folder / f"measured-{number}.csv", _exact_csv(whole))
        for number, whole in found.items()
    }


def problem_source(problem: Problem, files: list[str]) -> str:
    """Return Python source that builds `problem` as a variable of that name from files of `write_inputs`.

    Raises
    ------
    InputError
        If its solver is not part of underlay.
    """
    solver_record(problem.solver)
    stated = [prior for prior in problem.free.values() if isinstance(prior, Prior)]
    classes = sorted({(kind.__module__, kind.__name__) for prior in stated for kind in _classes(prior)})
    lines = [f"from {module} import {name}" for module, name in classes]
    pairs = list(zip(files[::2], files[1::2], strict=True))
    free = "\n".join(f"        {path!r}: {source_of(prior)}," for path, prior in problem.free.items())
    keywords = {
        "noise": problem.noise,
        "solver": problem.solver,
    }
    defaults = {"noise": None, "solver": Auto()}
    given = "".join(
        f"    {name}={source_of(value)},\n" for name, value in keywords.items() if value != defaults[name]
    )
    if len(pairs) == 1:
        curve, scene = pairs[0]
        lines += [f"scene = ul.load_scene({scene!r})", f"curve = ul.read({curve!r})"]
        head, shared = "problem = ul.Problem(\n    scene,\n    curve,\n", ""
    else:
        tests = "\n".join(f"    (ul.load_scene({scene!r}), ul.read({curve!r}))," for curve, scene in pairs)
        lines.append(f"tests = [\n{tests}\n]")
        head, shared = "problem = ul.Problem.joint(\n    tests,\n", f"    shared={list(problem.shared)!r},\n"
    lines.append(f"{head}    free={{\n{free}\n    }},\n{shared}{given})")
    return "\n".join(lines)


def source_of(value: Any) -> str:
    """Return Python source of a plain value, a prior, a noise model or a solver."""
    if is_dataclass(value):
        name = type(value).__name__
        prefix = "ul." if isinstance(value, Noise | Solver) else ""
        arguments = ", ".join(
            f"{field.name}={source_of(getattr(value, field.name))}"
            for field in fields(value)
            if field.init and (field.default is MISSING or getattr(value, field.name) != field.default)
        )
        return f"{prefix}{name}({arguments})"
    if isinstance(value, float) and not math.isfinite(value):
        return f'float("{value}")'
    if isinstance(value, float):
        return repr(float(value))
    if isinstance(value, list | tuple):
        inner = ", ".join(source_of(entry) for entry in value)
        comma = "," if len(value) == 1 else ""
        return f"({inner}{comma})" if isinstance(value, tuple) else f"[{inner}]"
    return repr(value)


def _classes(prior: Any) -> list[type]:
    """Its own class and those of the priors inside."""
    inner = [getattr(prior, field.name) for field in fields(prior)]
    return [type(prior), *(kind for part in inner if is_dataclass(part) for kind in _classes(part))]


def _exact_csv(curve: Curve) -> str:
    """Return a curve as a table in SI units that reads back to the last bit."""
    columns = {"time (s)": curve.time, "depth (m)": curve.depth, "force (N)": curve.force}
    held = {name: [repr(float(x)) for x in values] for name, values in columns.items() if values is not None}
    if curve.segment is not None:
        held["segment"] = [str(label) for label in curve.segment]
    origin = [
        comment_line(f"{word}: {curve.metadata[key]}")
        for word, key in (("taken from", "path"), ("its sha256", "sha256"))
        if curve.metadata.get(key)
    ]
    told = recorded(curve)
    origin += [comment_line(f"{RECORDED}{told}")] if told else []
    # What the file says of the test goes with the copy: see the numbers that the reader of tables knows.
    origin += [
        f"# {key.replace('_', ' ')}: {float(curve.metadata[key])!r} {unit}"
        for key, unit in COMMENTED_NUMBERS.items()
        if isinstance(curve.metadata.get(key), float)
    ]
    rows = (",".join(row) for row in zip(*held.values(), strict=True))
    return "\n".join([*origin, ",".join(held), *rows]) + "\n"


def report(
    result: Fit | Posterior | pd.DataFrame,
    path: str | os.PathLike[str] = "report.html",
    *,
    problem: Problem | None = None,
    sections: Sequence[str] = (),
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
        What was sampled, for a posterior that does not hold it: one from an older file, say. Without it the
        report says that it cannot show the test.
    sections : sequence of str, optional
        Sections of your own, which end the page: Markdown in which a block fenced by three backticks and
        ``python`` is run and its result shown. There ``ul`` is this package, and ``fit``, ``post`` or ``table``
        what is reported. They are code: pass none that you would not run.

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
        table = require_own_folder(inputs) / "map.csv"
        write_atomic(table, csv_text(result))
        notebook = _map_notebook("all sites", repeat, f"{inputs.name}/{table.name}")
        return write_report(with_sections(notebook, sections), target)
    if isinstance(result, Fit):
        notebook = _fit_report(result, target, inputs, repeat)
        return write_report(with_sections(notebook, sections), target)
    if not isinstance(result, Posterior):
        raise InputError(f"a report is of a Fit, a Posterior or a map; got {type(result).__name__}")
    if problem is not None:
        require_same_parameters(result, problem)
        result = replace(result, problem=problem, missing="")
    saved = require_own_folder(inputs) / "posterior.npz"
    result.save(saved)
    notebook = posterior_notebook(saved, target, repeat["to repeat"])
    return write_report(with_sections(notebook, sections), target)


def require_same_parameters(posterior: Posterior, problem: Problem) -> None:
    """Refuse a problem that is not the one that was sampled.

    Raises
    ------
    InputError
        If its free parameters are others.
    """
    if problem.names != posterior.names:
        raise InputError(
            f"this posterior is of {', '.join(posterior.names)}; the problem frees {', '.join(problem.names)}"
        )


def _fit_report(result: Fit, target: Path, inputs: Path, repeat: Mapping[str, str]) -> Any:
    problem = result.problem
    names = [_seen_from(target.parent, file) for file in write_inputs(problem, inputs)]
    measured = {
        number: _seen_from(target.parent, file) for number, file in write_measured(problem, inputs).items()
    }
    facts = {**repeat, **_origins(problem)}
    load = Source(problem_source(problem, names))
    return _fit_notebook(_title(problem), load, facts, names, segments_part(measured), problem.base_scenes)


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
    scene_file = read_scene_file(scene)
    facts = {"to repeat": command}
    segments = _file_segments(curve, scene)
    return _fit_notebook(Path(curve).name, _load_source(names), facts, names, segments, (scene_file.draft,))


def posterior_notebook(
    posterior: str | os.PathLike[str],
    page: Path,
    command: str,
    files: tuple[str | os.PathLike[str], str | os.PathLike[str]] | None = None,
) -> Any:
    """Return the notebook, not executed, of a saved posterior.

    Parameters
    ----------
    posterior : path
        The file.
    page : Path
        Where the page will be written, the notebook beside it.
    command : str
        What repeats it.
    files : (path, path), optional
        Curve and scene file that were sampled, for a posterior that does not hold its problem.

    Raises
    ------
    InputError
        If `files` are not those of the posterior.
    """
    folder = page.parent
    loaded = Posterior.load(posterior)
    names = [_seen_from(folder, path) for path in (posterior, *(files or ()))]
    facts = {"to repeat": command}
    problem, load, segments = loaded.problem, Source(""), segments_part({})
    if files is not None:
        problem = load_problem(*files)
        require_same_parameters(loaded, problem)
        load, segments = _load_source(names[1:]), _file_segments(*files)
    elif problem is not None:
        load = Source("problem = post.problem")
        facts |= _origins(problem)
        measured = write_measured(problem, page.parent / f"{page.stem}.inputs")
        segments = segments_part({number: _seen_from(folder, file) for number, file in measured.items()})
    scene = (
        filled("posterior_scene", {})
        if problem is not None
        else filled("posterior_missing", {"missing": loaded.missing})
    )
    title = f"Uncertainty of an indentation test: {_posterior_title(problem, posterior, files)}"
    cells = filled(
        "posterior",
        {
            "title": title,
            "posterior": names[0],
            "load": load,
            "segments_part": segments,
            "scene_part": scene,
            "facts": facts,
            "files": names,
        },
    )
    return make_notebook(cells, title)


def _posterior_title(problem: Problem | None, posterior: Any, files: tuple[Any, Any] | None) -> str:
    if files is not None:
        return Path(files[0]).name
    return Path(posterior).name if problem is None else _title(problem)


def map_notebook(table: str | os.PathLike[str], folder: Path, command: str) -> Any:
    """Return the notebook, not executed, of the table of a map; see `file_notebook`."""
    return _map_notebook(Path(table).name, {"to repeat": command}, _seen_from(folder, table))


def _map_notebook(name: str, facts: Mapping[str, str], table: str) -> Any:
    title = f"A map of indentation tests: {name}"
    values: dict[str, Value] = {"title": title, "table": table, "facts": dict(facts), "files": [table]}
    return make_notebook(filled("map", values), title)


def _fit_notebook(
    name: str,
    load: Source,
    facts: Mapping[str, str],
    files: list[str],
    segments: tuple[Cell, ...],
    scenes: Sequence[Scene],
) -> Any:
    title = f"Indentation of a layer: {name}"
    cells = filled(
        "fit",
        {
            "title": title,
            "load": load,
            "segments_part": segments,
            "time_part": filled("relaxation", {}) if any(s.memory is not None for s in scenes) else (),
            "log_part": () if any(s.adhesion is not None for s in scenes) else filled("fit_log", {}),
            "pointwise_part": pointwise_part(scenes),
            "adhesion_part": adhesion_part(scenes),
            "bond_part": filled("bonding", {}) if all(map(has_face, scenes)) else (),
            "facts": {**facts, "random numbers": "none"},
            "files": files,
        },
    )
    return make_notebook(cells, title)


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


def _file_segments(curve: str | os.PathLike[str], scene: str | os.PathLike[str]) -> tuple[Cell, ...]:
    """Return the part that draws the segments of a curve file, if it holds more than loading."""
    part = load_problem(curve, scene).curves[0]
    return segments_part({}) if beyond_loading(part) is None else segments_of_file()


def _load_source(names: Sequence[str]) -> Source:
    return Source(f"problem = ul.load_problem({names[0]!r}, {names[1]!r})")


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
