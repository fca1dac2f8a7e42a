"""Master curves of a paraboloid on every isotropic layer on an isotropic base, solved once and kept in a file.

A law read off them takes a third of the time that its solution does, and a search for a start, which needs little
accuracy for laws far apart, takes next to none. Without friction such a body is two numbers and no more (as Dundurs
found of plane strain; its Hankel transform depends on no other): the ratio r = theta_base/theta_layer of elastic
constants, and

    share = (2 (r gamma_layer - gamma_base) + 1)/(r + 1),   gamma = (1 - 2 nu)/(2 (1 - nu)),

which goes from 0 to 1 while Poisson's ratios nu go from 1/2 to 0. The logarithms of the three factors (`Factor`)
are Chebyshev series in ln r, in ln(1 + 100 share), which spreads out thin incompressible layers near zero, and in
the stretched varpi (half-space contact radius at the depth over the thickness). When first needed they are
converted to a range of varpi, with as many terms as an accuracy takes. `tests/studies/stored_curves.py` writes the
file; a test solves again.
"""

from __future__ import annotations

from math import acos, exp, floor, inf, log, log1p, log2, log10
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np

from underlay._arrays import FloatArray, read_only
from underlay.errors import LawError
from underlay.mechanics.exact.contact_problem import SHARE_OF_NODES, ContactProblem, SolvedCurve, solve_curve
from underlay.mechanics.exact.master_curve import (
    MOST_IN_POWERS,
    Factor,
    MasterCurve,
    Stretch,
    chebyshev_angles,
    chebyshev_coefficients,
    chebyshev_values,
    in_powers,
    shortened,
)
from underlay.mechanics.exact.nodes import PER_OCTAVE, TABLES, Resolution
from underlay.mechanics.kernel import Kernel, LayerKernel, SubstrateKernel
from underlay.mechanics.kernel.bodies import is_isotropic

FILE = Path(__file__).with_name("stored_curves.npy")
#: Relative error of the three factors, largest of 150 random bodies, and a fifth of it more: half of it is the
#: single precision of the file. On bases softer than the ratio that follows it is the other one.
STORED_ERROR, _SOFT, _SOFT_ERROR = 2e-7, 0.02, 8e-7
#: The tip's exponent, and the largest varpi.
EXPONENT, TOP = 2.0, 10.48
#: Of the stretched varpi; of the share; ends of ln r; terms in ln r, share and varpi.
_SOFTNESS, CROWDING = 2.0, 100.0
LOG_RATIOS = (log(0.004), log(470.0))
TERMS = (33, 23, 50)
MADE_FOR = (EXPONENT, TOP, _SOFTNESS, CROWDING, *LOG_RATIOS, *TERMS)
STRETCH = Stretch.to(TOP, _SOFTNESS)
# Rounding of constants, and of the ends.
_ROUNDING = 1e-9


class _Shortened(NamedTuple):
    """Stored series (ratios + 1, shares, 3, terms) without terms that an accuracy can do without, and their sum.

    The last entry of the first axis is that of a rigid base.
    """

    stretch: Stretch
    series: FloatArray
    left_out: float

    @classmethod
    def of(cls, stretch: Stretch, series: FloatArray, allowed: float, left_out: float = 0.0) -> Self:
        """Drop the last terms along each of the three axes of series, those whose sum is at most `allowed`."""
        sizes = np.abs(series)
        sizes = np.maximum(np.maximum(sizes[:, :, 0], sizes[:, :, 1]), sizes[:, :, 2])
        kept = []
        for axis in (2, 1, 0):
            sums = sizes[:-1].sum(axis=tuple({0, 1, 2} - {axis}))
            if axis:
                sums = np.maximum(sums, sizes[-1].sum(axis=2 - axis))
            tails = np.cumsum(sums[::-1])[::-1]
            kept.append(max(1, int(np.count_nonzero(tails > allowed))))
            left_out += float(tails[kept[-1]]) if kept[-1] < len(tails) else 0.0
        terms, shares, ratios = kept
        shorter = np.concatenate((series[:ratios, :shares, :, :terms], series[-1:, :shares, :, :terms]))
        return cls(stretch, read_only(shorter), left_out)

    def up_to(self, top: float, allowed: float) -> _Shortened:
        """The series converted to varpi in [0, `top`], and shortened again to errors of `allowed`.

        varpi is the half-space contact radius at the depth over the thickness.
        """
        stretch, terms = self.stretch.over(top), self.series.shape[3]
        there = chebyshev_values(self.stretch.z(stretch.v(np.cos(chebyshev_angles(terms)))), terms)
        to_terms = chebyshev_coefficients(np.eye(terms), chebyshev_angles(terms))
        # One product of matrices: as products of stacks it takes ten times as long.
        turned = self.series.reshape(-1, terms) @ (to_terms @ there).T
        return _Shortened.of(stretch, turned.reshape(self.series.shape), allowed, self.left_out)


class StoredCurves(NamedTuple):
    """The stored curves as the file holds them.

    varpi is the half-space contact radius at the depth over the thickness.

    Bodies have two parameters: r, the ratio of the elastic constants of base and layer, and a share
    that combines r with Poisson's ratios (module's head).

    Parameters
    ----------
    made_for : ndarray
        Constants of this module (exponent, ranges, numbers of terms) with which the file was made, to be compared.
    series : ndarray (ratios + 1, shares, terms, 3)
        Chebyshev coefficients in ln r, in the share and in varpi; the last entry is a rigid base's.
    nodes : ndarray (4,)
        `Resolution` of the finest solution behind them.
    """

    made_for: FloatArray
    series: FloatArray
    nodes: FloatArray

    @classmethod
    def read(cls) -> Self:
        """Read the file of the package.

        Raises
        ------
        LawError
            If it was made with other constants than this version's.
        """
        kept = np.load(FILE, allow_pickle=False)
        if kept.dtype.names != cls._fields or tuple(kept["made_for"].tolist()) != MADE_FOR:
            raise LawError(
                f"{FILE} does not hold the curves that this version reads: install underlay again or, in its tree, "
                "run python tests/studies/stored_curves.py"
            )
        return cls(*(read_only(kept[name].astype(np.float64)) for name in cls._fields))

    @property
    def resolution(self) -> Resolution:
        """Node counts of the finest solution behind the stored curves."""
        radial, wavenumbers, scale, reach = self.nodes.tolist()
        return Resolution(int(radial), int(wavenumbers), scale, reach)


def known_curve(
    problem: ContactProblem, top: float, rtol: float, left_out: float = SHARE_OF_NODES
) -> SolvedCurve:
    """Master curve read from the file where that holds it, else solved for; arguments as `solve_curve`."""
    plain = problem.indenter is problem.measure and not problem.variants
    stored = stored_curve(problem.kernel, problem.measure.exponent, top, rtol, left_out) if plain else None
    return stored or solve_curve(problem, top, rtol, left_out)


def stored_curve(
    body: Kernel, exponent: float, top: float, rtol: float, left_out: float = 0.0
) -> SolvedCurve | None:
    """Stored master curve of a power-law tip on a body whose layer has unit thickness.

    Parameters
    ----------
    body : Kernel
        Of the layer and its base.
    exponent : float
        Of the tip's power law.
    top : float
        Largest varpi, the half-space contact radius at the depth over the thickness, that will be needed.
    rtol : float
        Relative error allowed.
    left_out : float, default 0
        Share of `rtol` up to which last terms are dropped: with 0.6 one search of 500 missed the optimum.

    Returns
    -------
    SolvedCurve or None
        None where the file does not hold it so accurately, or only in more terms than a curve may have.
    """
    if exponent != EXPONENT or top > TOP * (1.0 + _ROUNDING) or rtol < 2.0 * STORED_ERROR:
        return None
    place = _place(body)
    if place is None or abs(place[1]) > 1.0:
        return None
    error = _SOFT_ERROR if place[0] < _first(_SOFT) else STORED_ERROR
    if rtol < 2.0 * error:
        return None
    stored = TABLES.get(("stored curves",), StoredCurves.read)
    digits = floor(log10(rtol))
    # Three stored series and three of a range leave out as much each: three tenths of rtol in all.
    allowed = 0.05 * 10.0**digits
    number = floor(PER_OCTAVE * max(log2(TOP / top), 0.0))

    def shortened_series() -> _Shortened:
        key = ("stored curves", digits)
        every = TABLES.get(key, lambda: _Shortened.of(STRETCH, np.moveaxis(stored.series, 3, 2), allowed))
        return every.up_to(TOP * 0.5 ** (number / PER_OCTAVE), allowed)

    stretch, series, missing = TABLES.get(("stored curves", digits, number), shortened_series)
    terms = _at(series, *place)
    kept, more = shortened(terms, left_out * rtol)
    if kept > MOST_IN_POWERS:
        return None
    error += missing + more
    end = 2.0 * stretch.over(top).length / stretch.length - 1.0
    waves = np.cos(acos(min(end, 1.0)) * np.arange(len(terms)))
    eps = top * exp(float(waves @ terms[:, Factor.RADIUS]))
    curve = MasterCurve(stretch, (-1.0, 1.0), in_powers(terms[None, :kept]), error)
    return SolvedCurve(curve, stored.resolution, eps, error)


def _at(series: FloatArray, first: float, second: float) -> FloatArray:
    """Series in varpi, (terms, 3), of one body out of those of all bodies, (ratios + 1, shares, 3, terms).

    `first` and `second` are the body's coordinates from `_place`.

    varpi is the half-space contact radius at the depth over the thickness.

    Bodies have two parameters: r, the ratio of the elastic constants of base and layer, and a share
    that combines r with Poisson's ratios (module's head).
    """
    ratios, shares, *shape = series.shape
    if first == inf:
        by_share = series[-1]
    else:
        by_share = np.cos(acos(min(first, 1.0)) * np.arange(ratios - 1)) @ series[:-1].reshape(ratios - 1, -1)
    own = np.cos(acos(second) * np.arange(shares)) @ by_share.reshape(shares, -1)
    return np.asarray(own.reshape(shape).T)


def _place(body: Kernel) -> tuple[float, float] | None:
    """Coordinates in [-1, 1] of a body in ln r and in the spread share; the first is infinite on a rigid base.

    None where the body is not an isotropic layer on an isotropic or rigid base, or r is outside the range.

    Bodies have two parameters: r, the ratio of the elastic constants of base and layer, and a share
    that combines r with Poisson's ratios (module's head).
    """
    if not isinstance(body, LayerKernel | SubstrateKernel):
        return None
    layer, base = body.constants
    if not is_isotropic(layer):
        return None
    if base is None:
        return inf, _spread(2.0 * layer.coupling)
    if not is_isotropic(base):
        return None
    ratio = float(base.theta / layer.theta)
    first = _first(ratio)
    share = (2.0 * (ratio * layer.coupling - base.coupling) + 1.0) / (ratio + 1.0)
    return None if abs(first) > 1.0 else (first, _spread(share))


def _first(ratio: float) -> float:
    """Coordinate of a ratio r = theta_base/theta_layer, linear in ln r: in [-1, 1] within the stored range."""
    low, high = LOG_RATIOS
    return 2.0 * (log(ratio) - low) / (high - low) - 1.0


def _spread(share: float) -> float:
    """Coordinate of a share in [-1, 1]; infinite where the share is outside [0, 1] (a negative Poisson's ratio).

    Bodies have two parameters: r, the ratio of the elastic constants of base and layer, and a share
    that combines r with Poisson's ratios (module's head).
    """
    if not -_ROUNDING <= share <= 1.0 + _ROUNDING:
        return inf
    return 2.0 * log1p(CROWDING * min(max(share, 0.0), 1.0)) / log1p(CROWDING) - 1.0
