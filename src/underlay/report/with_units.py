"""A table of numbers in SI as people read it: each number in the unit of its size."""

from __future__ import annotations

import math
from numbers import Real

import pandas as pd

from underlay.inference.sampling.derived import DERIVED
from underlay.quantities import path_of
from underlay.scene.parameters import declared
from underlay.units import format_quantity, printed

__all__ = ["with_units"]

# Columns of tables of parameters that hold no value of the parameter.
_BARE = frozenset({"ess", "rhat", "narrowing", "distance", "curves", "points", "units"})
_SUFFIXES = (".stderr", ".low", ".high", ".expected", ".instrument")


def with_units(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table of SI numbers as text with units, for reading; the numbers stay in the table that was given.

    Parameters
    ----------
    table : pandas.DataFrame
        With a row per parameter, such as ``posterior.summary()``, or a column per parameter, such as what
        `fit_many` returns. What is no number of a parameter stays as it is, rounded to four digits.

    Examples
    --------
    >>> table = pd.DataFrame({"median": [637052.3, 1.3512e-3], "rhat": [1.0004, 1.0]})
    >>> table.index = ["layer.E", "layer.thickness"]
    >>> with_units(table)["median"].to_list(), with_units(table)["rhat"].to_list()
    (['0.6371 MPa', '1.351 mm'], ['1', '1'])
    """
    by_row = all(_kind(str(name)) is not None for name in table.index) and len(table) > 0
    cells = {
        column: [
            _cell(value, _kind(str(name)) if by_row and str(column) not in _BARE else _kind(str(column)))
            for name, value in zip(table.index, table[column], strict=True)
        ]
        for column in table.columns
    }
    return pd.DataFrame(cells, index=table.index)


def _kind(name: str) -> str | None:
    """Kind of quantity of a parameter, or of what a column says of one; None for any other name."""
    for suffix in _SUFFIXES:
        name = name.removesuffix(suffix)
    path = path_of(name)
    known = DERIVED.get(path.rpartition(".")[2]) or declared(path)
    return known.kind if known.label and ("." in path or path in DERIVED) else None


def _cell(value: object, kind: str | None) -> str:
    if isinstance(value, bool) or not isinstance(value, Real):
        return "" if value is None else str(value)
    number = float(value)
    if math.isnan(number):
        return ""
    if kind is None or math.isinf(number):
        return f"{number:.4g}"
    return printed(format_quantity(number, kind))
