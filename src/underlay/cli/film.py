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
    import pandas as pd

    from underlay.inference.films import StiffnessFit
    from underlay.mechanics.area_function import AreaFunction
    from underlay.scene.scene_file import SceneFile

__all__ = ["film", "film_notes", "film_table", "fit_film"]

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
    from underlay.report import plots
    from underlay.scene.scene_file import read_scene_file

    if output is not None:
        require_writable_folder(output)
    found = fit_film(read_scene_file(scene), curve, calibration, known_modulus, (depth_from, depth_to))
    say_table(film_table(found), "Film")
    for note in film_notes(found, perfect=calibration is None):
        say(note)
    if output is not None:
        say(f"wrote {write_atomic(output / f'{curve.stem}.film.csv', csv_text(found.table))}")
        say(f"wrote {plots.save(plots.film(found), output / f'{curve.stem}.film.png')}")


def fit_film(
    file: SceneFile, curve: Path, calibration: Path | None, known_modulus: str | None, ends: tuple[str, str]
) -> StiffnessFit:
    """Fit what [fit] frees of layer and substrate to the contact stiffness of a file.

    Parameters
    ----------
    file : SceneFile
        The test.
    curve, calibration : Path
        Files of the film, and of a sample of known modulus with the same tip; None for a perfect tip.
    known_modulus : str
        E / (1 - nu^2) of that sample, with its unit.
    ends : (str, str)
        Shallowest and deepest depth that count, with units.

    Raises
    ------
    CurveError, InputError
        If nothing of layer or substrate is free, or a file has no contact stiffness.
    """
    from underlay.inference.films import fit_stiffness
    from underlay.inference.from_files import read_whole
    from underlay.units import parse_quantity

    depths = tuple(parse_quantity(end, "length") for end in ends)
    free = [entry.path for entry in file.free if entry.path.startswith(("layer.", "substrate."))]
    if not free:
        raise InputError(f"{file.path.name} frees nothing of layer or substrate in [fit]: say layer.E = {{}}")
    area = None if calibration is None else _area(calibration, known_modulus)
    whole = read_whole(file, curve)
    return fit_stiffness(whole, file.scene, free=free, area=area, depths=(depths[0], depths[1]))


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


def film_table(found: StiffnessFit) -> pd.DataFrame:
    """Return a row for each modulus, with its interval."""
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
    return pd.DataFrame(rows)


def film_notes(found: StiffnessFit, *, perfect: bool) -> list[str]:
    """Return how well the trend with depth is explained, and what the moduli stand on."""
    left = f"left of the trend with depth: {100.0 * found.scatter:.1f} % over {len(found.table)} depths"
    worn = (
        "note: the tip is taken as a perfect cone; worn tips are blunter, which makes the modulus too large: "
        "give --calibration"
    )
    return [left, worn] if perfect else [left]
