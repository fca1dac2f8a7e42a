"""Young's moduli of a film and its substrate, fitted to contact stiffness against depth: tables, notes and files.

`write_film` writes the moduli, the measured values at each depth, and the picture into a folder.
"""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from underlay._version import VERSION
from underlay.report import plots
from underlay.report.details import write_all
from underlay.scene.parameters import kind_of
from underlay.units import format_ends, format_quantity, human_unit

if TYPE_CHECKING:
    from underlay.inference.films import StiffnessFit

_COLUMNS = {
    "m": ("depth", "contact radius"),
    "N/m": ("stiffness", "fitted stiffness", "noise"),
    "Pa": ("half-space modulus", "layer modulus", "layer modulus noise"),
}


def film_table(found: StiffnessFit) -> pd.DataFrame:
    """Return a row for each fitted number, as text: value, 95 % interval, change for 1 % more contact area."""
    rows = []
    for name, value in found.values.items():
        low, high, kind = found.low[name], found.high[name], kind_of(name)
        ends = " to ".join(format_ends(low, high, kind)) if math.isfinite(high) else "no scatter in the file"
        rows.append(
            {
                "parameter": name,
                "value": format_quantity(value, kind),
                "95 % interval (a test as a whole)": ends,
                "1 % more area": f"{found.area_sensitivity[name]:+.2f} %",
            }
        )
    return pd.DataFrame(rows)


def film_moduli(found: StiffnessFit) -> pd.DataFrame:
    """Return a row for each fitted number, as numbers.

    Returns
    -------
    pandas.DataFrame
        ``parameter``, ``value``, its 95 % interval ``low`` to ``high`` (infinite where the file states no scatter),
        ``unit``, ``1 % more area (%)`` (change of the value for 1 % more contact area), ``left of the trend (%)``
        (scatter about the fitted trend with depth), ``fitted from (m)``, ``fitted to (m)``, ``depths`` (their
        number), ``curve`` and ``underlay`` (version).
    """
    rows = []
    for name, value in found.values.items():
        unit, factor = human_unit(value, kind_of(name))
        rows.append(
            {
                "parameter": name,
                "value": value / factor,
                "low": found.low[name] / factor,
                "high": found.high[name] / factor,
                "unit": unit,
                "1 % more area (%)": found.area_sensitivity[name],
                "left of the trend (%)": 100.0 * found.scatter,
                "fitted from (m)": float(found.table["depth"].min()),
                "fitted to (m)": float(found.table["depth"].max()),
                "depths": len(found.table),
                "curve": found.table.attrs["curve"],
                "underlay": VERSION,
            }
        )
    return pd.DataFrame(rows)


def film_notes(found: StiffnessFit, *, perfect: bool) -> list[str]:
    """Return sentences on the scatter about the fitted trend with depth and, for a `perfect` cone, on its bias.

    A real tip is blunter than the perfect cone, so the modulus found with it is too large.
    """
    left = f"left of the trend with depth: {100.0 * found.scatter:.1f} % over {len(found.table)} depths"
    worn = (
        "the tip is taken as a perfect cone; a worn one is blunter, which makes the modulus too large: add a "
        "test of a known sample with the same tip"
    )
    return [left, worn] if perfect else [left]


def write_film(found: StiffnessFit, folder: Path, stem: str) -> list[Path]:
    """Write both tables (CSV) and the picture (PNG) of a film; return the paths of the three files."""
    units = {name: f"{name} ({unit})" for unit, names in _COLUMNS.items() for name in names}
    tables = {"csv": film_moduli(found), "depths.csv": found.table.rename(columns=units)}
    files = {f"{stem}.film.{name}": table for name, table in tables.items()}
    return write_all(folder, {**files, f"{stem}.film.png": partial(plots.film, found)})
