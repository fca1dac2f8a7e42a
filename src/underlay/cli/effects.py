"""`underlay effects`: which effects a scene calls for, how large each one is, and what it costs."""

from __future__ import annotations

from underlay._files import require_writable_folder, write_atomic
from underlay.cli.console import say, say_table
from underlay.cli.deepest_point import deepest_point, wanted_accuracy
from underlay.cli.options import MaxDepth, OutputFolder, Rtol, ScenePath
from underlay.report import plots
from underlay.report.csv_text import csv_text
from underlay.scene.effects import effects_table
from underlay.scene.scene_file import read_scene_file
from underlay.units import format_quantity

__all__ = ["effects"]


def effects(
    scene: ScenePath, max_depth: MaxDepth = None, rtol: Rtol = None, output: OutputFolder = None
) -> None:
    """Say which effects a scene calls for, how large each one is at the deepest point, and what it costs.

    Example: `underlay effects scene.toml --max-depth "100 um" --output results`
    """
    file = read_scene_file(scene)
    deepest, accuracy = deepest_point(file, max_depth), wanted_accuracy(file, rtol)
    if output is not None:
        require_writable_folder(output)
    table = effects_table(file.scene, deepest, accuracy)
    say_table(table, f"Effects of {scene.name} at {format_quantity(deepest, 'length')}")
    say(f"law: {table.attrs['law']}")
    if output is not None:
        stem = output / f"{scene.stem}.effects"
        picture = plots.effects(file.scene, deepest, accuracy)
        say(f"wrote {write_atomic(stem.with_suffix('.effects.csv'), csv_text(table))}")
        say(f"wrote {plots.save(picture, stem.with_suffix('.effects.png'))}")
