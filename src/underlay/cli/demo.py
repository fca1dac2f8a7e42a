"""`underlay demo`: the real curve and the cartilage sample, fitted, drawn and explained."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from underlay._files import require_writable_folder
from underlay.cli.console import say, say_warnings
from underlay.cli.fit import show_fit
from underlay.data.samples import sample
from underlay.report.spoken import gathered_warnings

__all__ = ["demo"]

_SAMPLES = (
    ("chiaro_cell_indentation.csv", "chiaro_cell.toml", "A real curve: a cell under an Optics11 Chiaro."),
    ("cartilage_on_bone.csv", "cartilage_on_bone.toml", "Made data: a ball on cartilage on bone."),
)


def demo(
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Folder for the results; made if absent.")
    ] = Path("underlay-demo"),
) -> None:
    """Fit two sample curves, and write their tables and pictures.

    Example: `underlay demo --output underlay-demo`
    """
    from underlay.inference.from_files import load_problem
    from underlay.inference.least_squares import fit
    from underlay.report.fit_files import write_fit
    from underlay.report.limits import reservations

    folder = require_writable_folder(output)
    written: list[Path] = []
    for curve, scene, title in _SAMPLES:
        with gathered_warnings() as notes:
            result = fit(load_problem(sample(curve), sample(scene)))
        say(f"\n{title}")
        show_fit(result, curve)
        say_warnings(reservations(result, notes))
        written += write_fit(result, folder, Path(curve).stem)
    say("\nThe results are in:")
    for path in written:
        say(f"  {path}")
    say(f"\nNext: underlay fit CURVE --scene SCENE.toml (start from {sample(_SAMPLES[1][1])})")
