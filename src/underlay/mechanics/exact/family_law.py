"""A contact law read off the table of its master curve: what a fit asks for at every step."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import log

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import RangeError
from underlay.mechanics.exact.contact_curve import ContactProblem, SolvedCurve, solve_curve
from underlay.mechanics.exact.curve_family import (
    Cell,
    CurveFamily,
    curve_family,
    range_end,
    range_number,
    ratio_number,
)
from underlay.mechanics.exact.law import ExactLaw
from underlay.mechanics.exact.master_curve import Factor, polynomial
from underlay.mechanics.indenters import PowerLaw, PowerLawShape
from underlay.mechanics.materials import isotropic_constants

__all__ = ["FamilyLaw", "tabulated_law"]

_CURVES_KEPT = 1024


@dataclass(frozen=True, kw_only=True)
class FamilyLaw(ExactLaw):
    """An exact law read off a table, which knows its derivative in the modulus ratio.

    Parameters
    ----------
    family : CurveFamily
        The table.
    log_ratio : float
        ln(E of the base / E of the layer).
    """

    family: CurveFamily
    log_ratio: float

    def ratio_slope(self, depth: FloatArray, force: FloatArray) -> FloatArray:
        """dP/d ln k (N) at fixed depth (m), (n,), where the force (N) is `force`; zero out of contact."""
        varpi = self.measure.halfspace_radius(np.maximum(depth, 0.0)) / self.thickness
        table = self.family.slopes(self.log_ratio)[Factor.FORCE]
        return force * polynomial(table, self.family.stretch.z(varpi))


def tabulated_law(
    indenter: PowerLawShape,
    *,
    layer: tuple[float, float],
    base: tuple[float, float] | None,
    thickness: float,
    varpi: float,
    rtol: float,
) -> ExactLaw | None:
    """Exact law of a power-law tip on an isotropic layer, solved for itself or one like it before.

    Parameters
    ----------
    indenter : PowerLawShape
        The tip.
    layer, base : (E, nu)
        Young's modulus (Pa) and Poisson's ratio; `base` None is rigid.
    thickness : float
        Of the layer (m).
    varpi : float
        Half-space contact radius over thickness that must be reached; the law goes to the end of its cell.
    rtol : float
        Relative error allowed.

    Returns
    -------
    FamilyLaw, or on a rigid base ExactLaw
        None where there is no table.
    """
    reach = range_number(varpi)
    theta = float(isotropic_constants(*layer).theta)
    max_depth = float(indenter.abel(np.array([range_end(reach) * thickness]))[0])
    if base is None:
        solved = _on_rigid_base(indenter.exponent, layer[1], reach, rtol)
        if solved is None:
            return None
        return ExactLaw(
            method="exact",
            reason=(
                f"exact contact problem, solved for a/h up to {solved.eps:.3g}, "
                f"{solved.resolution.radial} nodes"
            ),
            max_depth=max_depth,
            error_estimate=solved.error_estimate,
            measure=indenter,
            theta=theta,
            thickness=thickness,
            curve=solved.curve,
            resolution=solved.resolution,
            radii=solved.radii,
        )
    ratio = base[0] / layer[0]
    cell = Cell(indenter.exponent, layer[1], base[1], ratio_number(ratio), reach, rtol)
    family = curve_family(cell)
    if family is None or family.error_estimate > rtol:
        return None
    return FamilyLaw(
        method="exact",
        reason=f"exact contact problem, tabulated over the ratio of moduli for a/h up to {family.eps:.3g}",
        max_depth=max_depth,
        error_estimate=family.error_estimate,
        measure=indenter,
        theta=theta,
        thickness=thickness,
        curve=family.curve(log(ratio)),
        resolution=family.resolution,
        radii=family.radii,
        family=family,
        log_ratio=log(ratio),
    )


@lru_cache(maxsize=_CURVES_KEPT)
def _on_rigid_base(exponent: float, nu: float, reach: int, rtol: float) -> SolvedCurve | None:
    """Curve of a tip of any size on a layer of unit thickness and any modulus; None beyond 20 thicknesses."""
    problem = ContactProblem.of(PowerLaw(exponent, 1.0), 1.0, isotropic_constants(1.0, nu), None)
    try:
        return solve_curve(problem, range_end(reach), rtol)
    except RangeError:
        return None
