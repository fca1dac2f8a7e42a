"""Tables and sentences of results, in units for people."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from underlay.scene.parameters import kind_of
from underlay.units import format_quantity, human_unit

if TYPE_CHECKING:
    from underlay.inference.least_squares import Fit

__all__ = ["correlated_pairs", "fit_table", "headline"]

#: Above this, two parameters are not known one by one, only together.
_STRONG = 0.9
#: What the parameters are called in a sentence.
_NAMES = {
    "layer.E": "Layer modulus",
    "layer.thickness": "Layer thickness",
    "layer.nu": "Layer Poisson's ratio",
    "substrate.E": "Substrate modulus",
    "indenter.radius": "Indenter radius",
    "instrument.contact_depth": "Contact point",
    "instrument.baseline": "Baseline",
}


def fit_table(result: Fit) -> pd.DataFrame:
    """Return one row per fitted parameter.

    Returns
    -------
    pandas.DataFrame
        ``parameter``, ``value``, ``standard error``, ``unit``, ``relative`` (per cent) and ``at bound``.
    """
    rows = []
    for name, value in result.values.items():
        path = name.partition("[")[0]
        unit, factor = human_unit(value, kind_of(path))
        error = result.stderr[name]
        rows.append(
            {
                "parameter": name,
                "value": value / factor,
                "standard error": error / factor,
                "unit": unit,
                "relative (%)": 100.0 * abs(error / value) if value else np.nan,
                "at bound": result.bounds_hit.get(name, ""),
            }
        )
    return pd.DataFrame(rows)


def correlated_pairs(result: Fit) -> pd.DataFrame:
    """Return the pairs of parameters whose correlation is above 0.9 in size, strongest first."""
    matrix = result.correlations
    names = list(matrix.columns)
    rows = [
        {"parameters": f"{first} and {second}", "correlation": matrix.loc[first, second]}
        for i, first in enumerate(names)
        for second in names[i + 1 :]
        if abs(matrix.loc[first, second]) > _STRONG
    ]
    table = pd.DataFrame(rows, columns=["parameters", "correlation"])
    return table.sort_values("correlation", key=np.abs, ascending=False, ignore_index=True)


def headline(result: Fit) -> str:
    """Return the result in one sentence per parameter that matters."""
    sentences = []
    for name, value in result.values.items():
        if name not in _NAMES or name.startswith("instrument."):
            continue
        error = result.stderr[name]
        text = format_quantity(value, kind_of(name), error if np.isfinite(error) else None)
        sentences.append(f"{_NAMES[name]} {text}.")
    return " ".join(sentences)
