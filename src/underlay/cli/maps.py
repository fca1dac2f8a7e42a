"""Commands on many curves: `map` and `population`."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import underlay as ul
from underlay._files import require_writable_folder
from underlay.cli import console
from underlay.cli.console import say, say_error, say_table
from underlay.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

_LISTED = 10
_INTERRUPTED = 130  # what shells give a command that Ctrl-C ended


def map_curves(
    curves: Annotated[Path, typer.Argument(help="Folder with a curve per file, or one file of many tests.")],
    scene: console.SceneOption = None,
    manifest: Annotated[
        Path | None,
        typer.Option(
            help="CSV with a row per curve: file, name, x, y, animal, group, thickness, any parameter."
        ),
    ] = None,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Folder for table, journal and pictures; made if absent.")
    ] = Path("underlay-map"),
    table_format: Annotated[str, typer.Option("--format", help="Of the table: csv or parquet.")] = "csv",
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue the run in the output folder; compute nothing again.")
    ] = False,
    workers: Annotated[int | None, typer.Option(help="Processes; as many as processors by default.")] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Dask scheduler whose workers to use, e.g. tcp://10.0.0.1:8786.")
    ] = None,
    folders: Annotated[
        str | None, typer.Option(help="What the folders stand for that the curves lie in, e.g. group/animal.")
    ] = None,
    check: Annotated[bool, typer.Option("--check", help="Check the quality of every curve first.")] = False,
    sample: Annotated[bool, typer.Option("--sample", help="Sample the posterior of every curve.")] = False,
    quick: Annotated[
        bool, typer.Option("--quick", help="Values and least-squares errors alone, in a tenth of the time.")
    ] = False,
    max_steps: Annotated[int, typer.Option(help="Most steps of each sampling.")] = 20_000,
    seed: console.Seed = 0,
    solver: console.SolverName = None,
    rtol: console.Rtol = None,
    excel: console.ExcelFile = None,
    review: Annotated[
        bool, typer.Option("--review", help="Write a gallery of the curves, worst first, and decisions.csv.")
    ] = False,
    decisions: Annotated[
        Path | None,
        typer.Option(help="CSV of a review, filled in: which curves are refused or accepted, and why."),
    ] = None,
) -> None:
    """Fit every curve of a folder into one table; a curve that fails is a row with its reason.

    An interrupted run (Ctrl-C, a lost machine, a full disk) continues with --resume.

    Example: `underlay map curves --scene scene.toml --manifest manifest.csv --output results`
    """
    from underlay.inference.batch.decisions import without_refused
    from underlay.inference.batch.results_table import write_frame
    from underlay.inference.population.population import group_column
    from underlay.report.screen import assumed_words, line, written_line
    from underlay.scene.scene_file import read_scene_file

    scene = console.scene_for(scene, curves, "map")
    decided = None if decisions is None else ul.read_decisions(decisions)
    if table_format not in ("csv", "parquet"):
        raise InputError(f"--format must be csv or parquet; got {table_format!r}")
    file = read_scene_file(scene)
    wanted = console.wanted_solver(file.solver, solver, rtol)
    if excel is not None:
        _require_elsewhere(excel, curves, folders)
    folder = require_writable_folder(output)
    path = folder / f"map.{table_format}"
    asked = ul.MapOptions(
        solver=wanted,
        quality=check,
        sampling=ul.Sampling(max_steps=max_steps, seed=seed) if sample else False,
        answers=not quick,
        resume=resume,
        folders=_levels(folders),
    )
    try:
        table = ul.fit_many(
            curves, scene, manifest=manifest, workers=workers, scheduler=scheduler, output=path, options=asked
        )
    except KeyboardInterrupt:
        say_error(f"interrupted; what was finished is kept in {path}: continue with --resume")
        raise typer.Exit(_INTERRUPTED) from None
    if decided is not None:
        written, table = table, decided.applied(table)
        if not table.equals(written):
            write_frame(path, table)
    counted = without_refused(table)
    _show(counted)
    if assumed := assumed_words(file.assumed):
        say(line("Assumed", assumed))
    say(written_line([path, *_draw(counted, folder)], folder, path.stem))
    if "animal" in counted:
        column = group_column(counted)
        groups = f" --group {shlex.quote(column)}" if column else ""
        # A command is not broken: it is copied.
        say(f"{line('Next step', ''):<16}underlay population {shlex.quote(str(path))} --by animal{groups}")
    if review:
        # As `fit_many` listed the curves.
        own = [entry for entry in (manifest, scene, path) if entry is not None]
        pages = ul.write_review(table, curves, scene, folder, options=asked, decisions=decided, leave_out=own)
        say(f"wrote {pages[0]}{f' and {len(pages) - 2} more' if len(pages) > 2 else ''}")
        say(f"wrote {pages[-1]}: fill it in, and run this again with --resume --decisions {pages[-1]}")
    if excel is not None:
        say(f"wrote {_write_excel(table, excel, scene, wanted)}")


def _levels(folders: str | None) -> tuple[str, ...]:
    """Return the labels that the levels of folders give, outermost first, from ``"group/animal"``."""
    return tuple(folders.split("/")) if folders else ()


def _require_elsewhere(excel: Path, curves: Path, folders: str | None) -> None:
    """Raise an error if the Excel file would lie among the curves, where the next run would read it as one."""
    above = excel.resolve().parents[len(_levels(folders)) :]
    if above and above[0] == curves.resolve():
        raise InputError(
            f"--excel {excel} lies among the curves, where --resume would take it for one: name another folder"
        )


def _write_excel(table: pd.DataFrame, path: Path, scene: Path, solver: ul.Solver) -> Path:
    """Write the table of a map as an Excel file, with solver and scene file in its settings; return its path."""
    from underlay._door import read_text
    from underlay.scene.scene_file import SCENE_FILE

    lines = enumerate(read_text(scene, SCENE_FILE).splitlines(), 1)
    settings = {"solver": solver.label, "scene file": str(scene)}
    settings |= {f"scene file, line {number}": line for number, line in lines if line.strip()}
    return ul.write_excel(path, table, settings=settings)


def _show(table: pd.DataFrame) -> None:
    """Print the short text of a map, and up to ten failed curves with their reasons."""
    from underlay.report.screen import map_lines

    failed = table[table["status"] == "failed"]
    shown = zip(failed["name"].head(_LISTED), failed["reason"].head(_LISTED), strict=True)
    say(*map_lines(table), *(f"failed: {name}: {reason}" for name, reason in shown))
    if len(failed) > _LISTED:
        say(f"and {len(failed) - _LISTED} more; see the column 'reason'")


def _draw(table: pd.DataFrame, folder: Path) -> list[Path]:
    from underlay.inference.batch.results_table import fitted_names

    names = sorted(fitted_names(table.columns), key=lambda name: name != "layer.E")
    if not names or not table[names[0]].notna().any():
        return []
    return [ul.plots.save(ul.plots.survey(table, names[0]), folder / "map.png")]


def population(
    table: Annotated[Path, typer.Argument(help="Table of a map (map.csv or map.parquet) with labels.")],
    by: Annotated[
        list[str] | None,
        typer.Option(help="Column with the animal of a curve; repeat for nested levels, outermost first."),
    ] = None,
    group: Annotated[str | None, typer.Option(help="Column of the groups to compare.")] = None,
    parameter: Annotated[str, typer.Option(help="Which fitted parameter.")] = "layer.E",
    sites_only: Annotated[
        bool,
        typer.Option("--sites-only", help="Take all curves for independent; holds for these sites only."),
    ] = False,
    doubtful: Annotated[str, typer.Option(help="keep or drop curves whose verdict is check.")] = "keep",
    tails: Annotated[
        str, typer.Option(help="normal, or outliers: a tenth of the curves may be far off.")
    ] = "normal",
    shared_error: Annotated[
        float | None,
        typer.Option(
            help="Relative error that all curves share, such as the tip radius's; else the map's own."
        ),
    ] = None,
    output: console.OutputFolder = None,
    excel: console.ExcelFile = None,
    details: console.Details = False,
) -> None:
    """Mean and spread over animals, with intervals that allow for the similarity of sites on one animal.

    Labels come from columns of the map's manifest (animal, group, joint, ...) or from its folders (`underlay map
    --folders group/animal`).

    Example: `underlay population map.csv --by animal --group treatment`
    """
    from underlay.report.details import write_all
    from underlay.report.maps import population_lines, population_tables
    from underlay.report.screen import written_line

    levels = [] if sites_only else (by or ["animal"])
    result = ul.population(
        table, levels, parameter, group=group, doubtful=doubtful, tails=tails, shared_error=shared_error
    )
    say(*population_lines(result))
    if details:
        say(*result.sentences())
        for frame, title in zip(population_tables(result), ("Groups", "Ratios"), strict=False):
            say_table(frame, title)
    if excel is not None:
        from underlay.inference.batch.decisions import read_map

        asked = {"table": str(table), "by": ", ".join(levels), "group": group or "", "parameter": parameter}
        asked |= {"doubtful": doubtful, "tails": tails, "shared error": f"{result.shared_error:g}"}
        say(f"wrote {ul.write_excel(excel, read_map(table), result, settings=asked)}")
    if output is not None:
        stem = f"{table.stem}.population"
        files = {f"{stem}.csv": result.table()}
        written = write_all(
            output, files | ({f"{stem}.png": lambda: ul.plots.population(result)} if levels else {})
        )
        say(written_line(written, output, stem))
