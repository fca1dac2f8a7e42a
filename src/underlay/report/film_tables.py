"""A film's moduli as a table, and what they stand on."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import pandas as pd

from underlay.units import format_quantity

if TYPE_CHECKING:
    from underlay.inference.films import StiffnessFit

__all__ = ["film_notes", "film_table"]


def film_table(found: StiffnessFit) -> pd.DataFrame:
    """Return a row for each modulus, with its interval."""
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
