"""Layer modulus from unloading stiffness and contact area, with thickness and substrate in the relation.

Formula (9.6), dP/dw = 4 theta sqrt(A/pi) kappa_inf(a/h), which extends the relation of Bulychev, Alekhin and
Shorshorov (1976; Pharr, Oliver and Brotzen (1992), doi:10.1557/JMR.1992.0613), theta = E/(2 (1 - nu^2)). It
holds for every axisymmetric indenter (9.3) and, with the exact kappa_inf, exactly. (In (9.6) A is the contact
area; elsewhere in the paper it is the shape's constant.)

On an elastic substrate kappa_inf depends on E itself, and E is the root of an increasing relation.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from scipy import optimize

from underlay._arrays import ArrayLike, FloatArray, as_finite, positive
from underlay.errors import InputError, RangeError
from underlay.mechanics.body import RIGID, Base, Layer
from underlay.mechanics.indenters import FlatPunch
from underlay.mechanics.materials import Isotropic
from underlay.mechanics.solver import Solver
from underlay.mechanics.solvers import as_solver, contact_law

__all__ = ["modulus_from_stiffness"]

# kappa_inf from (a/h, layer material, substrate): the flat punch's factor of (9.5).
_PunchFactor: TypeAlias = Callable[[float, Isotropic, Base], float]

# The modulus is looked for within this factor of the half-space value either way.
_WIDEST_RATIO = 1e8


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
    """Solve E kappa_inf(E) = `halfspace` in ln E between brackets that double."""

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
