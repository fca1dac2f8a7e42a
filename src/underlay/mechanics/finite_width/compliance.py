"""Compliance of a sample's free sides: to leading order a spring in series with the law of a sample without.

    P(w) = F(w - kappa P/(E W)),

P the force at depth w, F the law of the layer on its rigid base, h its thickness, W the half-width of a round
plug with free sides (of a square block 2/sqrt(pi) of its half-width), E Young's modulus at small strains,
kappa(h/W; nu, base) a number that does not depend on the size of the contact: under the tip a force acts, and
the sides see no more of it (Saint-Venant).

    kappa = (h/W)/pi + S(h/W):

a long bar is compressed by h P/(pi E W^2); S is a spline in q = (h/W)/(h/W + 2) through finite elements
(linear, axisymmetric), with the two terms of its far end.
Between the points it is within 0.0004 of the cubic spline in h/W and of the far end's formula that the study
measured, over the whole range: nothing is switched. Errors against finite elements: 0.002 or 4 % for a/W up to
0.2, 3.5 % at h/W = 2 up to 0.5; fourteen more of our own (nu 0.3 to 0.4995, h/W 0.35 to 5, a/W 0.1) are met
within 0.0019, 0.04 % of the force. Of public three-dimensional blocks (211 curves, W from 5 R) the force is
within 0.4 % rms where it is 15 % lower.
"""

from __future__ import annotations

from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import interpolate

from underlay._arrays import FloatArray, PerSet, positive
from underlay.errors import InputError
from underlay.mechanics.body import SHAPES

# A square as a round of the same area; by its half-width alone forces are 6.5 % off at w/R = 0.5, W 5 to 6.5
# R.
_OF_BLOCK = 2.0 / float(np.sqrt(np.pi))

# kappa at h/W by finite elements, nu = 1/2 (0.4995), and S and dS/d(W/h) at the far end.
_RATIOS = (0.125, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 8.0)
_SLIDING = (0.0105, 0.0205, 0.0439, 0.0739, 0.0958, 0.1671, 0.2795, 0.5518, 0.8467, 2.085)
_BONDED = (0.0004, 0.0028, 0.0251, 0.0534, 0.0946, 0.1848, 0.2892, 0.5396, 0.8218, 2.041)
_FAR_SLIDING, _FAR_BONDED = (-0.497, 0.281), (-0.559, 0.430)
# The same at nu = 0.45 and 0.3.
_FEWER_RATIOS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
_SLIDING_BELOW = (
    (0.0164, 0.0364, 0.0834, 0.2569, 0.821, 2.055),
    (0.0074, 0.0192, 0.0538, 0.2077, 0.760, 1.992),
)
_BONDED_BELOW = (
    (0.0016, 0.0159, 0.0770, 0.2695, 0.808, 2.028),
    (0.0003, 0.0023, 0.0389, 0.2186, 0.758, 1.983),
)
_BELOW = (0.45, 0.3)
_LEAST_NU = 0.3
# Scale of q: of 0.5, 1 and 2 the last is nearest to the study's own spline (0.0012, 0.0007 and 0.0004).
_BEND = 2.0
# Of kappa: as a share, and where it is small.
_RELATIVE_ERROR, _LEAST_ERROR = 0.04, 0.002
# Largest a/W at which kappa was measured, at h/W = 2; 0.2 at other ratios.
_WIDEST = 0.5


def equivalent_radius(half_width: float, shape: str = "plug") -> float:
    """Radius (m) of the round plug equivalent to a sample of this half-width (m), round or square.

    Raises
    ------
    InputError
        If the half-width is not positive, or the shape not one of `SHAPES`.
    """
    if shape not in SHAPES:
        raise InputError(f"a sample of finite width is one of {', '.join(SHAPES)}; got {shape!r:.60}")
    # Of a round plug it is its radius, of a square block half its side.
    return positive(half_width, "the layer's half_width", "m") * (_OF_BLOCK if shape == "block" else 1.0)


def kappa(ratio: FloatArray, nu: PerSet, *, sliding: bool = False) -> FloatArray:
    """Dimensionless compliance of free sides, compliance times E W (module's head), broadcast shape.

    Parameters
    ----------
    ratio : FloatArray
        h/W, thickness over radius of the equivalent round plug, positive and finite.
    nu : float or FloatArray
        Poisson's ratio, 0.3 to 0.5.
    sliding : bool, default False
        Whether the layer slides on its rigid base; else it is bonded.

    Raises
    ------
    InputError
        If a ratio is not positive and finite, or nu below 0.3.
    """
    t = np.asarray(ratio, dtype=np.float64)
    if not (np.isfinite(t) & (t > 0.0)).all():
        raise InputError(
            f"a sample of finite width has a finite thickness on a rigid base; got h/W = {t.ravel()[0]!r}"
        )
    if not (np.asarray(nu) >= _LEAST_NU).all():
        raise InputError(f"finite width is known for nu from {_LEAST_NU:g}; got {float(np.min(nu)):g}")
    q = t / (t + _BEND)
    bent, nodes = _bent(nu), [_bent(0.5), *(_bent(row) for row in _BELOW)]
    splines = _splines(sliding)
    found = t / np.pi + splines[0](q)
    for here, other, spline in ((1, 2, splines[1]), (2, 1, splines[2])):
        share = bent * (bent - nodes[other]) / (nodes[here] * (nodes[here] - nodes[other]))
        found = found - share * spline(q)
    return np.asarray(found)


def _bent(nu: PerSet) -> PerSet:
    """k/(k + 1/2) with k = 1 - 2 nu: the variable of the parabola through the data at nu 0.5, 0.45 and 0.3."""
    return (1.0 - 2.0 * nu) / (1.5 - 2.0 * nu)


@cache
def _splines(sliding: bool) -> tuple[interpolate.CubicSpline, ...]:
    """Splines in q (module's head) of S at nu = 1/2, and of its decrease at nu = 0.45 and at 0.3."""
    values, (end, falling) = (_SLIDING, _FAR_SLIDING) if sliding else (_BONDED, _FAR_BONDED)
    ratio = np.array(_RATIOS)
    # At the far end 1/t is (1 - q)/(q bend): dS/dq = -falling/bend. Where a bonded layer is flat its sides
    # are not seen: kappa begins with slope zero.
    start = None if sliding else -_BEND / np.pi
    own = _spline(ratio / (ratio + _BEND), np.array(values) - ratio / np.pi, end, start, -falling / _BEND)
    fewer = np.array(_FEWER_RATIOS)
    q = fewer / (fewer + _BEND)
    below = []
    for row in _SLIDING_BELOW if sliding else _BONDED_BELOW:
        less = fewer / np.pi + own(q) - np.array(row)
        # Straight in W/h from h/W = 4 and 8 to the far end.
        below.append(_spline(q, less, 2.0 * less[-1] - less[-2], None if sliding else 0.0, None))
    return own, *below


def _spline(
    q: FloatArray, values: FloatArray, end: float, start_slope: float | None, end_slope: float | None
) -> interpolate.CubicSpline:
    """Cubic spline from (0, 0) through the values to `end` at q = 1, not-a-knot where no slope is given."""
    free: Literal["not-a-knot"] = "not-a-knot"
    slope: Literal[1] = 1
    return interpolate.CubicSpline(
        np.concatenate(([0.0], q, [1.0])),
        np.concatenate(([0.0], values, [end])),
        bc_type=(
            free if start_slope is None else (slope, np.array(start_slope)),
            free if end_slope is None else (slope, np.array(end_slope)),
        ),
    )


def standard_error(value: FloatArray) -> FloatArray:
    """Standard error of kappa: 4 % of `value`, at least 0.002; same shape."""
    return np.asarray(np.maximum(_RELATIVE_ERROR * value, _LEAST_ERROR))


def is_wide(contact_radius: FloatArray, radius: PerSet) -> NDArray[np.bool_]:
    """Whether contact radii (m) are at most half of the plug's `radius` W (m), broadcast shape."""
    return np.asarray(contact_radius <= _WIDEST * radius)


def require_wide(contact_radius: float, radius: float) -> None:
    """Raise for a contact radius (m) larger than half of the plug's `radius` W (m).

    Raises
    ------
    InputError
        With both radii.
    """
    if not is_wide(np.array(contact_radius), radius):
        raise InputError(
            f"finite width is known for contacts up to {_WIDEST:g} of the half-width; a = {contact_radius:.4g} m "
            f"is {contact_radius / radius:.2g} of it (half_width, as a round plug: {radius:.4g} m)"
        )
