"""A contact law read off a table of master curves."""

from __future__ import annotations

from dataclasses import dataclass
from math import log

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.exact.curve_family import Cell, CurveFamily, curve_family
from underlay.mechanics.exact.law import ExactLaw
from underlay.mechanics.exact.master_curve import Factor, polynomial
from underlay.mechanics.indenters import PowerLawShape
from underlay.mechanics.materials import isotropic_constants

__all__ = ["FamilyLaw", "family_law"]


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


def family_law(
    indenter: PowerLawShape,
    *,
    layer_E: float,
    layer_nu: float,
    thickness: float,
    base: tuple[float, float] | None,
    varpi: float,
    rtol: float,
) -> FamilyLaw | None:
    """Exact law of a power-law tip on an isotropic layer, from the table of its cell; None if there is none.

    Parameters
    ----------
    indenter : PowerLawShape
        The tip.
    layer_E, layer_nu : float
        Of the layer (Pa, dimensionless).
    thickness : float
        Of the layer (m).
    base : (E, nu) or None
        Of the base; None is rigid.
    varpi : float
        Half-space contact radius over thickness that must be reached; the law goes to the end of the cell.
    rtol : float
        Relative error allowed.
    """
    ratio, base_nu = (np.inf, None) if base is None else (base[0] / layer_E, base[1])
    cell = Cell.holding(indenter.exponent, layer_nu, base_nu, ratio, varpi, rtol)
    family = curve_family(cell)
    if family is None or family.error_estimate > rtol:
        return None
    log_ratio = log(ratio) if base is not None else np.inf
    return FamilyLaw(
        method="exact",
        reason=f"exact contact problem, a/h up to {family.eps:.3g}, tabulated over the modulus ratio"
        if base is not None
        else f"exact contact problem, a/h up to {family.eps:.3g}, {family.resolution.radial} nodes",
        max_depth=float(indenter.abel(np.array([cell.top * thickness]))[0]),
        error_estimate=family.error_estimate,
        measure=indenter,
        theta=float(isotropic_constants(layer_E, layer_nu).theta),
        thickness=thickness,
        curve=family.curve(log_ratio),
        resolution=family.resolution,
        radii=family.radii,
        family=family,
        log_ratio=log_ratio,
    )
