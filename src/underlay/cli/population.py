"""`underlay population`: from the table of a map to a mean, its spread, and differences between groups."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from underlay._files import write_atomic
from underlay.cli.console import say, say_table
from underlay.cli.options import ExcelFile, OutputFolder, ready_folder, require_excel

__all__ = ["population"]


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
    output: OutputFolder = None,
    excel: ExcelFile = None,
) -> None:
    """Mean and spread over animals, with intervals that allow for sites of one animal that are alike.

    Labels come from columns of the map's manifest (animal, group, joint, ...) or from its folders
    (`underlay map --folders group/animal`).

    Example: `underlay population map.csv --by animal --group treatment`
    """
    from underlay._csv import csv_text
    from underlay.inference.population.population import population as population_of
    from underlay.report import plots
    from underlay.report.maps import comparison_table, group_table, population_sentences

    if output is not None:
        ready_folder(output)
    if excel is not None:
        require_excel(excel)
    levels = [] if sites_only else (by or ["animal"])
    result = population_of(
        table, levels, parameter, group=group, doubtful=doubtful, tails=tails, shared_error=shared_error
    )
    for sentence in population_sentences(result):
        say(sentence)
    say_table(group_table(result), "Groups" if group else "Population")
    if result.comparisons:
        say_table(comparison_table(result), "Ratios")
    if excel is not None:
        from underlay.inference.batch.decisions import read_map
        from underlay.report.excel import write_excel

        asked = {"table": str(table), "by": ", ".join(levels), "group": group or "", "parameter": parameter}
        asked |= {"doubtful": doubtful, "tails": tails, "shared error": f"{result.shared_error:g}"}
        say(f"wrote {write_excel(excel, read_map(table), result, settings=asked)}")
    if output is None:
        return
    stem = f"{table.stem}.population"
    say(f"wrote {write_atomic(output / f'{stem}.csv', csv_text(result.table()))}")
    if levels:
        say(f"wrote {plots.save(plots.population(result), output / f'{stem}.png')}")
