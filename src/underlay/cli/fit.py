"""`underlay fit`: a measured curve and a scene in, parameters with their uncertainty out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

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
    show_fit(result, curve.name)
    say_warnings([*doubts, *reservations(result, notes)])
    if output is not None:
        from underlay.report.fit_files import write_fit

        for path in write_fit(result, output, curve.stem):
            say(f"wrote {path}")
    if excel is not None:
        say(f"wrote {_write_excel(result, excel)}")


def _write_excel(result: Fit, path: Path) -> Path:
    """Write the fit and its modulus at each depth, where there is one, as an Excel file."""
    from underlay.inference.pointwise.modulus import PointwiseModulus
    from underlay.report.excel import write_excel
    from underlay.report.fit_files import pointwise_of

    by_depth = [found for found in pointwise_of(result) if isinstance(found, PointwiseModulus)]
    return write_excel(path, result, *by_depth)


def show_fit(result: Fit, name: str) -> None:
    """Print what a fit found: in words, with what else would explain it, as a table, then what hangs together."""
    from underlay.inference.recipe import steps_to_ours
    from underlay.report.adhesion_tables import adhesion_frame, halfspace_of
    from underlay.report.limits import advice, model_limits, rivals
    from underlay.report.tables import correlated_pairs, fit_table, steps_table
    from underlay.report.words import headline, stands_on, verdict_sentence
    from underlay.units import format_quantity

    say("")
    for sentence in (
        headline(result),
        *rivals(result),
        verdict_sentence(result),
        *filter(None, [stands_on(result)]),
        *model_limits(result),
        *advice(result),
    ):
        say(spoken(sentence))
    # What a sentence says below, or no parameter has, would only squeeze the rest.
    table = fit_table(result).drop(columns=["instrument's own", "least squares differs (%)"], errors="ignore")
    say_table(table if any(table["at bound"]) else table.drop(columns="at bound"), f"Fit of {name}")
    sticking = adhesion_frame(result)
    if len(sticking):
        say_table(sticking, "Adhesion")
        if sentence := halfspace_of(result):
            say(sentence)
    for path, told in result.instrument_moduli.items():
        say(
            f"{path}: the instrument's own reduced modulus {format_quantity(told.reduced, 'pressure')} is "
            f"{format_quantity(told.youngs, 'pressure')} at nu = {told.nu:g}; plain least squares differs by "
            f"{100.0 * told.difference:+.3g} %"
        )
    if steps := steps_to_ours(result):
        table = steps_table(steps).reset_index(names="step")
        say_table(table, "From the instrument's number to the least-squares value of this fit")
    pairs = correlated_pairs(result)
    if len(pairs):
        say_table(pairs, "Correlations above 0.9")
    say(f"law: {spoken(result.law_reason)}")
