"""`underlay accuracy`: one scene by every method, the error of force, answer and posterior against time."""

from __future__ import annotations

from typing import Annotated

import typer

from underlay._files import write_atomic
from underlay.cli.console import say, say_table
from underlay.cli.expected import deepest_point, measured_curve
from underlay.cli.options import CurveOption, MaxDepth, OutputFolder, ScenePath, ready_folder

__all__ = ["accuracy"]


def accuracy(
    scene: ScenePath,
    max_depth: MaxDepth = None,
    curve: CurveOption = None,
    output: OutputFolder = None,
    quick: Annotated[
        bool,
        typer.Option("--quick", help="The force alone; fits and sampling take some ten seconds."),
    ] = False,
) -> None:
    """Compare error and time of every contact model for a scene: of the force, the modulus and the posterior.

    Example: `underlay accuracy scene.toml --max-depth "100 um" --output results`
    """
    from underlay._csv import csv_text
    from underlay.inference.answer_cost import answer_cost, posterior_cost
    from underlay.report import plots
    from underlay.report.tables import accuracy_summary, answer_summary
    from underlay.scene.accuracy_cost import accuracy_cost
    from underlay.scene.scene_file import read_scene_file
    from underlay.units import format_quantity

    file = read_scene_file(scene)
    deepest = deepest_point(file, max_depth, measured_curve(file, curve))
    if output is not None:
        ready_folder(output)
    table = accuracy_cost(file.scene, deepest)
    facts = table.attrs
    say_table(
        accuracy_summary(table),
        f"{scene.name}, {facts['points']} depths to {format_quantity(deepest, 'length')}, "
        f"a/h = {facts['a_over_h']:.2g}; (x): times the {1e6 * facts['unit_seconds']:.0f} us of the formula",
    )
    tables = {"accuracy": table}
    if not quick:
        answers = tables["answers"] = answer_cost(file.scene, deepest)
        unit = f"(x): times the {1e3 * answers.attrs['unit_seconds']:.1f} ms of lmfit's Hertz fit"
        say_table(
            answer_summary(answers),
            f"Fits of the scene's own curve, {answers.attrs['points']} points; {unit}",
        )
        posterior = tables["posterior"] = posterior_cost(file.scene, deepest)
        floor = posterior.attrs["reference_error"]
        say_table(posterior, f"Error of posterior quantiles (sd); the reference itself is off by {floor:.2g}")
    if output is not None:
        for name, found in tables.items():
            say(f"wrote {write_atomic(output / f'{scene.stem}.{name}.csv', csv_text(found))}")
        picture = plots.what_accuracy_costs(
            *tables.values(), title=f"{scene.stem}, a/h = {facts['a_over_h']:.2g}"
        )
        say(f"wrote {plots.save(picture.axes[0], output / f'{scene.stem}.accuracy.png')}")
