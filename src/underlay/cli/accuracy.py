"""`underlay accuracy`: one scene by every method, error against time."""

from __future__ import annotations

from underlay._files import require_writable_folder, write_atomic
from underlay.cli.console import say, say_table
from underlay.cli.expected import deepest_point, measured_curve
from underlay.cli.options import CurveOption, MaxDepth, OutputFolder, ScenePath

__all__ = ["accuracy"]


def accuracy(
    scene: ScenePath, max_depth: MaxDepth = None, curve: CurveOption = None, output: OutputFolder = None
) -> None:
    """Compute a scene by every method: how far off each one is, and how long it takes.

    Example: `underlay accuracy scene.toml --max-depth "100 um" --output results`
    """
    from underlay._csv_text import csv_text
    from underlay.report import plots
    from underlay.report.accuracy_table import accuracy_summary
    from underlay.scene.accuracy_cost import accuracy_cost
    from underlay.scene.scene_file import read_scene_file
    from underlay.units import format_quantity

    file = read_scene_file(scene)
    deepest = deepest_point(file, max_depth, measured_curve(file, curve))
    if output is not None:
        require_writable_folder(output)
    table = accuracy_cost(file.scene, deepest)
    facts = table.attrs
    say_table(
        accuracy_summary(table),
        f"{scene.name}, {facts['points']} depths to {format_quantity(deepest, 'length')}, "
        f"a/h = {facts['a_over_h']:.2g}; (x): times the {1e6 * facts['unit_seconds']:.0f} us of the formula",
    )
    if output is not None:
        stem = output / scene.stem
        say(f"wrote {write_atomic(stem.with_suffix('.accuracy.csv'), csv_text(table))}")
        for times in ("cold", "held"):
            picture = plots.accuracy_cost(table, times=times)
            say(f"wrote {plots.save(picture, stem.with_suffix(f'.accuracy.{times}.png'))}")
