"""`underlay compare`: one curve under every contact law, and with the layer bonded or free to slip."""

from __future__ import annotations

from typing import TYPE_CHECKING

from underlay._files import write_atomic
from underlay.cli.console import say, say_table, say_warnings
from underlay.cli.options import CurveFile, OutputFolder, SceneOption, ready_folder
from underlay.report.spoken import gathered_warnings, spoken

if TYPE_CHECKING:
    import pandas as pd

    from underlay.inference.compare import Comparison

__all__ = ["compare"]


def compare(curve: CurveFile, scene: SceneOption, output: OutputFolder = None) -> None:
    """Fit one curve with every contact model, and with the layer bonded or free to slip on its substrate.

    Example: `underlay compare curve.csv --scene scene.toml --output results`
    """
    from underlay._csv import csv_text
    from underlay.inference.compare import compare as compare_laws
    from underlay.inference.compare import compare_bonds
    from underlay.inference.from_files import load_problem
    from underlay.report.limits import bonds_sentences
    from underlay.scene.scene import has_face

    if output is not None:
        ready_folder(output)
    with gathered_warnings() as notes:
        problem = load_problem(curve, scene)
        laws = compare_laws(problem)
        faces = all(has_face(one) for one in problem.base_scenes)
        bonds = compare_bonds(problem) if faces else None
    say_table(_shown(laws), f"{curve.name} under each law")
    if bonds is not None:
        say("Lower face of the layer")
        for sentence in bonds_sentences(bonds):
            say(f"  {spoken(sentence)}")
    say_warnings(list(notes))
    if output is not None:
        say(
            f"wrote {write_atomic(output / f'{curve.stem}.laws.csv', csv_text(laws.to_frame().reset_index()))}"
        )
        if bonds is not None:
            say(f"wrote {write_atomic(output / f'{curve.stem}.bonds.csv', csv_text(bonds.to_frame()))}")


def _shown(laws: Comparison) -> pd.DataFrame:
    """The table in units for people, without standard errors: those are in the file."""
    from underlay.quantities import path_of
    from underlay.scene.parameters import kind_of
    from underlay.units import human_unit

    frame = laws.to_frame()
    shown = frame[[]].copy()
    for name in laws.names:
        if name in frame:
            unit, factor = human_unit(float(frame[name].abs().median()), kind_of(path_of(name)))
            shown[f"{name} ({unit})" if unit else name] = frame[name] / factor
    return shown.join(frame[[column for column in ("rms residual", "AIC", "notes") if column in frame]])
