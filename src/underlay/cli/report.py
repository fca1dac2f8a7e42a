"""Commands that share a result: `report` (a page or an executed notebook) and `cite`."""

from __future__ import annotations

import os
import shlex
from pathlib import Path
from typing import Annotated, Any

import typer

import underlay as ul
from underlay._door import FileKind, parse_json, read_text, understood
from underlay._files import require_writable_folder, write_atomic
from underlay.cli import console
from underlay.cli.console import say, say_table
from underlay.errors import InputError

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

    table = results[0] if len(results) == 1 and is_map(results[0]) else None
    asked = _Asked(scene, *([] if table else results))
    if notebook is not None:
        _write_notebook(asked, table, notebook)
        return
    from underlay.report.render import page_path

    page_path(output)
    named = ["--scene", str(scene)] if scene else []
    command = shlex.join(["underlay", "report", *map(str, results), *named, "--output", str(output)])
    how: dict[str, Any] = {"pdf": pdf, "details": details, "command": command}
    if table is not None:
        written = ul.report(read_map(table), output, files=[table], **how)
    elif asked.posterior is not None:
        posterior = ul.Posterior.load(asked.posterior)
        written = ul.report(posterior, output, problem=asked.sampled, files=[asked.posterior], **how)
    else:
        written = ul.report(asked.fitted(), output, **how)
    say(f"wrote {written}")
    if pdf and written.suffix.lower() != ".pdf":
        say(f"wrote {written.with_suffix('.pdf')}")


class _Asked:
    """The files given to `report`, sorted by what they are: curve, scene, posterior, result of `underlay fit`."""

    def __init__(self, scene: Path | None, *results: Path) -> None:
        self.curve: Path | None = None
        self.scene = scene
        self.posterior: Path | None = None
        # Of a result of `underlay fit`: its path, SHA-256 of the points, and fitted values (SI).
        self.record: tuple[Path, str, dict[str, float]] | None = None
        for path in results:
            if path.suffix == ".npz":
                self.posterior = path
            elif path.suffix == ".json":
                self._read_record(path)
            elif path.suffix == ".toml" and self.scene is None:
                self.scene = path
            elif self.curve is not None:
                raise InputError(
                    f"one page is of one curve; got {self.curve} and {path}. Call it once for each"
                )
            else:
                self.curve = path

    def _read_record(self, path: Path) -> None:
        with understood(path, _RECORD):
            document = parse_json(read_text(path, _RECORD))
            curves, values = document["provenance"]["curves"], document["values"]
            texts = [curves[0]["data_sha256"], curves[0]["path"] or "", curves[0].get("scene_path") or ""]
            if not all(isinstance(text, str) for text in texts):
                raise ValueError("its paths and hashes must be texts")
            self.record = path, texts[0], {name: float(value) for name, value in values.items()}
        if len(curves) != 1 or not texts[1]:
            raise InputError(f"{path} is not of one curve file; report it from Python, where it was made")
        self.curve = Path(texts[1])
        self.scene = self.scene or (Path(texts[2]) if texts[2] else None)

    @property
    def files(self) -> tuple[Path, Path]:
        """Curve and scene file; an error where one is missing."""
        if self.curve is None and self.posterior is not None:
            raise InputError(
                f"name the curve that was sampled too: underlay report {self.posterior} CURVE --scene"
            )
        if self.curve is None:
            raise InputError(
                "nothing to report: name a curve (with --scene), a .fit.json or a posterior (.npz)"
            )
        if self.scene is None:
            raise InputError(f"say what was tested: add --scene SCENE.toml for {self.curve}")
        return self.curve, self.scene

    @property
    def sampled(self) -> ul.Problem | None:
        """What was sampled, where the curve or the scene file is given with a posterior."""
        return None if self.curve is None and self.scene is None else ul.load_problem(*self.files)

    def fitted(self) -> ul.Fit:
        """Fit the curve by the scene file; an error where that is not the result that was given.

        The page would show another fit: of a curve that has changed since, or with another scene file.
        """
        from underlay.inference.least_squares.provenance import curve_hash

        problem = ul.load_problem(*self.files)
        if self.record is None:
            return ul.fit(problem)
        path, digest, values = self.record
        if curve_hash(problem.curves[0]) != digest:
            raise InputError(f"{self.curve} has changed since {path} was made; fit it again")
        found = ul.fit(problem)
        for name, value in values.items():
            if name not in found.values or not abs(found.values[name] - value) <= _SAME * abs(value):
                raise InputError(
                    f"{path} is not the fit of {self.curve} with this scene file ({name} differs); fit it again"
                )
        return found


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
        kind, named = "fit", dict(zip(("curve", "scene"), asked.files, strict=True))
        # Wrong input is refused here, in one line, before a notebook is started.
        asked.fitted()
    values = {name: Path(os.path.relpath(path, folder)).as_posix() for name, path in named.items()}
    title = next(iter(named.values())).name
    say(f"wrote {write_notebook(kind, {**values, 'title': title}, target.absolute())}")
    say(f"Next: jupyter lab {shlex.quote(str(target))}")


def cite(
    result: Annotated[
        Path, typer.Argument(help="A .fit.json, a .posterior.npz or the table of a map.", metavar="RESULT")
    ],
    output: console.OutputFolder = None,
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
