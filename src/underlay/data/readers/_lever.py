"""From the signals of an AFM to a curve, and the calibration of its cantilever.

Volts V times the sensitivity s (m/V) are the bending of the cantilever, and that times its spring constant k
(N/m) the force, F = k s V. The tip goes as deep as the scanner travels, less what the cantilever bends: w = z
- F / k.

A person may give a calibration as a number, as how well the file's own number is known, or as both
(`Calibration.of`); what is used, and what the file itself had, is kept in the metadata of the curve
(`Lever`).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay._text import one_line
from underlay.data.curve import Curve
from underlay.data.readers._format import make_curve
from underlay.data.readers._source import Source, curve_name
from underlay.errors import InputError
from underlay.units import kind_of, parse_quantity

# What may be given, and the kinds of quantity it may be: detectors give a voltage or a current.
_KINDS = {"spring_constant": ("stiffness",), "sensitivity": ("sensitivity", "current sensitivity")}
_PLUS_MINUS = re.compile(r"±|\+/-|\+-")
_PER_CENT = re.compile(r"\s*(\d+(?:\.\d+)?)\s*%\s*")
# A piezo without closed loop is off by a few per cent, and 1.35 and 1.21 times were seen in files.
_CLOSE = 0.1
#: What is said of a depth of which no bending could be taken off.
STILL_BENT = (
    'depth still holds the bending of the cantilever: give calibration = { spring_constant = "0.04 N/m" } with '
    "your number, or set the instrument's compliance to its inverse"
)
#: Kinds of quantity of a calibration, and what they are called in the metadata of a curve.
_NAMES = {"stiffness": "spring_constant", "sensitivity": "sensitivity"}


@dataclass(frozen=True)
class Calibration:
    """The calibration of a cantilever as a caller gives it to `read`.

    Parameters
    ----------
    values : mapping of str to float
        SI numbers by kind of quantity: ``stiffness`` (N/m), ``sensitivity`` (m/V), ``current sensitivity`` (m/A).
    uncertainties : mapping of str to float
        Relative standard uncertainties by name: ``spring_constant``, ``sensitivity``.
    """

    values: Mapping[str, float] = field(default_factory=dict)
    uncertainties: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, given: Mapping[str, str | float] | None) -> Calibration:
        """Parse a calibration such as ``{"spring_constant": "0.04 N/m ± 10 %", "sensitivity": "± 3 %"}``.

        An uncertainty without a number, as "± 3 %", applies to the number that the file itself holds.

        Raises
        ------
        InputError
            If a name is unknown, or a number or an uncertainty cannot be read or is out of range.

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
            # A number, which may be '', and what stands behind its ±.
            parts = map(str.strip, _PLUS_MINUS.split(text, maxsplit=1)) if isinstance(text, str) else (text,)
            number, *spread = parts
            if number != "":
                values |= [_value(name, number)]
            if spread:
                uncertainties[name] = _share(name, number, str(spread[0]))
        return cls(values, uncertainties)


def _value(name: str, number: str | float) -> tuple[str, float]:
    unit = kind_of(str(number).strip().lstrip("+-.0123456789eE").strip())
    kind = unit if unit in _KINDS[name] else _KINDS[name][0]
    value = parse_quantity(number, kind)
    if value <= 0.0:
        raise InputError(f"calibration {name!r} must be positive; got {number!r}")
    return kind, value


def _share(name: str, number: str | float, spread: str) -> float:
    """Relative uncertainty (0 to 1) from the text behind a ±: per cent, or a quantity in the unit of the number."""
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


@dataclass(frozen=True)
class Lever:
    """The calibration of a cantilever that is used for a curve: the caller's where given, else the file's.

    Parameters
    ----------
    stiffness : float
        Spring constant (N/m).
    sensitivity : float or None
        Bending per volt of the detector (m/V); None if not known.
    about : mapping of str to float
        Both by their names in a curve's metadata (``spring_constant``, ``sensitivity``); where the caller replaced
        the file's number, that one too (``file_spring_constant``, ``file_sensitivity``).
    """

    stiffness: float
    sensitivity: float | None = None
    about: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, source: Source, stated: Mapping[str, float | None], given: Mapping[str, float]) -> Lever:
        """Use the calibration `given` by the caller, else the one `stated` by the file.

        Both map ``stiffness`` (N/m) and ``sensitivity`` (m/V) to numbers; zero or None in `stated` means that
        the file was not calibrated.

        Raises
        ------
        InputError
            If there is no spring constant, or a kind of calibration is given that is neither of the two.
        """
        for unused in sorted(set(given) - set(_NAMES)):
            raise InputError(
                f"{source.name} takes no {unused}; give the sensitivity in metres per volt, such as '60 nm/V'"
            )
        known = {kind: value for kind, value in stated.items() if value}
        for kind, value in known.items():
            sound = np.isfinite(value) and value > 0.0
            source.require(sound, f"states a {_NAMES[kind]} of {value:g}; it must be positive")
        used = {**known, **given}
        if "stiffness" not in used:
            raise uncalibrated(source)
        about = {_NAMES[kind]: value for kind, value in used.items()}
        about |= {f"file_{_NAMES[kind]}": known[kind] for kind in given if kind in known}
        return cls(used["stiffness"], used.get("sensitivity"), about)

    def force(self, source: Source, signal: FloatArray, unit: str = "V") -> FloatArray:
        """Force (N), (n,), of a deflection signal in `unit`: V, m or N; InputError for volts without a sensitivity.

        A signal in m or N holds the calibration of the file: it is rescaled where the caller gave another.
        """
        if unit == "V":
            if self.sensitivity is None:
                raise uncalibrated(source)
            return signal * (self.sensitivity * self.stiffness)
        for name in ("spring_constant", "sensitivity") if unit == "N" else ("sensitivity",):
            if f"file_{name}" in self.about:
                signal = signal * (self.about[name] / self.about[f"file_{name}"])
        return signal if unit == "N" else signal * self.stiffness


def uncalibrated(source: Source, unit: str = "nm/V") -> InputError:
    """The error for a file that lacks a spring constant or a sensitivity (in `unit`); says how to give them."""
    return InputError(
        f"{source.name} does not hold its calibration; give calibration = {{ "
        f'spring_constant = "0.04 N/m", sensitivity = "60 {unit}" }} with your numbers'
    )


def lever_curve(
    source: Source,
    travel: FloatArray,
    force: FloatArray,
    lever: Lever | None,
    *,
    channel: str,
    time: FloatArray | None = None,
    segment: NDArray[np.str_] | None = None,
    number: int = 1,
    header: Mapping[str, str] | None = None,
    **metadata: Any,
) -> Curve:
    """Make a curve of the travel of an AFM's scanner and the force on its cantilever.

    Parameters
    ----------
    travel : ndarray (n,)
        Travel of the scanner, growing towards the sample (m); its zero is arbitrary.
    force : ndarray (n,)
        Force on the lever, positive in compression (N).
    lever : Lever or None
        Its spring constant takes the bending off: depth = travel - force / spring constant. None, where it is not
        known, leaves it in, with a note.
    channel : str
        Name of the signal that the travel was read from, for the note on signs in the metadata.
    time, segment : ndarray (n,), optional
        Time (s) and segment labels.
    number : int
        Number of the curve in its file, from 1.
    header : mapping, optional
        Entries of the file's header, kept as one line of at most 200 characters each; empty ones are dropped.
    **metadata
        Further entries of the curve's metadata.

    Raises
    ------
    CurveError
        If no point is left.
    """
    entries = {name: one_line(text)[:200] for name, text in (header or {}).items() if text}
    rules = {
        "depth": f"{channel} - force / spring constant" if lever else channel,
        "force": "positive in compression: volts * sensitivity * spring constant",
        **metadata.pop("sign_rules", {}),
    }
    about: dict[str, Any] = {"name": curve_name(source.path, number), **(lever.about if lever else {})}
    if lever is None:
        about["notes"] = (STILL_BENT,)
    return make_curve(
        source,
        travel - force / lever.stiffness if lever else travel,
        force,
        time,
        segment,
        units={"depth": "m", "force": "N", "time": "s"},
        sign_rules=rules,
        bending_taken_off=lever is not None,
        header=entries,
        **{**about, **metadata},
    )


def sensor_note(sensor: FloatArray, driven: float) -> tuple[str, ...]:
    """Return a note that the height sensor and the drive disagree, or () where they agree.

    Parameters
    ----------
    sensor : ndarray (n,)
        Readings of the height sensor (m); NaN are left out.
    driven : float
        How far the piezo was driven (m); zero if not known.
    """
    moved = sensor[np.isfinite(sensor)]
    if not (moved.size and driven > 0.0) or abs(np.ptp(moved) / driven - 1.0) <= _CLOSE:
        return ()
    note = (
        f"the height sensor moved {np.ptp(moved) / driven:.2f} times as far as the piezo was driven; the sensor is "
        "taken, but one of their two calibrations is off"
    )
    return (note,)
