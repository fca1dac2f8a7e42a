"""Numbers with units, at the borders only: ``"1.5 mm"`` <-> ``1.5e-3``.

Scene files, readers, the command line and tables speak in units; everything inside is SI floats. A
quantity is always asked for by its *kind* ("length", "pressure", ...), so a length where a pressure belongs
is an error that names both.
"""

from underlay.units.kinds import KINDS
from underlay.units.reading import kind_of, parse_quantity, unit_factor
from underlay.units.writing import (
    format_ends,
    format_quantity,
    human_unit,
    interval_digits,
    printed,
    printed_unit,
)

__all__ = [
    "KINDS",
    "format_ends",
    "format_quantity",
    "human_unit",
    "interval_digits",
    "kind_of",
    "parse_quantity",
    "printed",
    "printed_unit",
    "unit_factor",
]
