"""Numbers with units, for input and output only: ``"1.5 mm"`` is read as ``1.5e-3`` and written from it.

Inside the library every number is an SI float. Each kind of quantity (`KINDS`) has the units in which people write
it. The usual ones are read from a small table, all others by pint; a unit of the wrong kind is refused with those
that are allowed.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from underlay.errors import UnitError

# The units that scene files and instruments nearly always use are parsed with this small table: a decimal prefix, a
# base unit, and at most one division. pint, which knows all others, takes longer to load than a fit takes.
_PREFIXES = {"": 0, "p": -12, "n": -9, "u": -6, "m": -3, "k": 3, "M": 6, "G": 9}
_BASES = {
    "m": "length",
    "Pa": "pressure",
    "N": "force",
    "s": "time",
    "Hz": "frequency",
    "V": "voltage",
    "A": "current",
}
_QUOTIENTS = {
    ("force", "length"): "stiffness",
    ("length", "force"): "compliance",
    ("pressure", "length"): "stiffness per area",
    ("length", "time"): "speed",
    ("force", "time"): "loading rate",
    ("length", "voltage"): "sensitivity",
    ("length", "current"): "current sensitivity",
}
_SIMPLE = re.compile(r"([pnumkMG]?)(m|Pa|N|s|Hz|V|A)")
_NAMED = {
    "": ("dimensionless", 1.0),
    "deg": ("angle", math.pi / 180.0),
    "rad": ("angle", 1.0),
    "J/m^2": ("surface energy", 1.0),
    "mJ/m^2": ("surface energy", 1e-3),
    "uJ/m^2": ("surface energy", 1e-6),
    "m^2/s": ("diffusivity", 1.0),
    "mm^2/s": ("diffusivity", 1e-6),
    "um^2/s": ("diffusivity", 1e-12),
    "m^4/(N s)": ("permeability", 1.0),
    "mm^4/(N s)": ("permeability", 1e-12),
}
#: Kinds whose units may be written as those of another: J/m^2 is N/m.
_ALSO = {"surface energy": "stiffness"}
# Range of sizes, in SI, whose fifth powers (forces of profiles, products of moduli and lengths) are still ordinary
# doubles. Nothing measured comes near either end; a mistyped exponent does.
_SMALLEST, _LARGEST = 1e-60, 1e60
# Characters allowed in a unit. Everything else is refused before pint sees it: pint evaluates expressions, and a
# file is not trusted with an expression.
_UNIT = re.compile(r"[A-Za-z%°\u00c5\u212b\u00b5\u03bc\u00b7*/^() .\-0-9²³]{0,40}")
_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?)\s*(.*?)\s*", re.DOTALL)
# A number with a decimal comma, 1,5 for 1.5.
_DECIMAL_COMMA = re.compile(r"\s*([+-]?\d+),(\d+(?:[eE][+-]?\d{1,3})?(?:\s*[^\d\s,.][^,]*)?)\s*")
# Exponents of a unit: one digit is more than any quantity here needs, and limits pint's work.
_POWER = re.compile(r"(?:\*\*|\^)\s*\(?-?\d+(?:\.\d+)?\)?")
_SHORT_POWER = re.compile(r"(?:\*\*|\^)\s*\(?-?\d(?:\.\d{1,6})?\)?")
_ANGLE_UNITS = frozenset({"degree", "radian", "turn", "arcminute", "arcsecond", "grade"})
# Significant digits of a number for people, and the most for one that differs little from its neighbour.
_DIGITS, _MOST_DIGITS = 4, 12
# A typed micro sign (u) before a unit, after a number.
_TYPED = re.compile(r"(?<=[\d.)] )u(?=[mNsVJ](?![A-Za-z]))")


@dataclass(frozen=True)
class Kind:
    """One kind of quantity.

    Parameters
    ----------
    si : str
        SI unit of the floats inside the library.
    units : tuple of str
        Units for people, smallest first; the ones an error message offers.
    example : str
        An example of a value with its unit.
    """

    si: str
    units: tuple[str, ...]
    example: str


#: The kinds of quantity, by name.
KINDS: Mapping[str, Kind] = MappingProxyType(
    {
        "length": Kind("m", ("nm", "um", "mm", "m"), "1.5 mm"),
        "pressure": Kind("Pa", ("Pa", "kPa", "MPa", "GPa"), "0.4 MPa"),
        "force": Kind("N", ("pN", "nN", "uN", "mN", "N"), "20 uN"),
        "angle": Kind("rad", ("deg",), "35 deg"),
        "stiffness": Kind("N/m", ("mN/m", "N/m", "kN/m", "MN/m"), "0.019 N/m"),
        "stiffness per area": Kind("Pa/m", ("Pa/m", "kPa/m", "MPa/m", "GPa/m"), "10 GPa/m"),
        "compliance": Kind("m/N", ("nm/N", "um/N", "mm/N", "m/N"), "0.5 um/N"),
        "time": Kind("s", ("us", "ms", "s"), "2 s"),
        "speed": Kind("m/s", ("nm/s", "um/s", "mm/s", "m/s"), "5 um/s"),
        "frequency": Kind("Hz", ("Hz", "kHz", "MHz"), "10 Hz"),
        "loading rate": Kind("N/s", ("pN/s", "nN/s", "uN/s", "mN/s", "N/s"), "1 uN/s"),
        "voltage": Kind("V", ("mV", "V"), "2 V"),
        "sensitivity": Kind("m/V", ("nm/V", "um/V", "m/V"), "60 nm/V"),
        "current sensitivity": Kind("m/A", ("nm/nA", "um/nA"), "60 nm/nA"),
        "surface energy": Kind("J/m^2", ("uJ/m^2", "mJ/m^2", "J/m^2"), "5 mJ/m^2"),
        "diffusivity": Kind("m^2/s", ("um^2/s", "mm^2/s", "m^2/s"), "1 mm^2/s"),
        "permeability": Kind("m^4/(N s)", ("mm^4/(N s)", "m^4/(N s)"), "1e-15 m^4/(N s)"),
        "dimensionless": Kind("", ("",), "0.45"),
    }
)


def kind_named(name: str) -> Kind:
    """Return the kind of quantity of that name.

    Raises
    ------
    UnitError
        If there is none.
    """
    try:
        return KINDS[name]
    except KeyError:
        raise UnitError(f"no kind of quantity {name!r}; there are {', '.join(KINDS)}") from None


# The units of most columns, as they are written: a map needs them for every file.
_COLUMNS = {
    f"{prefix}{base}": (_BASES[base], float(f"1e{power}"))
    for base in ("m", "N", "s")
    for prefix, power in _PREFIXES.items()
}


def _registry() -> Any:
    # pint's own registry, which it builds at first use: that takes a good part of a second, as does loading pint.
    import pint  # noqa: PLC0415  for the same reason

    return pint.get_application_registry()  # type: ignore[no-untyped-call]  # without annotations there


def _clean(unit: str) -> str:
    # The micro sign, the Greek mu and "u" are the same prefix; products have several notations.
    text = unit.strip().replace("\u00b5", "u").replace("\u03bc", "u").replace("\u00b7", "*")
    text = text.replace("²", "^2").replace("³", "^3").replace("%", "percent").replace("°", "deg")
    return re.sub(r"(?<=[A-Za-z])-(?=[A-Za-z])", "*", text)  # "N-mm" is a product in instrument headers


def _parse_unit(unit: str) -> tuple[str, float] | None:
    """Kind and SI factor of `unit`, or None if it is not one of `KINDS`."""
    if unit in _COLUMNS:
        return _COLUMNS[unit]
    if not _UNIT.fullmatch(unit):
        return None
    text = _clean(unit)
    return _parse_simple(text) or _parse_any(text)


def _parse_simple(text: str) -> tuple[str, float] | None:
    """Kind and SI factor of a unit in the small table; None for any other."""
    if text in _NAMED:
        return _NAMED[text]
    matches = [_SIMPLE.fullmatch(part) for part in text.split("/")]
    parts = [match for match in matches if match]
    if len(parts) != len(matches) or len(parts) > 2:
        return None
    bases = [_BASES[part[2]] for part in parts]
    kind = bases[0] if len(bases) == 1 else _QUOTIENTS.get((bases[0], bases[1]))
    if kind is None or kind not in KINDS:
        return None
    power = _PREFIXES[parts[0][1]] - sum(_PREFIXES[part[1]] for part in parts[1:])
    # From text, so that the factor is the double nearest to the power of ten.
    return kind, float(f"1e{power}")


def _parse_any(text: str) -> tuple[str, float] | None:
    """Kind and SI factor of a unit that pint knows; None if there is none."""
    if len(_POWER.findall(text)) != len(_SHORT_POWER.findall(text)):
        return None
    registry = _registry()
    try:
        parsed = registry.parse_units(text)
        return _match_kind(registry, parsed)
    except Exception:  # noqa: BLE001  pint raises errors of tokenize, ast and its own on odd text
        return None


def _match_kind(registry: Any, parsed: Any) -> tuple[str, float] | None:
    names = set(parsed._units)  # noqa: SLF001  pint has no public list of the units in a product
    if parsed.dimensionless:
        is_angle = bool(names & _ANGLE_UNITS)
        target = "radian" if is_angle else "dimensionless"
        return ("angle" if is_angle else "dimensionless"), float(registry.Quantity(1.0, parsed).m_as(target))
    for name, kind in KINDS.items():
        if kind.si and name != "angle" and parsed.is_compatible_with(kind.si):
            return name, float(registry.Quantity(1.0, parsed).m_as(kind.si))
    return None


def kind_of(unit: str) -> str | None:
    """Kind of quantity that `unit` measures, or None if the unit is unknown.

    Examples
    --------
    >>> kind_of("gf"), kind_of("µm"), kind_of("furlongs of hay")
    ('force', 'length', None)
    """
    known = _parse_unit(unit)
    return known[0] if known else None


def unit_factor(unit: str, kind: str) -> float:
    """SI value of one `unit`.

    Parameters
    ----------
    unit : str
        For example ``"um"``, ``"µN"``, ``"gf"`` (9.80665e-3 N), ``"N/m"``.
    kind : str
        One of `KINDS`.

    Raises
    ------
    UnitError
        If the unit is unknown or measures another kind of quantity.

    Examples
    --------
    >>> unit_factor("gf", "force")
    0.00980665
    """
    wanted = kind_named(kind)
    known = _parse_unit(unit)
    same = [name for name in wanted.units if name.casefold() == unit.strip().casefold()]
    if known is None:
        meant = f"; did you mean {same[0]}?" if same else ";"
        raise UnitError(f"unknown unit {unit!r} for {_article(kind)}{meant} allowed: {_offer(wanted)}")
    found, factor = known
    if found not in (kind, _ALSO.get(kind)):
        raise UnitError(f"{unit!r} is a unit of {found}, but {_article(kind)} is needed: {_offer(wanted)}")
    # "6 Mm" is 6000 km: a mistaken capital is a factor of 1e9, in units in which no sample is measured. mHz is
    # allowed.
    if same and unit.strip() not in same and kind != "frequency":
        raise UnitError(
            f"unit {unit!r} is {factor:g} {wanted.si}; did you mean {same[0]}? allowed: {_offer(wanted)}"
        )
    return factor


def _article(kind: str) -> str:
    if kind == "dimensionless":
        return "a dimensionless number"
    return f"{'an' if kind[0] in 'aeiou' else 'a'} {kind}"


def _offer(kind: Kind) -> str:
    named = [unit for unit in kind.units if unit]
    return (
        f"{', '.join(named)} (write {kind.example!r})" if named else f"a bare number such as {kind.example}"
    )


def parse_quantity(value: str | float, kind: str) -> float:
    """Read a number with its unit as an SI float.

    Parameters
    ----------
    value : str or float
        Such as ``"1.5 mm"`` or ``"0.4 MPa"``. A bare number is allowed for a dimensionless quantity only.
    kind : str
        One of `KINDS`.

    Returns
    -------
    float
        The value in SI (angles in radians).

    Raises
    ------
    UnitError
        If the unit is missing, unknown or of another kind, or the number is not one.

    Examples
    --------
    >>> parse_quantity("1.5 mm", "length")
    0.0015
    >>> parse_quantity("0.5 gf", "force")
    0.004903325
    """
    wanted = kind_named(kind)
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise UnitError(f"{_article(kind)} must be given as {wanted.example!r}; got {value!r:.80}")
    matched = _NUMBER.fullmatch(value) if isinstance(value, str) else None
    if isinstance(value, str):
        comma = _DECIMAL_COMMA.fullmatch(value)
        if comma is not None:
            raise UnitError(f"write the number with a point: {'.'.join(comma.groups())!r}; got {value!r:.80}")
        if matched is None:
            raise UnitError(f"{_article(kind)} must be given as {wanted.example!r}; got {value!r:.80}")
        number, unit = float(matched.group(1)), matched.group(2)
    else:
        number, unit = float(value), ""
    if not math.isfinite(number):
        raise UnitError(f"{_article(kind)} must be finite; got {value!r:.80}")
    if not unit and kind != "dimensionless":
        raise UnitError(f"{value!r:.80} has no unit; {_article(kind)} takes one of {_offer(wanted)}")
    scaled = _scaled(number, unit, kind)
    if kind != "dimensionless" and scaled and not _SMALLEST <= abs(scaled) <= _LARGEST:
        raise UnitError(
            f"{_article(kind)} of {value!r:.80} is not physical: its size must be from {_SMALLEST:g} to "
            f"{_LARGEST:g} in SI, or zero; is the exponent right?"
        )
    return scaled


def _scaled(number: float, unit: str, kind: str) -> float:
    factor = unit_factor(unit, kind) if unit else 1.0
    # 1.5 * 1e-3 is not the double nearest to 1.5e-3 for every number; dividing by the exact inverse is.
    inverse = round(1.0 / factor) if 0.0 < factor < 1.0 else 0
    exact = inverse and math.isclose(inverse * factor, 1.0, rel_tol=1e-15)
    return number / inverse if exact else number * factor


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
    """Write the ends of an interval (SI) for people, each in a suitable unit, with enough digits to show its width.

    Four digits each, and where they are close as many as show two digits of the distance between them.

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
    """Significant digits for the ends of an interval: four, or as many as show two digits of their distance.

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
    number = f"{value / factor:.{digits}g}"
    # Above the largest unit: 1500 GPa, not 1.5e+03 GPa.
    number = f"{float(number):.0f}" if re.search(r"e\+0\d$", number) else number
    return f"{number} {unit}".rstrip()


def format_quantity(
    value: float, kind: str, uncertainty: float | None = None, *, digits: int = _DIGITS
) -> str:
    """Write an SI value for people, in a unit of suitable size.

    Parameters
    ----------
    value : float
        In SI.
    kind : str
        One of `KINDS`.
    uncertainty : float, optional
        Standard error or half width in the same SI unit; sets the digits shown (two of its own).
    digits : int
        Significant digits of a value without an uncertainty.

    Examples
    --------
    >>> format_quantity(4.2e5, "pressure")
    '0.42 MPa'
    >>> format_quantity(1.5034e-3, "length", 2.1e-5)
    '1.503 ± 0.021 mm'
    >>> format_quantity(0.0, "length", 1.5e-9)
    '0.0 ± 1.5 nm'
    """
    if uncertainty is None or not math.isfinite(uncertainty) or uncertainty <= 0.0:
        return _written(value, kind, digits)
    unit, factor = human_unit(max(abs(value), uncertainty), kind)
    scaled = value / factor
    suffix = f" {unit}" if unit else ""
    error = uncertainty / factor
    decimals = max(0, 1 - math.floor(math.log10(error)))
    if decimals > 12:
        return f"{scaled:.12g} ± {error:.2g}{suffix}"
    return f"{scaled:.{decimals}f} ± {error:.{decimals}f}{suffix}"
