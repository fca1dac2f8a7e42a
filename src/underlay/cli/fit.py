"""`underlay fit`: a measured curve and a scene in, parameters with their uncertainty out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from underlay.cli.console import say, say_table, say_warnings
from underlay.cli.options import (
    CurveFile,
    ExcelFile,
    OutputFolder,
    Rtol,
    SceneOption,
    SolverName,
    ready_folder,
    require_excel,
    wanted_solver,
)
from underlay.report.spoken import gathered_warnings, spoken

if TYPE_CHECKING:
    from underlay.inference.least_squares.fit_result import Fit

__all__ = ["fit", "show_fit"]


def fit(
    curve: CurveFile,
    scene: SceneOption,
    solver: SolverName = None,
    rtol: Rtol = None,
    output: OutputFolder = None,
    excel: ExcelFile = None,
    details: Annotated[
        bool, typer.Option("--details", help="Print all that stands behind the numbers.")
    ] = False,
) -> None:
    """Fit a curve with the substrate in the model.

    Example: `underlay fit curve.csv --scene scene.toml --output results`
    """
    from underlay.inference.from_files import load_problem
    from underlay.inference.least_squares import fit as least_squares_fit
    from underlay.report.limits import quality_doubts, reservations

    if output is not None:
        ready_folder(output)
    if excel is not None:
        require_excel(excel)
    with gathered_warnings() as notes:
        problem = load_problem(curve, scene)
        problem = problem.revised(solver=wanted_solver(problem.solver, solver, rtol))
        doubts = quality_doubts(problem)
        result = least_squares_fit(problem)
    show_fit(result, curve.name, details=details)
    if details:
        say_warnings([*doubts, *reservations(result, notes)])
    else:
        say_warnings([str(note) for one in result.curves for note in one.metadata.get("notes", ())])
    if output is not None:
        from underlay.report.fit_files import write_fit
        from underlay.report.screen import written_line

        say(written_line(write_fit(result, output, curve.stem), output, curve.stem))
    if excel is not None:
        say(f"wrote {_write_excel(result, excel)}")


def _write_excel(result: Fit, path: Path) -> Path:
    """Write the fit and its modulus at each depth, where there is one, as an Excel file."""
    from underlay.inference.pointwise.result import PointwiseModulus
    from underlay.report.excel import write_excel
    from underlay.report.fit_files import pointwise_of

    by_depth = [found for found in pointwise_of(result) if isinstance(found, PointwiseModulus)]
    return write_excel(path, result, *by_depth)


def show_fit(result: Fit, name: str, *, details: bool = False) -> None:
    """Print what a fit found: number, verdict, next step; with `details` all that stands behind it."""
    from underlay.report.screen import fit_lines

    say("")
    for text in fit_lines(result):
        say(spoken(text))
    if details:
        _show_details(result, name)


def _show_details(result: Fit, name: str) -> None:
    """Budget, parameters, correlations, what the instrument found, the contact law."""
    from underlay.inference.recipe import steps_to_ours
    from underlay.report.adhesion_tables import adhesion_frame, halfspace_of
    from underlay.report.labels import is_of_the_sample, label
    from underlay.report.limits import advice, rivals
    from underlay.report.screen import budget_table
    from underlay.report.tables import correlated_pairs, fit_table, steps_table
    from underlay.units import format_quantity

    for parameter in filter(is_of_the_sample, result.names):
        say_table(
            budget_table(result.answer(parameter)), f"Uncertainty budget of the {label(parameter)}, 95 %"
        )
    for other in result.verdict.others:
        say(f"also {other}")
    for sentence in (*rivals(result), *advice(result)):
        say(spoken(sentence))
    table = fit_table(result).drop(columns=["instrument's own", "differs (%)"], errors="ignore")
    say_table(table if any(table["at bound"]) else table.drop(columns="at bound"), f"Fit of {name}")
    sticking = adhesion_frame(result)
    if len(sticking):
        say_table(sticking, "Adhesion")
        if sentence := halfspace_of(result):
            say(sentence)
    for path, told in result.instrument_moduli.items():
        say(
            f"{path}: the instrument's own reduced modulus {format_quantity(told.reduced, 'pressure')} is "
            f"{format_quantity(told.youngs, 'pressure')} at nu = {told.nu:g}; ours differs by "
            f"{100.0 * told.difference:+.3g} %"
        )
    if steps := steps_to_ours(result):
        table = steps_table(steps).reset_index(names="step")
        say_table(table, "From the instrument's number to the value of this fit")
    pairs = correlated_pairs(result)
    if len(pairs):
        say_table(pairs, "Correlations above 0.9")
    say(f"contact model: {spoken(result.law_reason)}")
