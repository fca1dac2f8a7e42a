"""`underlay report`: a result as one HTML page and the executed notebook, or a notebook to go on in."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from underlay._door import FileKind, parse_json, read_text, understood
from underlay._files import write_atomic
from underlay.cli.console import say
from underlay.errors import InputError

if TYPE_CHECKING:
    from underlay.inference.problem import Problem

__all__ = ["report"]

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
    output: Annotated[Path, typer.Option("--output", "-o", help="Page to write.")] = Path("report.html"),
    new_notebook: Annotated[
        Path | None,
        typer.Option(
            "--new-notebook",
            help="Write a notebook for CURVE and SCENE instead, to go on in; nothing is executed.",
        ),
    ] = None,
) -> None:
    """Make one self-contained HTML page of a result; the executed notebook is kept beside it.

    Example: `underlay report curve.csv --scene scene.toml --output report.html`

    What `underlay sample` kept (.npz) holds its scene and curve: name it alone.

    Example: `underlay report --new-notebook my_analysis.ipynb curve.csv scene.toml`
    """
    from underlay.inference.from_files import load_problem
    from underlay.report.maps import is_map, read_map
    from underlay.report.render import file_notebook, map_notebook, page_path, posterior_notebook

    if new_notebook is not None:
        say(f"wrote {_write_new(results, scene, new_notebook)}")
        say(f"Next: jupyter lab {shlex.quote(str(new_notebook))}")
        return
    target = page_path(output)
    command = _command(results, scene, output)
    if len(results) == 1 and is_map(results[0]):
        read_map(results[0])
        _finish(map_notebook(results[0], target.parent, command), target)
        return
    asked = _sorted_out(results, scene)
    if asked.posterior is not None:
        notebook = posterior_notebook(asked.posterior, target, command, _sampled_files(asked))
    else:
        curve, scene_file = _curve_and_scene(asked)
        # Wrong input is refused here, in one line, before a notebook is started.
        problem = load_problem(curve, scene_file)
        if asked.record is not None:
            _check_record(asked.record, problem)
        notebook = file_notebook(curve, scene_file, target.parent, command)
    _finish(notebook, target)


def _finish(notebook: Any, target: Path) -> None:
    from underlay.report.render import write_report

    say(f"wrote {write_report(notebook, target)}")
    say(f"wrote {target.with_suffix('.ipynb')}")


class _Record(NamedTuple):
    """What a .fit.json says of where it came from."""

    path: Path
    curve: Path
    scene: Path | None
    data_sha256: str
    values: dict[str, float]


class _Asked(NamedTuple):
    """The results by what they are."""

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
        raise InputError(f"{path} is not of one curve file; call underlay.report(fit) where it was made")
    return _Record(path, Path(name), Path(scene) if scene else None, digest, numbers)


def _check_record(record: _Record, problem: Problem) -> None:
    """Refuse a record whose curve or scene is no longer what was fitted: its page would show another fit."""
    from underlay.inference.least_squares import fit as least_squares_fit
    from underlay.inference.least_squares.provenance import curve_hash

    if curve_hash(problem.curves[0]) != record.data_sha256:
        raise InputError(f"{record.curve} has changed since {record.path} was made; fit it again")
    found = least_squares_fit(problem)
    for name, value in record.values.items():
        same = name in found.values and abs(found.values[name] - value) <= _SAME * abs(value)
        if not same:
            raise InputError(
                f"{record.path} is not the fit of {record.curve} with this scene file ({name} differs); "
                "fit it again"
            )


def _sampled_files(asked: _Asked) -> tuple[Path, Path] | None:
    """Curve and scene file named beside a posterior; None where neither is."""
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


def _write_new(results: list[Path], scene: Path | None, target: Path) -> Path:
    from underlay.inference.from_files import load_problem
    from underlay.report.render import file_notebook, notebook_text

    if target.suffix != ".ipynb":
        raise InputError(f"a notebook ends in .ipynb; got {target.name!r}")
    if target.exists():
        raise InputError(f"{target} exists and may hold your work; name another file")
    curve, scene_file = _curve_and_scene(_sorted_out(results, scene))
    load_problem(curve, scene_file)
    command = f"run {target.name}"
    notebook = file_notebook(curve, scene_file, target.absolute().parent, command)
    return write_atomic(target, notebook_text(notebook))


def _command(results: list[Path], scene: Path | None, output: Path) -> str:
    words = ["underlay", "report", *map(str, results)]
    words += ["--scene", str(scene)] if scene else []
    return shlex.join([*words, "--output", str(output)])
