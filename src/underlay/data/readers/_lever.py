"""What turns the signals of an AFM into a curve.

Volts times the sensitivity s are the bending of the lever, and that times its spring constant k the force,
F = k s V. The tip goes as deep as the scanner travels, less what the lever bends: w = z - F / k.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.data.readers._format import make_curve
from underlay.data.readers._source import Source
from underlay.errors import FileFormatError, InputError

__all__ = ["Lever", "lever_curve", "sensor_note", "uncalibrated"]

# A piezo without closed loop is off by a few per cent, and 1.35 and 1.21 times were seen in files.
_CLOSE = 0.1
#: Kinds of quantity of a calibration, and what they are called in the metadata of a curve.
_NAMES = {"stiffness": "spring_constant", "sensitivity": "sensitivity"}


@dataclass(frozen=True)
class Lever:
    """The calibration of a cantilever that is used, and where it comes from.

    Parameters
    ----------
    stiffness : float
        Spring constant (N/m).
    sensitivity : float or None
        Bending per volt of the detector (m/V), as far as it is known.
    about : mapping of str to float
        Both under the names that a curve's metadata give them, and the file's own, ``file_...``, where another
        was given in its place.
    """

    stiffness: float
    sensitivity: float | None = None
    about: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, source: Source, stated: Mapping[str, float], given: Mapping[str, float]) -> Lever:
        """Take what is given, else what the file states; both by kind (``stiffness``, ``sensitivity``), SI.

        Raises
        ------
        InputError
            If there is no spring constant, or one is given that is none of these.
        """
        unused = sorted(set(given) - set(_NAMES))
        if unused:
            raise InputError(
                f"{source.name} takes no {unused[0]}; give the sensitivity in metres per volt, such as '60 nm/V'"
            )
        for kind, value in stated.items():
            if not (np.isfinite(value) and value > 0.0):
                raise FileFormatError(
                    f"{source.name} states a {_NAMES[kind]} of {value:g}; it must be positive"
                )
        used = {**stated, **given}
        if "stiffness" not in used:
            raise uncalibrated(source)
        about = {_NAMES[kind]: value for kind, value in used.items()}
        about |= {f"file_{_NAMES[kind]}": stated[kind] for kind in given if kind in stated}
        return cls(used["stiffness"], used.get("sensitivity"), about)

    def force(self, source: Source, volts: FloatArray) -> FloatArray:
        """Force (N) of the detector's volts, k s V; raises InputError without a sensitivity."""
        if self.sensitivity is None:
            raise uncalibrated(source)
        return volts * (self.sensitivity * self.stiffness)


def uncalibrated(source: Source) -> InputError:
    """What to say of a file that lacks what its curve needs."""
    return InputError(
        f"{source.name} does not hold its calibration; give calibration={{'spring_constant': '0.04 N/m', "
        "'sensitivity': '60 nm/V'} with your numbers"
    )


def lever_curve(
    source: Source,
    travel: FloatArray,
    force: FloatArray,
    lever: Lever,
    *,
    channel: str,
    time: FloatArray | None = None,
    segment: NDArray[np.str_] | None = None,
    **metadata: Any,
) -> Curve:
    """Make a curve of a scanner's travel and a lever's force.

    Parameters
    ----------
    travel : ndarray (n,)
        Travel of the scanner, growing towards the sample (m); its zero is arbitrary.
    force : ndarray (n,)
        Force on the lever, positive in compression (N).
    lever : Lever
        Its spring constant takes the bending off: depth = travel - force / spring constant.
    channel : str
        What the travel was read from, for the rule of sign.
    time, segment : ndarray (n,), optional
        Time (s) and labels.
    **metadata
        What else the reader knows of the curve.

    Raises
    ------
    CurveError
        If no point is left.
    """
    rules = {
        "depth": f"{channel} - force / spring constant",
        "force": "positive in compression: volts * sensitivity * spring constant",
        **metadata.pop("sign_rules", {}),
    }
    return make_curve(
        source,
        travel - force / lever.stiffness,
        force,
        time,
        segment,
        units={"depth": "m", "force": "N", "time": "s"},
        sign_rules=rules,
        bending_taken_off=True,
        **{**lever.about, **metadata},
    )


def sensor_note(sensor: FloatArray, driven: float) -> tuple[str, ...]:
    """What to say where a height sensor (m), (n,), moved otherwise than the piezo was driven (m)."""
    moved = sensor[np.isfinite(sensor)]
    if not (moved.size and driven > 0.0) or abs(np.ptp(moved) / driven - 1.0) <= _CLOSE:
        return ()
    note = (
        f"the height sensor moved {np.ptp(moved) / driven:.2f} times as far as the piezo was driven; the sensor is "
        "taken, but one of their two calibrations is off"
    )
    return (note,)
