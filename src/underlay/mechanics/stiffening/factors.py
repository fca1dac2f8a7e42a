"""What large strains do to the force of a sphere on a soft layer: factors on the exact law of linear elasticity.

    P(w) = P_linear(w) N G F,     W = -(mu Jm/2) ln(1 - (I1bar - 3)/Jm) + K/2 (J - 1)^2,     s = 1/Jm,

W the strain energy of Gent's solid of shear modulus mu, bulk modulus K and limit Jm of its first invariant;
P_linear and its contact radius a those of a true sphere of radius R on a layer of thickness h, w the depth, and

    y = w/R,  z = w/h,  t = a/h,  alpha = a/R,  x = y s.

N (neo-Hookean, s = 0) is a fit to finite elements. G (stiffening) is exact to first order in s: at fixed depth
the strain energy changes by the integral of mu I^2 s/4 over the linear solution, I = 2 e':e' with e' the strain
deviator (envelope theorem), which is closed on a half-space and integrated by finite elements on a layer;
beyond that it is a fit with two limits, G ~ sqrt(x) on a half-space and locking of a bonded layer where biaxial
stretch passes its limit, at

    X = ((1 - z)^2 + 2/(1 - z) - 3) s / (1 + 1.78 sqrt(1 - 2 nu)) = 1.

F (form of the energy) is exp(c L + b(c) L^2), L = alpha o1(t)/o1(0): c L is the first-order difference between
energies that agree at small strains, the integral o1 of tr e'^3 (`ogden_size`), with a size c that nobody knows;
b(c) is the next order of Ogden's energies. Of finite elements of exponents from -20 to 20, on half-spaces and on
layers of 2 and 5 R to a tenth of the thickness, it leaves -0.8 to 12 % (the first order alone up to 63 %): what is
left stiffens, as G does.

Range and errors against finite elements (w/R 0.05 to 0.6, h/R from 0.5, X <= 0.6, G <= 3): N G within 2.2 %
at nu = 1/2 (rms 0.57 %, 164 points), 3.6 % (0.85 %) at nu 0.3 and 0.45; `limits` refuses the rest. The
numbers are from the design study of stiffening layers, its sections 1 and 2.

Gradual contact (`gradual_depth`): a tip that meets the surface at heights which spread, in place of one.

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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple

import numpy as np
from scipy import interpolate, special

from underlay._arrays import FloatArray, PerSet
from underlay._door import parse_toml
from underlay.errors import RangeError

# Poisson's ratios of the rows of ``finite_elements.toml``.
_ROWS = (0.5, 0.45, 0.3)
# Beyond first order: of x, y and z in the numerator, of x under the root, power of 1 - X (bonded, sliding).
_BY_X, _BY_Y, _BY_Z, _ROOT = 0.226, 0.8936, 0.5298, 0.1207
_LOCKING_POWER, _LOCKING_POWER_SLIDING = 0.774, 0.47
# Share of an incompressible layer's locking that is left, 1/(1 + 1.78 sqrt(1 - 2 nu)): from h = 2 R at nu 0.45
# and 0.3 alone.
_LOOSER = 1.78
# b = (1 - 2 nu)/(1 - nu) of nu = 0.3, from which on the fit to compressible layers stands alone.
_COMPRESSIBILITY = 4.0 / 7.0
# p, q and r of b(c) = p c^2/(1 + q c + r c^2): below the finite elements of 35 points of half-spaces (section 2)
# and 64 of layers (tests/studies/results/ogden_layers.csv), L up to 0.83: 1/Jm gives more and never less.
_SECOND_FORM = (2.5, 1.125, 2.0)
#: Standard deviation of the size c of the form of the energy: Ogden's alpha from -16 to 20 at two of them.
FORM_SPREAD = 0.3
# Relative standard errors of G - 1, and of N at nu = 1/2 and at 0.3 (the two fits' rms).
_ERROR_OF_STIFFENING, _ERROR_OF_NEO_HOOKEAN = 0.03, (0.004, 0.007)


@cache
def finite_elements() -> Mapping[str, Any]:
    """Results of finite elements and fits to them, from ``finite_elements.toml``, which says what they are."""
    text = files("underlay.mechanics").joinpath("finite_elements.toml").read_text(encoding="utf-8")
    return parse_toml(text)


@dataclass(frozen=True)
class Medium:
    """Poisson's ratio and base of a layer on a rigid base (or half-space), on which the factors depend.

    Parameters
    ----------
    nu : float or FloatArray
        Poisson's ratio, 0.3 to 0.5; one for all parameter sets, or (sets, 1).
    sliding : bool
        Whether the layer slides on its base without friction instead of being bonded; known at nu = 1/2 only.
    """

    nu: PerSet
    sliding: bool = False

    @property
    def compressibility(self) -> PerSet:
        """Measure of compressibility b = (1 - 2 nu)/(1 - nu), nu Poisson's ratio: 0 at nu = 1/2."""
        return (1.0 - 2.0 * self.nu) / (1.0 - self.nu)

    @property
    def freedom(self) -> PerSet:
        """Factor 1/(1 + 1.78 sqrt(1 - 2 nu)) on the locking measure X (`crowding`) of an incompressible layer."""
        return 1.0 / (1.0 + _LOOSER * np.sqrt(1.0 - 2.0 * self.nu))

    @property
    def bond(self) -> str:
        """``"sliding"`` or ``"bonded"``."""
        return "sliding" if self.sliding else "bonded"

    def growth(self, integral: Mapping[str, Any], t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Growth over the half-space of a first-order integral with t = a/h, contact radius over thickness.

        `integral` has the coefficients c_i of 1 + sum c_i t^i by the layer's bond, one row for each tabulated nu.
        Returns the series and t times its derivative, each in the shape of `t`.
        """
        shares = [1.0] if self.sliding else poisson_shares(self.nu)
        series: PerSet = 0.0
        slope: PerSet = 0.0
        for column in reversed(list(zip(*integral[self.bond], strict=True))):
            coefficient = sum(share * row for share, row in zip(shares, column, strict=True))
            series, slope = (series + coefficient) * t, slope * t + series
        # Horner's scheme: S_i = (S_(i+1) + c_i) t and t S_i' = S_i + t (t S_(i+1)').
        return np.asarray(1.0 + series), np.asarray(series + slope * t)


def poisson_shares(nu: PerSet) -> list[PerSet]:
    """Interpolation weights of the three tabulated Poisson's ratios: a parabola in k/(k + 1/2), k = 1 - 2 nu.

    Against linear finite elements at nu 0.35, 0.4, 0.475 and 0.49 the growth is within 0.6 % for t = a/h <= 1.1
    (of those at the rows themselves within 0.4 %); in k, in b or in sqrt(k) a parabola is off by 6, 2.6 and 5
    %.
    """
    at = _bent(nu)
    nodes = [float(_bent(row)) for row in _ROWS]
    shares = []
    for node in nodes:
        first, second = (other for other in nodes if other != node)
        shares.append((at - first) * (at - second) / ((node - first) * (node - second)))
    return shares


def _bent(nu: PerSet) -> PerSet:
    return (1.0 - 2.0 * nu) / (1.5 - 2.0 * nu)


class Place(NamedTuple):
    """Dimensionless depth w and contact radius a of a sphere of radius R on a layer of thickness h, (..., n) each.

    Parameters
    ----------
    y, z : FloatArray
        Depth over radius and thickness, w/R and w/h.
    t, alpha : FloatArray
        Contact radius of the linear law over thickness and radius, a/h and a/R.
    """

    y: FloatArray
    z: FloatArray
    t: FloatArray
    alpha: FloatArray


class LogFactor(NamedTuple):
    """Logarithm of a factor on the force, and its derivatives in ln y, ln z, ln t and ln alpha, each (..., n).

    y, z, t and alpha are the dimensionless depths and contact radii of `Place`.
    """

    log: FloatArray
    in_y: PerSet = 0.0
    in_z: PerSet = 0.0
    in_t: PerSet = 0.0
    in_alpha: PerSet = 0.0

    @property
    def value(self) -> FloatArray:
        """The factor itself, (..., n)."""
        return np.asarray(np.exp(self.log))

    def times(self, other: LogFactor) -> LogFactor:
        """Return the product of this and another factor on the force."""
        slopes = (mine + its for mine, its in zip(self[1:], other[1:], strict=True))
        return LogFactor(self.log + other.log, *slopes)

    def along_depth(self, rate: FloatArray) -> FloatArray:
        """Derivative of the log factor in ln w, w depth; `rate` is d ln a/d ln w of the linear contact radius a."""
        return np.asarray(self.in_y + self.in_z + rate * (self.in_t + self.in_alpha))


def neo_hookean(place: Place, medium: Medium) -> LogFactor:
    """Factor N: force of a sphere on a neo-Hookean layer over that of linear elasticity at the same depth.

    Between nu = 1/2 and 0.3 the two fits are mixed linearly in b = (1 - 2 nu)/(1 - nu): of the finite elements
    at nu 0.3 and 0.49, z <= 0.3, from the study of what linear elasticity leaves out (`discrepancy`), it is
    within 2.0 % (rms 0.57 %, 32 points).
    """
    share = 1.0 - medium.compressibility / _COMPRESSIBILITY
    fits = finite_elements()["neo_hookean"]
    first, second, squashed = (
        share * one + (1.0 - share) * other
        for one, other in zip(fits[medium.bond], fits["compressible"], strict=True)
    )
    by_alpha, by_z = (medium.compressibility * number for number in fits["by_compressibility"])
    linear = (first + by_alpha) * place.alpha
    bent, deep = second * place.alpha**2, squashed * place.z**2
    return LogFactor(
        linear + bent + deep + by_z * place.z,
        in_z=2.0 * deep + by_z * place.z,
        in_alpha=linear + 2.0 * bent,
    )


def crowding(z: FloatArray, inverse_limit: PerSet, medium: Medium) -> FloatArray:
    """Locking measure X (module): 0 at small strain, 1 where biaxial stretch under the tip reaches its limit.

    `z` = w/h is depth over thickness, `inverse_limit` s = 1/Jm of Gent's energy.
    """
    left = 1.0 - z
    return np.asarray((left**2 + 2.0 / left - 3.0) * inverse_limit * medium.freedom)


def gent(place: Place, medium: Medium, inverse_limit: PerSet) -> tuple[LogFactor, FloatArray]:
    """Factor G: force on a Gent layer over that on a neo-Hookean one; and d ln G/ds. Each in the shape of `place`.

    Parameters
    ----------
    place : Place
        Depth and contact radius without dimensions; t up to 1.3.
    medium : Medium
        Poisson's ratio and base of the layer.
    inverse_limit : float or FloatArray
        s = 1/Jm, Jm the limit of the first invariant, zero or more; one for all parameter sets, or (sets, 1).

    Raises
    ------
    RangeError
        If the layer is locked anywhere (X >= 1).
    """
    s, y, z = inverse_limit, place.y, place.z
    x, locked = y * s, crowding(z, s, medium)
    if (locked >= 1.0).any():
        raise RangeError(
            f"a layer of 1/Jm = {float(np.max(s)):.4g} locks before z = w/h = {float(z.max()):.4g}: "
            f"X = {float(locked.max()):.4g}, and less than 1 is needed"
        )
    power = _LOCKING_POWER_SLIDING if medium.sliding else _LOCKING_POWER
    integral = finite_elements()["gent"]
    series, rising = medium.growth(integral, place.t)
    bracket = 1.0 + _BY_X * x + _BY_Y * y + _BY_Z * z
    rounded = 1.0 + _ROOT * x
    first = _half_space(integral["half_space"], medium.nu) * series * y
    per_s = first * bracket / rounded**1.5 / (1.0 - locked) ** power
    value = 1.0 + s * per_s
    spread = 2.0 / (1.0 - z) ** 2 - 2.0 * (1.0 - z)  # d/dz of what X is made of
    share = s * per_s / value
    by_x = _BY_X * x / bracket - 1.5 * _ROOT * x / rounded
    factor = LogFactor(
        np.log1p(s * per_s),
        in_y=share * (1.0 + by_x + _BY_Y * y / bracket),
        in_z=share * (_BY_Z * z / bracket + power * medium.freedom * s * z * spread / (1.0 - locked)),
        in_t=share * rising / series,
    )
    return factor, np.asarray(per_s / value * (1.0 + by_x + power * locked / (1.0 - locked)))


def form(place: Place, medium: Medium, size: PerSet) -> tuple[LogFactor, FloatArray]:
    """Factor F of another form of the strain energy than Gent's, and d ln F/dc; each in the shape of `place`.

    Parameters
    ----------
    place, medium
        As of `gent`.
    size : float or FloatArray
        Size c of the difference of form, of either sign; zero is Gent's. One for all parameter sets, or (sets, 1).
    """
    series, rising = medium.growth(finite_elements()["form"], place.t)
    L = place.alpha * series
    p, q, r = _SECOND_FORM
    rounded = 1.0 + (q + r * size) * size
    second = p * size**2 / rounded
    slope = size + 2.0 * second * L
    factor = LogFactor((size + second * L) * L, in_t=slope * place.alpha * rising, in_alpha=slope * L)
    return factor, np.asarray(L + p * (2.0 + q * size) * size / rounded**2 * L**2)


def ogden_size(exponent: float, nu: float) -> float:
    """Size c of `form` that gives Ogden's energy of this exponent (2 is neo-Hookean), to first order."""
    return float(_half_space(finite_elements()["form"]["half_space"], nu)) * (exponent - 2.0)


def known_errors(stiffening: LogFactor, medium: Medium) -> tuple[FloatArray, PerSet]:
    """Relative standard errors of the force due to G (3 % of G - 1) and due to N, of finite strain.

    `stiffening` is the factor G at the depths; the first error has its shape, the second that of Poisson's ratio.
    """
    incompressible, compressible = _ERROR_OF_NEO_HOOKEAN
    share = medium.compressibility / _COMPRESSIBILITY
    own = _ERROR_OF_STIFFENING * -np.expm1(-stiffening.log)
    return np.asarray(own), incompressible + share * (compressible - incompressible)


def _half_space(polynomial: Sequence[float], nu: PerSet) -> PerSet:
    """First-order integral of a half-space: the polynomial in k = 1 - 2 nu over (1 + k)^(its degree - 1)."""
    k = 1.0 - 2.0 * nu
    total: PerSet = 0.0
    for coefficient in reversed(polynomial):
        total = total * k + coefficient
    return total / (1.0 + k) ** (len(polynomial) - 2)


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
