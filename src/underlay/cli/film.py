"""`underlay film`: the modulus of a film from a test with continuous stiffness."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from underlay.cli.console import say, say_table
from underlay.cli.options import CurveFile, OutputFolder, SceneOption, ready_folder

__all__ = ["film"]


def film(
    curve: CurveFile,
    scene: SceneOption,
    calibration: Annotated[
        Path | None,
        typer.Option(help="Test with the same tip on a sample of known modulus, for its area."),
    ] = None,
    known_modulus: Annotated[
        str | None,
        typer.Option(help='E / (1 - nu^2) of that sample, e.g. "165 GPa" of (001) silicon.'),
    ] = None,
    depth_from: Annotated[str, typer.Option("--from", help="Smallest indentation that is fitted.")] = "0 nm",
    depth_to: Annotated[str, typer.Option("--to", help="Largest indentation that is fitted.")] = "1 m",
    output: OutputFolder = None,
) -> None:
    """Fit the contact stiffness S(h) of a film that was indented plastically; the scene's indenter is a cone.

    What [fit] frees of layer and substrate is fitted. Without a calibration the tip is taken as perfect.

    Example: `underlay film oxide.xls --scene film.toml --calibration silicon.xls --known-modulus "165 GPa"`
    """
    from underlay.inference.films import fit_film
    from underlay.report.film_tables import film_notes, film_table
    from underlay.scene.scene_file import read_scene_file

    if output is not None:
        ready_folder(output)
    found = fit_film(read_scene_file(scene), curve, calibration, known_modulus, (depth_from, depth_to))
    say_table(film_table(found), "Film")
    for note in film_notes(found, perfect=calibration is None):
        say(note)
    if output is not None:
        from underlay.report.film_tables import write_film

        for path in write_film(found, output, curve.stem):
            say(f"wrote {path}")
