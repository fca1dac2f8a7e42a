"""`underlay film`: the modulus of a film from a test with continuous stiffness."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from underlay._files import require_writable_folder, write_atomic
from underlay.cli.console import say, say_table
from underlay.cli.options import CurveFile, OutputFolder, SceneOption
from underlay.errors import InputError

if TYPE_CHECKING:
    from underlay.inference.films import StiffnessFit
    from underlay.mechanics.area_function import AreaFunction

__all__ = ["film"]

_EPSILON = 0.75


def film(
    curve: CurveFile,
    scene: SceneOption,
    calibration: Annotated[
        Path | None, typer.Option(help="Test with the same tip on a sample of known modulus: gives its area.")
    ] = None,
    known_modulus: Annotated[
        str | None,
        typer.Option(help='E / (1 - nu^2) of that sample, e.g. "165 GPa" of (001) silicon.'),
    ] = None,
    depth_from: Annotated[str, typer.Option("--from", help="Shallowest depth that counts.")] = "0 nm",
    depth_to: Annotated[str, typer.Option("--to", help="Deepest depth that counts.")] = "1 m",
    output: OutputFolder = None,
) -> None:
    """Fit the contact stiffness S(h) of a film that was indented plastically; the scene's indenter is a cone.

    What [fit] frees of layer and substrate is fitted. Without a calibration the tip is taken as perfect.

    Example: `underlay film oxide.xls --scene film.toml --calibration silicon.xls --known-modulus "165 GPa"`
    """
    from underlay._csv_text import csv_text
    from underlay.inference.films import fit_stiffness
    from underlay.inference.from_files import read_whole
    from underlay.report import plots
    from underlay.scene.scene_file import read_scene_file
    from underlay.units import parse_quantity

    if output is not None:
        require_writable_folder(output)
    file = read_scene_file(scene)
    depths = tuple(parse_quantity(end, "length") for end in (depth_from, depth_to))
    free = [entry.path for entry in file.free if entry.path.startswith(("layer.", "substrate."))]
    if not free:
        raise InputError(f"{file.path.name} frees nothing of layer or substrate in [fit]: say layer.E = {{}}")
    area = None if calibration is None else _area(calibration, known_modulus)
    found = fit_stiffness(
        read_whole(file, curve), file.scene, free=free, area=area, depths=(depths[0], depths[1])
    )
    _show(found, perfect=area is None)
    if output is not None:
        say(f"wrote {write_atomic(output / f'{curve.stem}.film.csv', csv_text(found.table))}")
        say(f"wrote {plots.save(plots.film(found), output / f'{curve.stem}.film.png')}")


def _area(path: Path, modulus: str | None) -> AreaFunction:
    """Area function of the tip from a test on a sample of known modulus."""
    from underlay.data.readers import read
    from underlay.inference.films import DIAMOND
    from underlay.mechanics.area_function import AreaFunction
    from underlay.units import parse_quantity

    if modulus is None:
        raise InputError('--calibration needs --known-modulus, such as "165 GPa" for (001) silicon')
    test = read(path).loading()
    if "contact_stiffness" not in test.columns:
        raise InputError(f"{path.name} has no contact stiffness: a calibration needs a test with S(h)")
    S = test.columns["contact_stiffness"]
    usable = (S > 0.0) & (test.force > 0.0) & (test.depth > 0.0)
    contact = test.depth[usable] - _EPSILON * test.force[usable] / S[usable]
    inside = contact > 0.0
    reduced = 1.0 / (1.0 / parse_quantity(modulus, "pressure") + 1.0 / DIAMOND)
    return AreaFunction.calibrated(contact[inside], S[usable][inside], modulus=reduced)


def _show(found: StiffnessFit, *, perfect: bool) -> None:
    """Print the moduli, what they stand on, and how well the trend with depth is explained."""
    import math

    import pandas as pd

    from underlay.units import format_quantity

    rows = []
    for name, value in found.values.items():
        low, high = found.low[name], found.high[name]
        ends = f"{format_quantity(low, 'pressure')} to {format_quantity(high, 'pressure')}"
        rows.append(
            {
                "parameter": name,
                "value": format_quantity(value, "pressure"),
                "95 % interval (a test as a whole)": ends
                if math.isfinite(high)
                else "no scatter in the file",
                "1 % more area": f"{found.area_sensitivity[name]:+.2f} %",
            }
        )
    say_table(pd.DataFrame(rows), "Film")
    say(f"left of the trend with depth: {100.0 * found.scatter:.1f} % over {len(found.table)} depths")
    if perfect:
        say(
            "note: the tip is taken as a perfect cone; worn tips are blunter, which makes the modulus too large: "
            "give --calibration"
        )
