"""The calibration of a cantilever as a person gives it: a number, how well it is known, or both."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from underlay.errors import InputError, UnitError
from underlay.units import parse_quantity

__all__ = ["Calibration"]

# What may be given, and the kinds of quantity it may be: detectors give a voltage or a current.
_KINDS = {"spring_constant": ("stiffness",), "sensitivity": ("sensitivity", "current sensitivity")}
_PLUS_MINUS = re.compile(r"±|\+/-|\+-")
_PER_CENT = re.compile(r"\s*(\d+(?:\.\d+)?)\s*%\s*")


@dataclass(frozen=True)
class Calibration:
    """What is given beside a file.

    Parameters
    ----------
    values : mapping of str to float
        SI numbers by kind of quantity: ``stiffness``, ``sensitivity``, ``current sensitivity``.
    uncertainties : mapping of str to float
        Relative standard uncertainties by name: ``spring_constant``, ``sensitivity``.
    """

    values: Mapping[str, float] = field(default_factory=dict)
    uncertainties: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, given: Mapping[str, str | float] | None) -> Calibration:
        """Read ``{"spring_constant": "0.04 N/m ± 10 %", "sensitivity": "± 3 %"}``.

        Without a number, the file's own is as well known as that.

        Raises
        ------
        InputError
            If a name or a number is not one of these.

        Examples
        --------
        >>> known = Calibration.of({"spring_constant": "0.04 N/m +- 0.004 N/m", "sensitivity": "± 3 %"})
        >>> dict(known.values), {name: round(share, 9) for name, share in known.uncertainties.items()}
        ({'stiffness': 0.04}, {'spring_constant': 0.1, 'sensitivity': 0.03})
        """
        values: dict[str, float] = {}
        uncertainties: dict[str, float] = {}
        for name, text in (given or {}).items():
            if name not in _KINDS:
                raise InputError(f"no calibration {name!r}; there are {', '.join(_KINDS)}")
            number, spread = _apart(text)
            if number != "":
                kind, value = _value(name, number)
                values[kind] = value
            if spread is not None:
                uncertainties[name] = _share(name, number, spread)
        return cls(values, uncertainties)

    @property
    def metadata(self) -> dict[str, float]:
        """The uncertainties under the names that a curve's metadata give them."""
        return {f"{name}_uncertainty": share for name, share in self.uncertainties.items()}


def _apart(text: str | float) -> tuple[str | float, str | None]:
    """A number, which may be '', and what stands behind its ±; None where there is none."""
    number, *spread = _PLUS_MINUS.split(text, maxsplit=1) if isinstance(text, str) else ("",)
    return (number.strip(), spread[0].strip()) if spread else (text, None)


def _value(name: str, number: str | float) -> tuple[str, float]:
    kinds = _KINDS[name]
    kind = next((kind for kind in kinds if _is_of_kind(number, kind)), kinds[0])
    value = parse_quantity(number, kind)
    if value <= 0.0:
        raise InputError(f"calibration {name!r} must be positive; got {number!r}")
    return kind, value


def _share(name: str, number: str | float, spread: str) -> float:
    """Relative uncertainty of a number, from per cent or from a quantity like it."""
    per_cent = _PER_CENT.fullmatch(spread)
    if per_cent is not None:
        share = float(per_cent[1]) / 100.0
    elif number == "":
        raise InputError(
            f"calibration {name!r}: without a number its uncertainty is in per cent; got '± {spread}'"
        )
    else:
        share = _value(name, spread)[1] / _value(name, number)[1]
    if not 0.0 < share < 1.0:
        raise InputError(
            f"calibration {name!r} must be known to better than a factor of two; got an uncertainty of {share:.3g}"
        )
    return share


def _is_of_kind(value: str | float, kind: str) -> bool:
    try:
        parse_quantity(value, kind)
    except UnitError:
        return False
    return True
