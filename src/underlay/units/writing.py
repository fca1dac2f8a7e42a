"""From SI floats to numbers with units, for people: ``1.5e-3`` -> ``"1.5 mm"``."""

from __future__ import annotations

import math
import re

from underlay.units.kinds import kind_named
from underlay.units.reading import unit_factor

__all__ = ["format_ends", "format_quantity", "human_unit", "interval_digits", "printed", "printed_unit"]

# Significant digits of a number for people, and of one that differs little from its neighbour.
_DIGITS, _MOST_DIGITS = 4, 12

# A typed micro before a unit, behind a number.
_TYPED = re.compile(r"(?<=[\d.)] )u(?=[mNsVJ](?![A-Za-z]))")


def human_unit(value: float, kind: str) -> tuple[str, float]:
    """Return the unit in which people would write `value` (SI), and the SI value of one such unit.

    The largest unit of the kind in which the number is at least 0.1; zero gets the middle one.

    Examples
    --------
    >>> human_unit(4.2e5, "pressure")
    ('MPa', 1000000.0)
    """
    units = kind_named(kind).units
    magnitude = abs(value)
    if not (0.0 < magnitude < math.inf):
        unit = units[len(units) // 2]
        return unit, unit_factor(unit, kind) if unit else 1.0
    chosen = units[0]
    for unit in units:
        # 1 - 1e-12: a tenth of a unit is still written in that unit after rounding.
        if unit and magnitude >= 0.1 * unit_factor(unit, kind) * (1.0 - 1e-12):
            chosen = unit
    return chosen, unit_factor(chosen, kind) if chosen else 1.0


def printed_unit(unit: str) -> str:
    """Return a unit as it is printed: the micro sign in place of the u that is typed.

    Examples
    --------
    >>> printed_unit("um"), printed_unit("uN/m"), printed_unit("MPa")
    ('\u00b5m', '\u00b5N/m', 'MPa')
    """
    return re.sub(r"\bu(?=[mNsVJ])", "\u00b5", unit)


def printed(text: str) -> str:
    """Return a text for people in which units behind numbers are printed, as in a picture or on a page.

    Examples
    --------
    >>> printed("a tip of 25 um, 0.4 to 0.5 uN deep")
    'a tip of 25 \u00b5m, 0.4 to 0.5 \u00b5N deep'
    """
    return _TYPED.sub("\u00b5", text)


def format_ends(low: float, high: float, kind: str) -> tuple[str, str]:
    """Write the ends of an interval (SI) for people, each in a unit of its size, with digits that tell its width.

    Four digits each, and where they are close as many as show two of the distance between them.

    Examples
    --------
    >>> format_ends(9.8e5, 1.02e6, "pressure")
    ('0.98 MPa', '1.02 MPa')
    >>> format_ends(1.00012e6, 1.00038e6, "pressure")
    ('1.00012 MPa', '1.00038 MPa')
    """
    digits = interval_digits(low, high)
    return _written(low, kind, digits), _written(high, kind, digits)


def interval_digits(low: float, high: float) -> int:
    """Significant digits of the ends of an interval: four, or as many as show two of the distance between them.

    Examples
    --------
    >>> interval_digits(0.98, 1.02), interval_digits(1.00012, 1.00038)
    (4, 6)
    """
    if not (math.isfinite(low) and math.isfinite(high) and high > low):
        return _DIGITS
    most = max(abs(low), abs(high))
    wanted = 2 + math.floor(math.log10(most)) - math.floor(math.log10(high - low))
    return max(_DIGITS, min(wanted, _MOST_DIGITS))


def _written(value: float, kind: str, digits: int) -> str:
    unit, factor = human_unit(value, kind)
    return f"{value / factor:.{digits}g}{f' {unit}' if unit else ''}"


def format_quantity(value: float, kind: str, uncertainty: float | None = None) -> str:
    """Write an SI value for people, in a unit of its size.

    Parameters
    ----------
    value : float
        In SI.
    kind : str
        One of `KINDS`.
    uncertainty : float, optional
        Standard error in the same SI unit; sets the digits shown (two of its own).

    Examples
    --------
    >>> format_quantity(4.2e5, "pressure")
    '0.42 MPa'
    >>> format_quantity(1.5034e-3, "length", 2.1e-5)
    '1.503 ± 0.021 mm'
    """
    unit, factor = human_unit(value, kind)
    scaled = value / factor
    suffix = f" {unit}" if unit else ""
    if uncertainty is None or not math.isfinite(uncertainty) or uncertainty <= 0.0:
        return _written(value, kind, _DIGITS)
    error = uncertainty / factor
    decimals = max(0, 1 - math.floor(math.log10(error)))
    if decimals > 12:
        return f"{scaled:.12g} ± {error:.2g}{suffix}"
    return f"{scaled:.{decimals}f} ± {error:.{decimals}f}{suffix}"
