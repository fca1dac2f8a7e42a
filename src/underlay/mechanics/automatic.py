"""``method="auto"``: the cheapest law that keeps a tolerance against the exact contact problem.

In order of cost, each tried only where the one before does not serve:

1. no layer effect (no substrate, the same material, infinite thickness): half-space, no kernel;
2. layer and substrate alike within the tolerance: half-space, no kernel;
3. so small a contact that the layer changes force, radius and stiffness by less than the tolerance:
   half-space, judged by the kernel's moments;
4. the explicit fourth-order form, for shapes that have one, where its estimated error is below the tolerance;
5. the exact law.

Times of 1000 depths of a paraboloid, from cold, in units of the explicit formula: half-space 1, explicit
form 8 (the moments of the kernel are most of it), exact 9 to 13. The parametric and compliance forms must be
solved for each depth (35; a sphere 100 and more, where the exact law takes 16), so they are never the cheapest
and are not taken here; ask for them by name. What cannot serve is not tried: the moments are computed only
where a guess of the errors leaves room for 3 or 4.
"""

from __future__ import annotations

from dataclasses import replace
from math import sqrt

import numpy as np

from underlay.mechanics.asymptotic.law import AsymptoticLaw, contact_series, kernel_moments
from underlay.mechanics.asymptotic.series_error import HALFSPACE, series_error
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.exact.law import exact_law
from underlay.mechanics.halfspace import HalfspaceLaw, largest_halfspace_depth
from underlay.mechanics.indenters import FlatPunch, Indenter, PowerLawShape
from underlay.mechanics.materials import Layer, Material, PlaneConstants, Rigid, Substrate

__all__ = ["automatic_law", "compliance_contrast", "halfspace_law", "has_layer_effect"]

# Guesses of the errors for contrast 1, on the low side, from 75 pairs of materials and exponents from 1 to
# infinity. Explicit form: 1 to 2 varpi^5 on a base much stiffer, 0.09 at the least (bases that differ in
# Poisson's ratio), far more on a softer one. Half-space: 0.3 to 1.5 varpi, less where a_0 nearly vanishes.
# Where a guess is above the tolerance no moments are computed: a pair that is missed gets the exact law,
# which takes no longer.
_LEAST_EXPLICIT, _SOFTER = 0.3, 8.0
_LEAST_HALFSPACE = 0.03
# An error estimate above this is not trusted as a number, whatever the tolerance.
_LARGEST_ERROR = 0.02
# Contact radius and stiffness at a given depth move by up to about twice the change of the force, which is
# bounded by the contrast itself; measured in tests/test_accuracy.py.
_CONTRAST_MARGIN = 4.0


def automatic_law(
    indenter: Indenter, layer: Layer, substrate: Substrate | None, max_depth: float, rtol: float
) -> ContactLaw:
    """Build the cheapest law that keeps `rtol` in force, contact radius and stiffness up to `max_depth` (m).

    Returns
    -------
    ContactLaw
        Its `reason` says why, its `error_estimate` covers force, contact radius and stiffness.

    Raises
    ------
    RangeError
        If the contact would pass 20 thicknesses, or the end of the indenter's shape.
    """
    if substrate is None or not has_layer_effect(layer, substrate):
        return halfspace_law(indenter, layer)
    if not max_depth > 0.0:
        reason = "no contact: the largest depth is not positive"
        return replace(halfspace_law(indenter, layer), max_depth=0.0, reason=reason)
    contrast = compliance_contrast(layer.material, substrate)
    law = None
    if max_depth <= largest_halfspace_depth(indenter):
        if _CONTRAST_MARGIN * contrast <= rtol:
            why = f"layer and substrate differ by {contrast:.2g} in compliance"
            return _nearly_halfspace(indenter, layer, max_depth, _CONTRAST_MARGIN * contrast, why, rtol)
        law = _series_law(indenter, layer, substrate, max_depth, rtol, contrast)
    return law or exact_law(indenter, layer, substrate, max_depth=max_depth, rtol=rtol)


def has_layer_effect(layer: Layer, substrate: Substrate | None) -> bool:
    """Whether there is a substrate that differs from the layer, at a finite depth."""
    return substrate is not None and substrate != layer.material and bool(np.isfinite(layer.thickness))


def halfspace_law(indenter: Indenter, layer: Layer) -> HalfspaceLaw:
    """Build the law of a half-space of the layer's material."""
    return HalfspaceLaw(
        method="halfspace",
        reason="no layer effect: the layer is a half-space",
        max_depth=largest_halfspace_depth(indenter),
        error_estimate=0.0,
        indenter=indenter,
        theta=layer.material.theta,
    )


def compliance_contrast(layer: Material, substrate: Substrate) -> float:
    """Return how much two materials differ: delta with (1 - delta) C_1 <= C_2 <= (1 + delta) C_1.

    C = (1/g) [[sigma, q-p], [q-p, p sigma]] is the surface compliance of a half-space. Energy is monotone in
    the stiffness of a part, so the layered body is between two half-spaces of moduli E_1/(1 +- delta), and
    the force at a given depth within a relative delta/(1 - delta) of the half-space's, at any contact size.
    1 for a rigid substrate.
    """
    if isinstance(substrate, Rigid):
        return 1.0
    (a, b, d), (A, B, D) = _compliance(layer.plane_constants), _compliance(substrate.plane_constants)
    # Eigenvalues of C_1^-1 (C_2 - C_1) from trace and determinant of the 2 x 2 product.
    x, y, z = A - a, B - b, D - d
    determinant = a * d - b * b
    half_trace = 0.5 * (d * x - 2.0 * b * y + a * z) / determinant
    product = (x * z - y * y) / determinant
    return abs(half_trace) + sqrt(max(half_trace * half_trace - product, 0.0))


def _compliance(constants: PlaneConstants) -> tuple[float, float, float]:
    p, sigma, g = float(constants.p), float(constants.sigma), float(constants.g)
    return sigma / g, -float(constants.p_minus_q) / g, p * sigma / g


def _series_law(
    indenter: Indenter, layer: Layer, substrate: Substrate, max_depth: float, rtol: float, contrast: float
) -> ContactLaw | None:
    """Return the half-space or asymptotic law if one of them keeps `rtol`."""
    radius = float(indenter.halfspace_radius(np.array([max_depth]))[0])
    varpi = radius / layer.thickness
    allowed = min(rtol, _LARGEST_ERROR)
    explicit = isinstance(indenter, PowerLawShape | FlatPunch) and _least_explicit(contrast, varpi) <= allowed
    if not explicit and _LEAST_HALFSPACE * min(contrast, 1.0) * varpi > allowed:
        return None
    moments = kernel_moments(layer, substrate)
    exponents = _exponents(indenter, radius)
    effect = series_error(HALFSPACE, exponents, moments, varpi, stop_above=allowed)
    if effect <= allowed:
        return _nearly_halfspace(indenter, layer, max_depth, effect, f"a/h = {varpi:.2g}", rtol)
    if not explicit:
        return None
    error = series_error("explicit", exponents, moments, varpi, stop_above=allowed)
    if error > allowed:
        return None
    return AsymptoticLaw(
        method="asymptotic",
        reason=f"a/h = {varpi:.2g}, fourth order, estimated error {error:.1g}",
        max_depth=max_depth,
        error_estimate=error,
        order=4,
        form="explicit",
        error_depth=max_depth,
        max_radius_depth=max_depth,
        series=contact_series(indenter, layer, moments, 4, "explicit"),
        series_end=np.inf,
    )


def _least_explicit(contrast: float, varpi: float) -> float:
    """Guess the explicit form's error, on the low side."""
    return _LEAST_EXPLICIT * min(contrast, 1.0) * max(1.0, contrast / _SOFTER) ** 3 * varpi**5


def _nearly_halfspace(
    indenter: Indenter, layer: Layer, max_depth: float, effect: float, why: str, rtol: float
) -> HalfspaceLaw:
    return replace(
        halfspace_law(indenter, layer),
        max_depth=max_depth,
        error_estimate=effect,
        reason=f"{why}: the layer changes the contact by at most {effect:.1g}, below rtol = {rtol:g}",
    )


def _exponents(indenter: Indenter, radius: float) -> tuple[float, ...]:
    """Exponents of the power laws that fit the shape up to `radius` (m): dlnH/dlnr on the way there."""
    if isinstance(indenter, FlatPunch):
        return (np.inf,)
    if isinstance(indenter, PowerLawShape):
        return (indenter.exponent,)
    r = radius * np.array([0.3, 0.7, 1.0])
    local = r * indenter.abel_slope(r) / indenter.abel(r)
    return tuple(float(value) for value in local)
