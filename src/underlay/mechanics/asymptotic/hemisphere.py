"""The hemispherically-ended indenter: section 6 of the paper, in alpha = a/R and mu = R/h.

Pure functions of arrays. The three integrals of section 6 enter through `Sphere`, whose forms keep their
digits for small alpha; with Lambda(alpha) = (1 + alpha^2) ln((1 + alpha)/(1 - alpha)) - 2 alpha,

    Lambda = 4 (alpha H - int_0^alpha H) / R^2      on a half-space P = theta R^2 Lambda (6.9).

A law for a `Sphere` comes from `asymptotic_law`: its parametric form is (6.3), (6.4), its compliance form
England's expansion (6.10), (6.11). Source of the latter: England (1962), as cited by the paper.
"""

from __future__ import annotations

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics._roots import invert_increasing
from underlay.mechanics.asymptotic.blunt import kernel_terms
from underlay.mechanics.indenters import Sphere
from underlay.mechanics.plane_constants import Real

__all__ = [
    "england_depth",
    "england_radius",
    "halfspace_alpha",
    "halfspace_load",
    "parametric_depth",
    "parametric_load",
]

_UNIT = Sphere(1.0)


def halfspace_load(alpha: FloatArray) -> FloatArray:
    """P/(theta R^2) on a half-space at alpha = a/R: Lambda of (6.9)."""
    return np.asarray(4.0 * (alpha * _UNIT.abel(alpha) - _UNIT.abel_moments(alpha)[0]))


def halfspace_alpha(load: FloatArray) -> FloatArray:
    """alpha_0: the root of (6.9) for P/(theta R^2) = `load`, positive, shape (n,)."""
    # Lambda = (8/3) alpha^3 for small alpha and less than that cubed root's value for any.
    start = np.minimum(np.cbrt(0.375 * load), 0.9)
    return invert_increasing(_load_and_slope, load, start, _UNIT.max_radius)


def parametric_load(alpha: FloatArray, mu: Real, a_1: Real) -> FloatArray:
    """P/(theta R^2) of (6.3)."""
    c = kernel_terms(0.0, a_1)[1]
    return halfspace_load(alpha) * (1.0 - c * (mu * alpha) ** 3)


def parametric_depth(alpha: FloatArray, mu: Real, a_0: Real, a_1: Real) -> FloatArray:
    """w/R of (6.4)."""
    b, c = kernel_terms(a_0, a_1)
    H, load = _UNIT.abel(alpha), halfspace_load(alpha)
    third = 0.5 * alpha**3 * H - 1.5 * _UNIT.abel_moments(alpha)[1] + 0.375 * alpha**2 * load
    return np.asarray(H - mu * b / 4.0 * load - mu**3 * c * third + mu**4 * b * c / 4.0 * alpha**3 * load)


def england_radius(alpha_0: FloatArray, mu: Real, a_1: Real) -> FloatArray:
    """a/R of (6.10) with alpha_3 of (6.8); alpha_1 = alpha_2 = alpha_4 = 0 (6.7)."""
    c = kernel_terms(0.0, a_1)[1]
    slope = _UNIT.abel_slope(alpha_0)
    return np.asarray(alpha_0 + mu**3 * c / 4.0 * alpha_0**2 * halfspace_load(alpha_0) / slope)


def england_depth(alpha_0: FloatArray, mu: Real, a_0: Real, a_1: Real) -> FloatArray:
    """w/R of (6.11)."""
    b, c = kernel_terms(a_0, a_1)
    first, second = _UNIT.abel_moments(alpha_0)
    H = _UNIT.abel(alpha_0)
    third = alpha_0**3 * H - 0.5 * alpha_0**2 * first - 1.5 * second
    return np.asarray(H - mu * b / 4.0 * halfspace_load(alpha_0) - mu**3 * c * third)


def _load_and_slope(alpha: FloatArray) -> tuple[FloatArray, FloatArray]:
    return halfspace_load(alpha), np.asarray(4.0 * alpha * _UNIT.abel_slope(alpha))
