"""Three solutions of a biphasic half-space that decay with depth, whether or not their decay roots coincide.

Under a wave J0(xi r) on the surface the fields are u_r = U J1, u_z = W J0, p = Pi J0, shear stress S J1, normal
total stress T J0; z down from the surface. With moduli in A44 and k_z = 1, and z in units of 1/xi, a solution
(`decaying`) is six rows: U, W, S/xi, T/xi, Pi/xi, Pi'/xi^2. Nothing but the skeleton and sh = s/(k_z A44 xi^2)
enters.

Solutions fall with depth as exp(-m xi z), where mu = m^2 are the roots of

    (mu - r) D(mu) = sh N(mu),   D = A33 mu^2 - (A11 A33 - A13^2 - 2 A13) mu + A11,
                                 N = mu^2 - (A11 + A33 - 2 A13 - 2) mu + 1,

moduli in A44, r = k_r/k_z. D is the drained elastic characteristic, N the undrained one. Roots coincide (isotropy:
1, 1, 1 + s/(c xi^2)), so single roots may be badly conditioned; what the kernel needs are functions of the set, and
the set is found backward stably (`decay_roots`).

Those functions are divided differences, in m, of polynomials times exp(-m z): bases that have no case of equal
roots. With y[m1, m2] = (y(m2) - y(m1))/(m2 - m1) and so on, any set of three decaying solutions y(m_i) exp(-m_i
z) spans the same space as (y f)[m1], (y f)[m1, m2], (y f)[m1, m2, m3], f = exp(-m z), and these stay
independent where roots coincide. Leibniz' rule needs the differences of both factors:

    (y f)[1,2] = y1 f12 + y12 f2,    (y f)[1,2,3] = y1 f123 + y12 f23 + y123 f3.

Only decaying exponentials: m is sorted by its real part.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.mechanics.biphasic.material import ComplexArray, Skeleton

# Below this the Taylor series of a second difference, to _TERMS terms, is exact to 1/20! of itself; above it,
# dividing by the largest difference loses one digit at most.
_TAYLOR = 1.0
_TERMS = 20
# Below this x the series of (1 - e^-x)/x to x^2 is exact to x^3/24 < 1e-16.
_SMALL = 1e-5
_NEWTON_STEPS = 3
# A Newton step longer than this share of the root is not taken: the start is that near a multiple root, where the
# slope is rounding, or the step is noise.
_LONGEST_STEP = 0.1
_UNITY = np.exp(2j * np.pi / 3.0 * np.arange(3))
# Below this |sh| the first solution is taken from the fluid family; both were measured to keep 1e-13 at the switch.
_FLUID_BELOW = 0.3
_DEGREE = 5


class Exponentials(NamedTuple):
    """f(m) = exp(-m z) at three decay roots m1, m2, m3, and its divided differences over them, each (n,)."""

    f1: ComplexArray
    f2: ComplexArray
    f3: ComplexArray
    f12: ComplexArray
    f23: ComplexArray
    f123: ComplexArray


def relative_drop(x: ComplexArray) -> ComplexArray:
    """phi(x) = (1 - exp(-x))/x for Re x >= 0, in the shape of `x`, without cancellation; 1 at zero."""
    small = np.abs(x) < _SMALL
    safe = np.where(small, 1.0, x)
    return np.where(small, 1.0 - x * (0.5 - x / 6.0), -np.expm1(-safe) / safe)


def exponentials(m: ComplexArray, z: ComplexArray) -> Exponentials:
    """Divided differences of exp(-m z) over three decay roots, without cancellation where roots coincide.

    `m` (3, n) are the roots, sorted by real part; `z` (n,) wavenumber times depth, zero or more.
    """
    d12, d13, d23 = m[1] - m[0], m[2] - m[0], m[2] - m[1]
    f1, f2, f3 = np.exp(-m * z)
    f12 = -z * f1 * relative_drop(d12 * z)
    f13 = -z * f1 * relative_drop(d13 * z)
    f23 = -z * f2 * relative_drop(d23 * z)
    near = np.maximum(np.abs(d12), np.abs(d13)) * z.real < _TAYLOR
    series = z * z * f1 * _second_series(np.where(near, d12 * z, 0.0), np.where(near, d13 * z, 0.0))
    return Exponentials(
        f1, f2, f3, f12, f23, np.where(near, series, _by_largest(d12, d13, d23, f12, f13, f23))
    )


def _second_series(x: ComplexArray, y: ComplexArray) -> ComplexArray:
    """Second divided difference of exp(-t) over t = 0, x, y, (n,), by its series sum_k (-1)^k h_k(x, y)/(k + 2)!.

    h_k is the complete homogeneous sum of degree k.
    """
    power = np.ones_like(x)
    complete = np.ones_like(x)
    total = 0.5 * complete
    factor = 0.5
    for k in range(1, _TERMS):
        power = power * x
        complete = power + y * complete
        factor /= -(k + 2.0)
        total = total + factor * complete
    return total


def _by_largest(
    d12: ComplexArray,
    d13: ComplexArray,
    d23: ComplexArray,
    f12: ComplexArray,
    f13: ComplexArray,
    f23: ComplexArray,
) -> ComplexArray:
    """Second divided difference f[m1, m2, m3], (n,), from two first ones over the largest gap of the roots.

    dij = mj - mi and fij = f[mi, mj], (n,) each. Zero where all roots coincide: there the series is used.
    """
    gaps = np.stack([d13, d23, d12])
    drops = np.stack([f23 - f12, f13 - f12, f23 - f13])
    index = np.argmax(np.abs(gaps), axis=0)[None]
    gap, drop = (np.take_along_axis(values, index, axis=0)[0] for values in (gaps, drops))
    equal = gap == 0.0
    # Equal roots go by the series.
    return np.where(equal, 0.0, drop / np.where(equal, 1.0, gap))


def homogeneous_sums(m: ComplexArray, degree: int) -> ComplexArray:
    """Divided differences of the powers 1, m, ..., m^degree over m1, over m1, m2 and over all three roots.

    `m` is (3, n), the result (3, degree + 1, n).

    The j-th difference of m^k is the complete homogeneous sum h_(k-j) of its j + 1 roots: no division.
    """
    sums = np.zeros((3, degree + 1, m.shape[1]), dtype=np.complex128)
    sums[0, 0] = 1.0
    for k in range(1, degree + 1):
        sums[0, k] = m[0] * sums[0, k - 1]
    for j in (1, 2):
        sums[j, j] = 1.0
        for k in range(j + 1, degree + 1):
            sums[j, k] = sums[j - 1, k - 1] + m[j] * sums[j, k - 1]
    return sums


def decay_roots(skeleton: Skeleton, sh: ComplexArray) -> ComplexArray:
    """Three decay roots m, (3, n), Re m > 0 and increasing, of solutions exp(-m xi z) of a biphasic half-space.

    sh = s/(k_z A44 xi^2), (n,), is the dimensionless Laplace variable at wavenumber xi.
    """
    squares = _cubic_set(*_monic(skeleton, sh))
    m = np.sqrt(squares)
    m = np.where(m.real < 0.0, -m, m)
    return np.asarray(np.take_along_axis(m, np.argsort(m.real, axis=0), axis=0))


def _monic(skeleton: Skeleton, sh: ComplexArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Coefficients b2, b1, b0, (n,) each, of the cubic mu^3 + b2 mu^2 + b1 mu + b0 whose roots are mu = m^2."""
    A11, A13, A33, r = (skeleton.A11, skeleton.A13, skeleton.A33, skeleton.permeability_ratio)
    middle_drained = -(A11 * A33 - A13 * A13 - 2.0 * A13)
    middle_undrained = -(A11 + A33 - 2.0 * A13 - 2.0)
    b2 = (middle_drained - r * A33 - sh) / A33
    b1 = (A11 - r * middle_drained - sh * middle_undrained) / A33
    b0 = (-r * A11 - sh) / A33
    return b2, b1, b0


def _cubic_set(b2: ComplexArray, b1: ComplexArray, b0: ComplexArray) -> ComplexArray:
    """Roots (3, n) of mu^3 + b2 mu^2 + b1 mu + b0: the one farthest from their mean, the others by deflation."""
    x = _polished(_farthest(b2, b1, b0), b2, b1, b0)
    # From the low end where x is above the geometric mean of the roots, else from the high end.
    above = np.abs(x) ** 3 > np.abs(b0)
    e0 = np.where(above, -b0 / x, b1 + x * (b2 + x))
    e1 = np.where(above, (-b0 / x - b1) / x, b2 + x)
    half = 0.5 * e1
    spread = np.sqrt(half * half - e0)
    towards = np.where((half.conj() * spread).real >= 0.0, spread, -spread)
    larger = -(half + towards)
    return np.stack([larger, e0 / larger, x])


def _farthest(b2: ComplexArray, b1: ComplexArray, b0: ComplexArray) -> ComplexArray:
    """Root (n,) of mu^3 + b2 mu^2 + b1 mu + b0 farthest from the mean of the roots, by Cardano's formula."""
    mean = b2 / 3.0
    Q = b1 / 3.0 - mean * mean
    R = (b1 * b2 - 3.0 * b0) / 6.0 - mean**3
    spread = np.sqrt(Q**3 + R * R)
    towards = np.where((R.conj() * spread).real >= 0.0, spread, -spread)
    first = (R + towards) ** (1.0 / 3.0)
    triple = first == 0.0
    second = np.where(triple, 0.0, -Q / np.where(triple, 1.0, first))
    roots = first * _UNITY[:, None] + second * _UNITY.conj()[:, None]
    index = np.argmax(np.abs(roots), axis=0)
    return np.asarray(np.take_along_axis(roots, index[None], axis=0)[0] - mean)


def _polished(x: ComplexArray, b2: ComplexArray, b1: ComplexArray, b0: ComplexArray) -> ComplexArray:
    for _ in range(_NEWTON_STEPS):
        value = ((x + b2) * x + b1) * x + b0
        slope = (3.0 * x + 2.0 * b2) * x + b1
        flat = slope == 0.0
        step = value / np.where(flat, 1.0, slope)
        x = np.where(flat | (np.abs(step) > _LONGEST_STEP * np.abs(x)), x, x - step)
    return x


class Decaying(ABC):
    """Three solutions of a half-space that decay with depth, at n pairs of wavenumber and Laplace variable."""

    #: Slowest decay, Re m, (n,).
    slowest: FloatArray

    @abstractmethod
    def at(self, z: FloatArray, where: NDArray[np.bool_]) -> ComplexArray:
        """Fields of the three solutions at depth, (k, 6, 3).

        Parameters
        ----------
        z : FloatArray
            Wavenumber times depth, (k,).
        where : ndarray of bool
            Mask (n,) of the k of the n pairs of wavenumber and Laplace variable that are wanted.

        Returns
        -------
        ComplexArray
            Rows U, W, S/xi, T/xi, Pi/xi, Pi'/xi^2 (module): displacements, stresses, pressure and its slope.
        """


def decaying(skeleton: Skeleton, sh: ComplexArray) -> Decaying:
    """Return the decaying solutions for sh = s/(k_z A44 xi^2), (n,): in closed form for an isotropic skeleton."""
    return IsotropicDecaying(skeleton, sh) if skeleton.isotropic else TransverseDecaying(skeleton, sh)


class IsotropicDecaying(Decaying):
    """Solutions for isotropic skeleton and permeability: decay roots 1, 1, q = sqrt(1 + sh/M), M = A33/A44."""

    def __init__(self, skeleton: Skeleton, sh: ComplexArray) -> None:
        self._M = skeleton.A33
        self._q = np.sqrt(1.0 + sh / self._M)
        self._gap = sh / self._M / (1.0 + self._q)  # q - 1 without cancellation
        self.slowest = np.minimum(self._q.real, 1.0)

    def at(self, z: FloatArray, where: NDArray[np.bool_]) -> ComplexArray:
        """Fields of the three solutions; arguments and result as of `Decaying.at`.

        In the code A = (e^-z - e^-qz)/(q - 1), the part of the displacement that goes with the pressure.
        """
        M, q, gap = self._M, self._q[where], self._gap[where]
        e, slow = np.exp(-z), np.exp(-q * z)
        # From the root that falls more slowly: left of the imaginary axis of s that may be q.
        fluid_first = gap.real < 0.0
        ahead = np.asarray(np.where(fluid_first, -gap, gap) * z, dtype=np.complex128)
        A = z * np.where(fluid_first, slow, e) * relative_drop(ahead)
        rows = np.zeros((z.size, 6, 3), dtype=np.complex128)
        rows[:, 0, 0] = rows[:, 1, 0] = -e
        rows[:, 2, 0] = rows[:, 3, 0] = 2.0 * e
        rows[:, :, 1] = (
            np.stack([z - 1.0, z, 2.0 - 2.0 * z, -2.0 * z, np.full_like(z, 2.0), np.full_like(z, -2.0)]) * e
        ).T
        share, fluid = A / (q + 1.0), slow / (q + 1.0)
        rows[:, :, 2] = np.stack(
            [share, share - fluid, 2.0 * (fluid - share), -2.0 * share, M * slow, -M * q * slow]
        ).T
        return rows


class TransverseDecaying(Decaying):
    """Solutions for any transversely isotropic skeleton, by divided differences as the module says."""

    def __init__(self, skeleton: Skeleton, sh: ComplexArray) -> None:
        m = decay_roots(skeleton, sh)
        sums = homogeneous_sums(m, _DEGREE)
        by_stored, by_flow, fluid = _families(skeleton)
        flow = 1.0 / (1.0 + sh)
        # (3 differences, 6 rows, n)
        self._main = sh * flow * (by_stored @ sums) + flow * (by_flow @ sums)
        self._m = m
        self.slowest = m[0].real
        self._slow = np.abs(sh) < _FLUID_BELOW
        self._fluid = fluid @ sums[:, :, self._slow]

    def at(self, z: FloatArray, where: NDArray[np.bool_]) -> ComplexArray:
        """Fields of the three solutions; arguments and result as of `Decaying.at`."""
        f = exponentials(self._m[:, where], z.astype(np.complex128))
        main, slow = self._main[..., where], self._slow[where]
        y1, y12, _ = main
        rows = np.empty((z.size, 6, 3), dtype=np.complex128)
        rows[:, :, 0] = (y1 * f.f1).T
        rows[:, :, 1] = (y1 * f.f12 + y12 * f.f2).T
        rows[:, :, 2] = _second(main, f).T
        fluid = self._fluid[..., where[self._slow]]
        rows[slow, :, 0] = _second(fluid, Exponentials(*(values[slow] for values in f))).T
        return rows


def _second(y: ComplexArray, f: Exponentials) -> ComplexArray:
    """Second divided difference of y f over the three roots, (6, n), by Leibniz' rule.

    `y` (3, 6, n) holds y[m1], y[m1, m2], y[m1, m2, m3] of six polynomials; `f` the same of exp(-m z).
    """
    return np.asarray(y[0] * f.f123 + y[1] * f.f23 + y[2] * f.f3)


def _families(skeleton: Skeleton) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Coefficients of two families of polynomials y1, y2 in the decay root m that give solutions: (6, 6) arrays.

    y1 = w stored + b flow, w = sh/(1 + sh), b = 1/(1 + sh), sh the dimensionless Laplace variable; y2 = fluid.
    Returns stored, flow and fluid, each (rows of `Decaying.at`, powers of m).
    """
    A11, A13, A33, r = (skeleton.A11, skeleton.A13, skeleton.A33, skeleton.permeability_ratio)
    B = A13 + 1.0
    stored = _rows(skeleton, [0.0, 1.0], [1.0], [0.0, A11 - B, 0.0, -1.0])
    flow = _rows(skeleton, [0.0, B * r, 0.0, -B], [A11 * r, 0.0, -(A11 + r), 0.0, 1.0], [0.0])
    fluid = _rows(
        skeleton,
        [1.0, 0.0, B - A33],
        [0.0, A11 - B, 0.0, -1.0],
        [A11, 0.0, -(A11 * A33 - A13 * A13 - 2.0 * A13), 0.0, A33],
    )
    return stored, flow, fluid


def _rows(skeleton: Skeleton, U: list[float], W: list[float], Pi: list[float]) -> FloatArray:
    """Coefficients (6, 6), in powers of m, of the rows of `Decaying.at` from those of U, W, Pi/xi; d/dz is -m."""
    rows = np.zeros((6, _DEGREE + 1))
    for row, given in ((0, U), (1, W), (4, Pi)):
        rows[row, : len(given)] = given
    times_m = np.zeros_like(rows)
    times_m[:, 1:] = rows[:, :-1]
    rows[2] = -(times_m[0] + rows[1])
    rows[3] = skeleton.A13 * rows[0] - skeleton.A33 * times_m[1] - rows[4]
    rows[5] = -times_m[4]
    return rows
