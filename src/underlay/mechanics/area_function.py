"""The area function of a worn pyramid: how large its contact is at a contact depth (Oliver and Pharr 1992).

    A(h_c) = C_0 h_c^2 + C_1 h_c + C_2 h_c^(1/2) + C_3 h_c^(1/4) + ...

(doi:10.1557/JMR.1992.1564). A contact of that area is as stiff as that of a flat punch of its size (9.6).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy import optimize

from underlay._arrays import ArrayLike, FloatArray, as_finite
from underlay.errors import InputError
from underlay.mechanics.indenters import Cone

__all__ = ["AreaFunction"]


@dataclass(frozen=True)
class AreaFunction:
    """Projected contact area of a tip.

    Parameters
    ----------
    coefficients : tuple of float
        C_0 (dimensionless), C_1 (m), C_2 (m^(3/2)), C_3 (m^(7/4)), ...; C_0 is 24.5 of a perfect Berkovich tip.

    Raises
    ------
    InputError
        If there is none, or the first is not positive.

    Examples
    --------
    >>> round(AreaFunction.of_cone(Cone.berkovich()).coefficients[0], 1)
    24.5
    >>> float(AreaFunction((math.pi,)).radius(2e-6))
    2e-06
    """

    coefficients: tuple[float, ...]

    def __post_init__(self) -> None:
        given = tuple(float(value) for value in self.coefficients)
        if not given or not given[0] > 0.0 or not np.isfinite(given).all():
            raise InputError(
                f"an area function begins with a positive C_0, such as 24.5; got {self.coefficients!r:.80}"
            )
        object.__setattr__(self, "coefficients", given)

    @classmethod
    def of_cone(cls, cone: Cone) -> Self:
        """Area of a perfect cone, or of the pyramid that it is equivalent to: pi tan^2(half_angle) h_c^2."""
        return cls((math.pi * math.tan(cone.half_angle) ** 2,))

    @classmethod
    def calibrated(
        cls,
        contact_depth: ArrayLike,
        stiffness: ArrayLike,
        *,
        modulus: float,
        punch_factor: float = 1.05,
        terms: int = 4,
    ) -> Self:
        """Fit an area function to a test on a sample of known modulus: A = (pi/4) (S / (beta E_r))^2.

        Coefficients are not negative, which keeps the area growing; relative errors are minimised.

        Parameters
        ----------
        contact_depth, stiffness : array_like (n,)
            Contact depths h_c (m) and stiffnesses S (N/m).
        modulus : float
            E_r (Pa) of tip and sample together.
        punch_factor : float
            beta: how much stiffer the pyramid is than a round punch of its area (King 1987).
        terms : int
            How many coefficients.
        """
        depth, slope = as_finite(contact_depth, "contact_depth"), as_finite(stiffness, "stiffness")
        if not ((depth > 0.0).all() and (slope > 0.0).all() and modulus > 0.0 and depth.size >= terms >= 1):
            raise InputError(
                "a calibration needs positive contact depths, stiffnesses and modulus, and as many points as terms"
            )
        area = 0.25 * math.pi * (slope / (punch_factor * modulus)) ** 2
        # Depths in units of the largest keep the columns of like size.
        unit = float(depth.max())
        columns = _powers(depth / unit, terms) / area[:, None]
        found, _ = optimize.nnls(columns * float(area.max()), np.ones(depth.size))
        scales = unit ** (-_exponents(terms)) * float(area.max())
        return cls(tuple(float(value) for value in found * scales))

    def area(self, contact_depth: ArrayLike) -> FloatArray:
        """Projected area (m^2) at contact depths (m)."""
        depth = as_finite(contact_depth, "contact_depth")
        if not (depth > 0.0).all():
            raise InputError(f"contact depths must be positive (m); got {depth.min():.6g}")
        found: FloatArray = _powers(depth, len(self.coefficients)) @ np.array(self.coefficients)
        return found

    def radius(self, contact_depth: ArrayLike) -> FloatArray:
        """Radius (m) of the round contact of this area."""
        return np.sqrt(self.area(contact_depth) / math.pi)


def _exponents(terms: int) -> FloatArray:
    return np.array([2.0, *(2.0**-n for n in range(terms - 1))])


def _powers(depth: FloatArray, terms: int) -> FloatArray:
    return np.asarray(depth)[..., None] ** _exponents(terms)
