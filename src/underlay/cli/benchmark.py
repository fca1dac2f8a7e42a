"""`underlay benchmark`: accuracy of a contact model, a fit or another program on curves whose truth is known."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

import underlay as ul
from underlay.cli import options
from underlay.cli.console import say, say_table, write_out
from underlay.errors import InputError

if TYPE_CHECKING:
    from underlay.inference.benchmark import Scores

__all__ = ["benchmark"]


def benchmark(
    solver: Annotated[
        str | None,
        typer.Option("--solver", help="Score one elastic contact model: exact, halfspace, garcia2018, ..."),
    ] = None,
    program: Annotated[
        str | None,
        typer.Option(
            "--program",
            help="Score another program: its command line, with {curve} for the CSV (SI), {scene} for the scene "
            "file, {answer} for the file that takes the modulus in Pa (else its last printed word), and numbers of "
            "the scene such as {indenter.radius} and {layer.nu}.",
        ),
    ] = None,
    kind: Annotated[
        list[str] | None,
        typer.Option("--kind", help="Kind of sample, e.g. elastic; repeat it for more; all by default."),
    ] = None,
    output: options.OutputFolder = None,
) -> None:
    """Score the accuracy of a fit, a contact model or another program on the open benchmark.

    Thirty synthetic curves with known truth: six kinds of sample, each with five kinds of noise. Without --solver
    and --program the whole model of each scene is fitted. A contact model is also compared with the exact contact
    problem and with finite elements.

    Example: `underlay benchmark --kind elastic`

    Example: `underlay benchmark --solver garcia2018 --kind elastic --output results`
    """
    from underlay.inference.benchmark import Program, against_finite_elements, against_references

    if solver is not None and program is not None:
        raise InputError("--solver and --program do not go together: score one after the other")
    other = None if program is None else Program(program)
    with Console(stderr=True).status("") as line:  # seen on a terminal only
        scores = ul.benchmark(
            solver,
            estimate=other,
            kinds=kind or (),
            progress=lambda case: line.update(f"{case.kind}, {case.noise} noise"),
        )
    say_table(
        scores.summary(), f"{scores.label if program is None else program}: error of the layer's modulus"
    )
    _say_reasons(scores)
    tables = {"benchmark.csv": scores.to_frame()}
    if program is None:
        law = solver or "auto"
        tables["benchmark.references.csv"] = against_references(law)
        tables["benchmark.finite_elements.csv"] = against_finite_elements(law)
        say_table(tables["benchmark.references.csv"], f"{law}: force against the exact contact problem")
        say_table(tables["benchmark.finite_elements.csv"], f"{law}: force against finite elements")
    write_out(output, tables)


def _say_reasons(scores: Scores) -> None:
    """Print each reason why a curve has no estimate, once."""
    reasons = [f"no estimate: {score.case.kind}: {score.reason}" for score in scores.scores if score.reason]
    for reason in dict.fromkeys(reasons):
        say(reason)
