"""The kinds of quantity, and the units that people write them in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from underlay.errors import UnitError

__all__ = ["KINDS", "Kind", "kind_named"]


@dataclass(frozen=True)
class Kind:
    """One kind of quantity.

    Parameters
    ----------
    si : str
        The unit of the floats inside.
    units : tuple of str
        Units for people, smallest first; the ones an error message offers.
    example : str
        What a caller may write.
    """

    si: str
    units: tuple[str, ...]
    example: str


#: The kinds of quantity underlay speaks of.
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
        "dimensionless": Kind("", ("",), "0.45"),
    }
)


def kind_named(name: str) -> Kind:
    """Return the kind of that name.

    Raises
    ------
    UnitError
        If there is none.
    """
    try:
        return KINDS[name]
    except KeyError:
        raise UnitError(f"no kind of quantity {name!r}; there are {', '.join(KINDS)}") from None
