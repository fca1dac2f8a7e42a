"""A problem as files and Python source: what a notebook needs to state it again, to the last bit."""

from __future__ import annotations

import math
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from typing import Any

from underlay._files import require_own_folder, write_atomic
from underlay._text import comment_line
from underlay.data.curve import Curve
from underlay.data.readers.delimited import COMMENTED_NUMBERS
from underlay.data.recorded import RECORDED, recorded
from underlay.inference.priors.prior import Prior
from underlay.inference.problem import Problem
from underlay.mechanics.solver import Solver
from underlay.mechanics.solvers import Auto, solver_record
from underlay.report.measured import beyond_loading
from underlay.scene.noise import Noise

__all__ = ["problem_source", "write_inputs", "write_measured"]


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
