"""`underlay effects`: which effects a scene calls for, how large each is in force and answer, and its cost."""

from __future__ import annotations

from underlay._files import write_atomic
from underlay.cli.console import say, say_table
from underlay.cli.expected import deepest_point, measured_curve
from underlay.cli.options import (
    CurveOption,
    MaxDepth,
    OutputFolder,
    Rtol,
    ScenePath,
    SolverName,
    ready_folder,
    wanted_solver,
)

__all__ = ["effects"]


def effects(
    scene: ScenePath,
    max_depth: MaxDepth = None,
    curve: CurveOption = None,
    solver: SolverName = None,
    rtol: Rtol = None,
    output: OutputFolder = None,
) -> None:
    """List the effects that matter for a scene: size, change of a fit without it, cost.

    Example: `underlay effects scene.toml --max-depth "100 um" --output results`
    """
    from underlay._csv import csv_text
    from underlay.inference.answer_cost import effects_on_answers
    from underlay.report import plots
    from underlay.scene.effects import effects_table
    from underlay.scene.scene_file import read_scene_file
    from underlay.units import format_quantity

    file = read_scene_file(scene)
    deepest = deepest_point(file, max_depth, measured_curve(file, curve))
    wanted = wanted_solver(file.solver, solver, rtol)
    if output is not None:
        ready_folder(output)
    table = effects_table(file.scene, deepest, wanted)
    on_fits = effects_on_answers(file.scene, deepest, wanted).drop(columns="effect")
    law, notes = table.attrs["law"], table.pop("note")
    table = table.join(on_fits).assign(note=notes)
    say_table(table, f"Effects of {scene.name} at {format_quantity(deepest, 'length')}")
    say("E and h: what leaving an effect out of a fit does to modulus and thickness (%)")
    say(f"law: {law}")
    if output is not None:
        stem = output / f"{scene.stem}.effects"
        picture = plots.effects(file.scene, deepest, wanted)
        say(f"wrote {write_atomic(stem.with_suffix('.effects.csv'), csv_text(table))}")
        say(f"wrote {plots.save(picture, stem.with_suffix('.effects.png'))}")
