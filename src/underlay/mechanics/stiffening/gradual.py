"""Gradual contact: a tip that meets the surface at heights which spread, in place of one.

With heights normal about zero, of standard deviation d, the mean force at depth w of a law that goes as w^m
is that of the law at

    u(w) = d M_m(w/d)^(1/m),      M_m(x) = E[max(x - Z, 0)^m],  Z standard normal,
    M_m(x) = Gamma(m + 1)/sqrt(2 pi) exp(-x^2/4) D_(-m-1)(-x),     dM_m/dx = m M_(m-1),

D the parabolic cylinder function (DLMF 12.5.1), so u - w falls as (m - 1) d^2/(2 w). Here m = 3/2, a sphere
that begins to touch: one question to the law in place of many. Against the mean of the forces of a layer that
stiffens, d = 0.01 and 0.05 R, at depths up to 0.3 R (tests/test_stiffening_law.py): within 1e-4 and 0.23 % of
the largest force on a half-space, 4e-4 and 0.8 % at h = 2 R, where the force rises more than w^(3/2).
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy import interpolate, special

from underlay._arrays import FloatArray, PerSet

_POWER = 1.5
#: Depth, in standard deviations of the heights, from which on there is contact: 1e-17 of the force at +1.
FIRST_TOUCH = -8.0
# From here on M_m is its series in 1/x^2: the parabolic cylinder functions overflow at 50, and the two agree to
# 1e-12 at the switch (tests/test_stiffening_law.py).
_FAR, _TERMS = 12.0, 7
# Up to there ln(u/d) is a cubic through values and slopes at so many places a standard deviation, 1e-11 of u: the
# functions themselves take 15 us a depth.
_PLACES = 128


class GradualDepth(NamedTuple):
    """Equivalent depth u (m) of a gradual contact (module), its derivative in the depth w, and that (m) in ln d.

    d is the standard deviation of the heights; each is (..., n).
    """

    depth: FloatArray
    slope: FloatArray
    in_spread: FloatArray


def gradual_depth(depth: FloatArray, spread: PerSet) -> GradualDepth:
    """Equivalent depth u(w) (module): the law's force there is the mean force of a gradual contact at depth w.

    `depth` is w (m), (..., n); `spread` the standard deviation (m, positive) of the heights of contact.
    Depths are counted from the mean height, and are above `FIRST_TOUCH` times `spread`.
    """
    x = depth / spread
    far = x > _FAR
    asked, slope = np.empty_like(x), np.empty_like(x)
    asked[far], slope[far] = _power_mean(series_moment(x[far], _POWER), series_moment(x[far], _POWER - 1.0))
    near, curve = x[~far], _near()
    asked[~far] = np.exp(curve(near))
    slope[~far] = asked[~far] * curve(near, 1)
    return GradualDepth(spread * asked, slope, spread * (asked - x * slope))


@cache
def _near() -> interpolate.CubicHermiteSpline:
    """Interpolant of ln(u/d) over w/d: u equivalent depth, w depth, d standard deviation of the heights."""
    x = np.linspace(FIRST_TOUCH, _FAR, round((_FAR - FIRST_TOUCH) * _PLACES) + 1)
    asked, slope = _power_mean(moment(x, _POWER), moment(x, _POWER - 1.0))
    return interpolate.CubicHermiteSpline(x, np.log(asked), slope / asked)


def _power_mean(mean: FloatArray, below: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Equivalent depth over standard deviation, u/d, and its derivative in w/d, from moments M_m and M_(m-1)."""
    asked = mean ** (1.0 / _POWER)
    return asked, np.asarray(asked * below / mean)


def moment(x: FloatArray, power: float) -> FloatArray:
    """Partial moment E[max(x - Z, 0)^power], (n,), of a standard normal Z, for |x| up to 50."""
    scale = special.gamma(power + 1.0) / np.sqrt(2.0 * np.pi)
    return np.asarray(scale * np.exp(-0.25 * x**2) * special.pbdv(-power - 1.0, -x)[0], dtype=np.float64)


def series_moment(x: FloatArray, power: float) -> FloatArray:
    """Partial moment E[max(x - Z, 0)^m] for x >= 12, m = `power`: x^m sum_j binomial(m, 2 j) (2 j - 1)!!/x^(2 j).

    Z is standard normal.
    """
    square, total = 1.0 / (x * x), np.ones_like(x)
    for j in range(_TERMS - 2, -1, -1):
        # The next term over this one.
        total = 1.0 + (power - 2 * j) * (power - 2 * j - 1) / (2 * j + 2) * square * total
    return np.asarray(x**power * total)
