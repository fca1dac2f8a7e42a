"""Commands that share a result: `report` (a page or an executed notebook) and `cite`."""

from __future__ import annotations

import os
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, NamedTuple, cast

import typer

import underlay as ul
from underlay._door import FileKind, parse_json, read_text, understood
from underlay._files import require_writable_folder, write_atomic
from underlay.cli.console import say, say_table
from underlay.cli.options import OutputFolder
from underlay.errors import InputError

__all__ = ["cite", "report"]

_RECORD = FileKind("a result of underlay fit", 64_000_000, "fit the curve again")
# Two fits of the same points agree to the minimiser's tolerance, with room for another machine's rounding.
_SAME = 1e-6

Results = Annotated[
    list[Path],
    typer.Argument(
        help="What to report: a curve (with --scene), a .fit.json of `underlay fit`, a saved posterior "
        "(.npz; an older one with its curve and --scene), or the table of a map (.csv, .parquet).",
        metavar="RESULT...",
    ),
]


def report(
    results: Results,
    scene: Annotated[
        Path | None, typer.Option("--scene", "-s", help="Scene file (TOML): your test as a file.")
    ] = None,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Page to write; a name that ends in .pdf is printed alone.")
    ] = Path("report.html"),
    pdf: Annotated[
        bool, typer.Option("--pdf", help="Write a PDF, too, printed by an installed Chromium.")
    ] = False,
    details: Annotated[
        bool, typer.Option("--details", help="Unfold what stands behind the page, also in print.")
    ] = False,
    notebook: Annotated[
        Path | None,
        typer.Option(
            "--notebook",
            "--new-notebook",
            help="Write an executed notebook to go on from, in place of the page.",
        ),
    ] = None,
) -> None:
    """Make one A4 page of a result: number, verdict, curve, E by depth, uncertainty budget, methods paragraph.

    Example: `underlay report curve.csv --scene scene.toml --output report.html`

    A posterior saved by `underlay sample` (.npz) contains its scene and curve: name it alone.

    Example: `underlay report curve.csv --scene scene.toml --notebook my_analysis.ipynb`
    """
    from underlay.inference.batch.decisions import is_map, read_map

    command = _command(results, scene, output)
    table = results[0] if len(results) == 1 and is_map(results[0]) else None
    asked = _Asked(None, scene, None, None) if table is not None else _sorted_out(results, scene)
    if notebook is not None:
        _write_notebook(asked, table, notebook)
        return
    from underlay.report.render import page_path

    page_path(output)
    how: dict[str, Any] = {"pdf": pdf, "details": details, "command": command}
    if table is not None:
        written = ul.report(read_map(table), output, files=[table], **how)
    elif asked.posterior is not None:
        written = _of_posterior(asked, output, how)
    else:
        written = ul.report(_fitted(asked), output, **how)
    say(f"wrote {written}")
    if pdf and written.suffix.lower() != ".pdf":
        say(f"wrote {written.with_suffix('.pdf')}")


def _fitted(asked: _Asked) -> ul.Fit:
    """Fit the curve by the scene file; raise an error if a .fit.json was given whose values differ."""
    problem = ul.load_problem(*_curve_and_scene(asked))
    if asked.record is not None:
        _check_curve(asked.record, problem)
    found = ul.fit(problem)
    if asked.record is not None:
        _check_values(asked.record, found)
    return found


def _of_posterior(asked: _Asked, output: Path, how: Mapping[str, Any]) -> Path:
    files = _sampled_files(asked)
    problem = None if files is None else ul.load_problem(*files)
    posterior = cast("Path", asked.posterior)
    return ul.report(ul.Posterior.load(posterior), output, problem=problem, files=[posterior], **how)


class _Record(NamedTuple):
    """Contents of a .fit.json: its path, curve and scene files, SHA-256 of the points, and fitted values (SI)."""

    path: Path
    curve: Path
    scene: Path | None
    data_sha256: str
    values: dict[str, float]


class _Asked(NamedTuple):
    """The files given to `report`, sorted by what they are."""

    curve: Path | None
    scene: Path | None
    posterior: Path | None
    record: _Record | None


def _sorted_out(results: list[Path], scene: Path | None) -> _Asked:
    curve, posterior, record = None, None, None
    for path in results:
        if path.suffix == ".npz":
            posterior = path
        elif path.suffix == ".json":
            record = _read_record(path)
            curve, scene = record.curve, scene or record.scene
        elif path.suffix == ".toml" and scene is None:
            scene = path
        elif curve is not None:
            raise InputError(f"one page is of one curve; got {curve} and {path}. Call it once for each")
        else:
            curve = path
    return _Asked(curve, scene, posterior, record)


def _read_record(path: Path) -> _Record:
    with understood(path, _RECORD):
        document = parse_json(read_text(path, _RECORD))
        curves, values = document["provenance"]["curves"], document["values"]
        only = curves[0]
        texts = (only["data_sha256"], only["path"] or "", only.get("scene_path") or "")
        if not all(isinstance(text, str) for text in texts):
            raise ValueError("its paths and hashes must be texts")
        numbers = {name: float(value) for name, value in values.items()}
    digest, name, scene = texts
    if len(curves) != 1 or not name:
        raise InputError(f"{path} is not of one curve file; report it from Python, where it was made")
    return _Record(path, Path(name), Path(scene) if scene else None, digest, numbers)


def _check_curve(record: _Record, problem: ul.Problem) -> None:
    """Raise an error if the curve has changed since the .fit.json was written: the page would show another fit."""
    from underlay.inference.least_squares.provenance import curve_hash

    if curve_hash(problem.curves[0]) != record.data_sha256:
        raise InputError(f"{record.curve} has changed since {record.path} was made; fit it again")


def _check_values(record: _Record, found: ul.Fit) -> None:
    """Raise an error if the fit differs from the .fit.json, as after a change of the scene file."""
    for name, value in record.values.items():
        same = name in found.values and abs(found.values[name] - value) <= _SAME * abs(value)
        if not same:
            raise InputError(
                f"{record.path} is not the fit of {record.curve} with this scene file ({name} differs); "
                "fit it again"
            )


def _sampled_files(asked: _Asked) -> tuple[Path, Path] | None:
    """Return the curve and scene file given with a posterior; None where neither is."""
    if asked.curve is None and asked.scene is None:
        return None
    if asked.curve is None:
        raise InputError(
            f"name the curve that was sampled too: underlay report {asked.posterior} CURVE --scene"
        )
    return _curve_and_scene(asked)


def _curve_and_scene(asked: _Asked) -> tuple[Path, Path]:
    if asked.curve is None:
        raise InputError("nothing to report: name a curve (with --scene), a .fit.json or a posterior (.npz)")
    if asked.scene is None:
        raise InputError(f"say what was tested: add --scene SCENE.toml for {asked.curve}")
    return asked.curve, asked.scene


def _write_notebook(asked: _Asked, table: Path | None, target: Path) -> None:
    """Write the executed notebook of a curve, a posterior or a map; it names files relative to its own folder."""
    from underlay.report.notebook import write_notebook

    if target.suffix != ".ipynb":
        raise InputError(f"a notebook ends in .ipynb; got {target.name!r}")
    if target.exists():
        raise InputError(f"{target} exists and may hold your work; name another file")
    folder = require_writable_folder(target.absolute().parent)
    if table is not None:
        kind, named = "map", {"table": table}
    elif asked.posterior is not None:
        kind, named = "posterior", {"posterior": asked.posterior}
    else:
        curve, scene = _curve_and_scene(asked)
        # Wrong input is refused here, in one line, before a notebook is started.
        _fitted(asked)
        kind, named = "fit", {"curve": curve, "scene": scene}
    values = {name: Path(os.path.relpath(path, folder)).as_posix() for name, path in named.items()}
    title = next(iter(named.values())).name
    say(f"wrote {write_notebook(kind, {**values, 'title': title}, target.absolute())}")
    say(f"Next: jupyter lab {shlex.quote(str(target))}")


def _command(results: list[Path], scene: Path | None, output: Path) -> str:
    words = ["underlay", "report", *map(str, results)]
    words += ["--scene", str(scene)] if scene else []
    return shlex.join([*words, "--output", str(output)])


def cite(
    result: Annotated[
        Path, typer.Argument(help="A .fit.json, a .posterior.npz or the table of a map.", metavar="RESULT")
    ],
    output: OutputFolder = None,
) -> None:
    """List what to cite of an analysis: the paper, the contact model, the sampler, programs that read files.

    DOIs are given where a source confirms them. With --output the list is written as BibTeX.

    Example: `underlay cite curve.fit.json --output results`
    """
    import pandas as pd

    from underlay.inference.citation import bibtex
    from underlay.inference.cited import cited

    found = cited(result)
    say_table(
        pd.DataFrame([{"for": why, "cite": str(work)} for work, why in found]),
        f"What to cite for {result.name}",
    )
    if output is not None:
        stem = result.name.partition(".")[0]
        say(f"wrote {write_atomic(output / f'{stem}.bib', bibtex(work for work, _ in found))}")
