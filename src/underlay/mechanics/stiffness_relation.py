"""Layer modulus from unloading stiffness and contact area, with thickness and substrate in the relation.

Formula (9.6), dP/dw = 4 theta sqrt(A/pi) kappa_inf(a/h), with force P, depth w, contact area A and radius a,
layer thickness h and kappa_inf the stiffness of a flat punch over that on a half-space; it extends the relation
of Bulychev, Alekhin and Shorshorov (1976; Pharr, Oliver and Brotzen (1992), doi:10.1557/JMR.1992.0613), theta =
E/(2 (1 - nu^2)). It holds for every axisymmetric indenter (9.3) and, with the exact kappa_inf, exactly. (In
(9.6) A is the contact area; elsewhere in the paper it is the shape's constant.)

On an elastic substrate kappa_inf depends on E itself, and E is the root of an increasing relation. The area of
a worn pyramid is that of its `AreaFunction`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Self, TypeAlias

import numpy as np
from scipy import optimize

from underlay._arrays import ArrayLike, FloatArray, as_finite, positive
from underlay.errors import InputError, RangeError
from underlay.mechanics.body import RIGID, Base, Layer
from underlay.mechanics.indenters import Cone, FlatPunch
from underlay.mechanics.materials import Isotropic
from underlay.mechanics.solver import Solver
from underlay.mechanics.solvers import as_solver, contact_law

# kappa_inf from (a/h, layer material, substrate): the flat punch's factor of (9.5).
_PunchFactor: TypeAlias = Callable[[float, Isotropic, Base], float]
# The modulus is looked for within this factor of the half-space value either way.
_WIDEST_RATIO = 1e8


@dataclass(frozen=True)
class AreaFunction:
    """Area function of a worn pyramid: its projected contact area at a contact depth (Oliver and Pharr 1992).

        A(h_c) = C_0 h_c^2 + C_1 h_c + C_2 h_c^(1/2) + C_3 h_c^(1/4) + ...

    (doi:10.1557/JMR.1992.1564). A contact of that area is as stiff as that of a flat punch of its size (9.6).

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
        """Radius (m) of the circle with the projected area at contact depths (m)."""
        return np.sqrt(self.area(contact_depth) / math.pi)


def _exponents(terms: int) -> FloatArray:
    return np.array([2.0, *(2.0**-n for n in range(terms - 1))])


def _powers(depth: FloatArray, terms: int) -> FloatArray:
    return np.asarray(depth)[..., None] ** _exponents(terms)


def modulus_from_stiffness(
    stiffness: ArrayLike,
    *,
    nu: float,
    contact_radius: ArrayLike | None = None,
    contact_area: ArrayLike | None = None,
    thickness: float = np.inf,
    substrate: Base | None = None,
    solver: str | Solver = "exact",
) -> FloatArray:
    """Young's modulus (Pa) of a layer from the unloading stiffness and the contact area (9.6).

    Equation numbers are those of Argatov and Sabina.

    Parameters
    ----------
    stiffness : array_like
        Incremental stiffness dP/dw (N/m) at the start of unloading, positive.
    nu : float
        Poisson's ratio of the layer.
    contact_radius, contact_area : array_like
        Contact radius a (m) or area pi a^2 (m^2), one of the two; broadcasts with `stiffness`.
    thickness : float, default inf
        Thickness h (m).
    substrate : material, RIGID or None
        What is under the layer; None is a half-space of the layer.
    solver : str or Solver, default "exact"
        What gives kappa_inf: the stiffness of its flat punch over that on a half-space.

    Returns
    -------
    ndarray
        Broadcast shape of the inputs.

    Raises
    ------
    InputError
        If not exactly one of `contact_radius` and `contact_area` is given, or a value is not positive.
    RangeError
        If no modulus gives the stiffness: the substrate alone is more compliant than the test; or if the
        contact is larger than the solver reaches.

    Examples
    --------
    >>> from underlay.mechanics.body import RIGID
    >>> float(modulus_from_stiffness(4.0, nu=0.0, contact_radius=1.0))
    2.0
    >>> E = modulus_from_stiffness(4.0, nu=0.0, contact_radius=1.0, thickness=4.0, substrate=RIGID)
    >>> f"{E:.4f}"
    '1.6263'
    """
    if (contact_radius is None) == (contact_area is None):
        raise InputError("give one of contact_radius (m) and contact_area (m^2)")
    slope = _positive(stiffness, "stiffness", "N/m")
    if contact_area is not None:
        radius = np.sqrt(_positive(contact_area, "contact_area", "m^2") / np.pi)
    else:
        radius = _positive(contact_radius, "contact_radius", "m")
    slope, radius = np.broadcast_arrays(slope, radius)
    unit = Isotropic(1.0, nu)
    halfspace = slope / (4.0 * radius * unit.theta)
    if substrate is None or not np.isfinite(thickness):
        return np.asarray(halfspace)[()]
    h = positive(thickness, "thickness", "m")
    factor = _punch_factor(as_solver(solver))
    if substrate == RIGID:
        # On a rigid base kappa_inf depends on nu alone.
        kappa = [factor(float(a) / h, unit, substrate) for a in radius.ravel()]
        return np.asarray(halfspace / np.reshape(kappa, radius.shape))[()]
    moduli = [
        _solve(float(E), float(a) / h, nu, substrate, factor)
        for E, a in zip(halfspace.ravel(), radius.ravel(), strict=True)
    ]
    return np.reshape(moduli, radius.shape)[()]


def _punch_factor(solver: Solver) -> _PunchFactor:
    def factor(eps: float, layer: Isotropic, substrate: Base) -> float:
        # A flat punch's law is a line: any depth tells its slope.
        shallow = 1e-3 * eps
        punch = contact_law(FlatPunch(eps), Layer(layer, 1.0), substrate, max_depth=shallow, solver=solver)
        return float(punch.stiffness(np.array([shallow]))[0]) / (4.0 * layer.theta * eps)

    return factor


def _solve(halfspace: float, eps: float, nu: float, substrate: Base, factor: _PunchFactor) -> float:
    """Young's modulus E (Pa) with E kappa_inf(E) = `halfspace`, by bracketing in ln E.

    `halfspace` (Pa) is the modulus that the half-space formula gives; `eps` is a/h, `nu` the layer's.
    """

    def excess(log_modulus: float) -> float:
        modulus = float(np.exp(log_modulus))
        return float(np.log(modulus * factor(eps, Isotropic(modulus, nu), substrate) / halfspace))

    start = float(np.log(halfspace))
    reach, first = 0.5, excess(start)
    if first == 0.0:
        return halfspace
    direction = -1.0 if first > 0.0 else 1.0
    while reach <= np.log(_WIDEST_RATIO):
        if excess(start + direction * reach) * first <= 0.0:
            low, high = sorted((start, start + direction * reach))
            return float(np.exp(optimize.brentq(excess, low, high, xtol=1e-14, rtol=1e-14)))
        reach *= 2.0
    raise RangeError(
        f"no layer modulus gives this stiffness: at a/h = {eps:.4g} the substrate alone is too "
        f"{'compliant' if direction > 0.0 else 'stiff'} for it; check contact area, thickness and substrate"
    )


def _positive(values: ArrayLike, name: str, unit: str) -> FloatArray:
    array = as_finite(values, name)
    if not (array > 0.0).all():
        raise InputError(f"{name} must be positive ({unit}); got {array.min():.6g}")
    return array
