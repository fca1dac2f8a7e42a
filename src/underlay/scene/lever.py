"""A cantilever whose bending was taken off the depth, with a calibration that may be off.

A detector's volts V are the bending d = s V by the sensitivity s, and the force F = k s V by the spring constant k;
the depth reading is the scanner's travel less the bending. With the true values k' = kappa k and s' = sigma s,

    force reading = P(w) / (kappa sigma),        w = depth reading - d0 - (sigma - 1) F / k,

F being the force reading itself: the model's, of which noise is no part. The spring constant alone scales the
force and leaves the depth; the sensitivity acts on both, in the same direction: for a sphere d ln E / d ln s is
about 1 + 3/2 of bending over depth.

The thermal method finds k from the same sensitivity, k ~ s^-2 (Hutter & Bechhoefer 1993, doi:10.1063/1.1143970):
kappa is then sigma**-2 times what else is not known of it, and taking the two for independent is cautious.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from underlay._arrays import FloatArray, finite
from underlay.errors import InputError
from underlay.quantities import Part, field_quantities, quantity
from underlay.units import KINDS

__all__ = ["FURTHER", "SENSITIVITY_RATIO", "SPRING_CONSTANT", "SPRING_CONSTANT_RATIO", "Lever"]

#: Paths of the two numbers that a calibration may be off by.
SPRING_CONSTANT_RATIO = "lever.spring_constant_ratio"
SENSITIVITY_RATIO = "lever.sensitivity_ratio"
#: Path of the one that made the curve.
SPRING_CONSTANT = "lever.spring_constant"
#: A lever that bends less than was taken off lets the tip deeper: laws reach so much further than the readings.
FURTHER = 2.0

_POSITIVE = (0.0, np.inf)


@dataclass(frozen=True)
class Lever(Part):
    """A cantilever and how far its true calibration is from the one that made the curve.

    Parameters
    ----------
    spring_constant : float
        The one that made the curve (N/m): of the file, or given in its place.
    spring_constant_ratio : float
        True over that.
    sensitivity_ratio : float
        True sensitivity of the detector over the one that made the curve.

    Raises
    ------
    InputError
        If one of them is not positive.

    Examples
    --------
    A spring constant that is known to 10 % is a parameter of the fit with that prior:

    >>> from underlay import Isotropic, Layer, Lever, LogNormal, Paraboloid, Scene
    >>> scene = Scene(Paraboloid(5e-6), Layer(Isotropic(1e3, 0.5)), lever=Lever(0.04))
    >>> free = {"layer.E": None, "lever.spring_constant_ratio": LogNormal(1.0, 0.1)}
    >>> sorted(path for path in scene.parameters if path.startswith("lever."))
    ['lever.sensitivity_ratio', 'lever.spring_constant', 'lever.spring_constant_ratio']
    """

    parts: ClassVar[tuple[str, ...]] = ("lever",)

    spring_constant: float = field(
        metadata=quantity("stiffness", "spring constant of the lever", symbol="k", bounds=_POSITIVE)
    )
    spring_constant_ratio: float = field(
        default=1.0,
        metadata=quantity(
            "dimensionless", "true over stated spring constant", symbol=r"\kappa", bounds=_POSITIVE
        ),
    )
    sensitivity_ratio: float = field(
        default=1.0,
        metadata=quantity(
            "dimensionless", "true over stated sensitivity", symbol=r"\sigma", bounds=_POSITIVE
        ),
    )

    def __post_init__(self) -> None:
        for name, known in field_quantities(self).items():
            value = finite(getattr(self, name), f"lever {name}", KINDS[known.kind].si)
            if not value > 0.0:
                raise InputError(f"lever {name} must be positive; got {value!r}")
            object.__setattr__(self, name, value)

    @property
    def gain(self) -> float:
        """Force reading over true force, 1 / (kappa sigma)."""
        return 1.0 / (self.spring_constant_ratio * self.sensitivity_ratio)

    @property
    def compliance(self) -> float:
        """What bends more than was taken off, over the force reading: (sigma - 1) / k (m/N), of either sign."""
        return (self.sensitivity_ratio - 1.0) / self.spring_constant

    def bending(self, force: FloatArray) -> FloatArray:
        """Bending (m) that was taken off at force readings (N)."""
        return np.asarray(force / self.spring_constant)
