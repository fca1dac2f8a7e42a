"""Quadrature of the exact contact problem: Gauss-Legendre rules, node counts, and the store of its tables.

`even_rule` and `legendre_rule` are the rules, ready-made, the former for even integrands and for a power times
an even integrand. `Resolution`, `series_terms` and `curve_terms` say how many nodes a solution takes: in x =
r/a, in the wavenumber u, and in the contact radius. The counts are fits, with a margin, to those measured for
rigid bases and for ratios of theta between 1e-8 and 1e8, at a/h from 0.2 to 20 and relative errors from 1e-2 to
1e-10. `TABLES` keeps what was tabulated, for the whole process.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace
from math import ceil, log, log1p, log10
from threading import Lock
from typing import Any, NamedTuple, Self, TypeVar

import numpy as np

from underlay._arrays import FloatArray, read_only
from underlay.errors import RangeError
from underlay.mechanics.exact.master_curve import Stretch
from underlay.mechanics.kernel import Scales

Table = TypeVar("Table")
# The starting points are off by 4 % of a node's distance from the end of the interval at most: there the terms of
# P_n fall as 0.06^k / k!^2, and ten of them, and four steps on their sum, reach rounding for every even count.
_TERMS, _NEWTON_STEPS = 10, 4
#: Most nodes in x = r/a times those in u: the cosines of one contact radius, 8 MB of them. An isotropic layer
#: at a/h = 20 and 1e-12 takes 110 x 288, on a base 1e8 times softer 110 x 752.
MOST_NODES = 1_000_000
# Each step moves the scale by less: after six the node count stands still.
_GRADING_STEPS = 6


class TableStore:
    """Cache of the tables used last, kept for the whole process; safe for threads.

    Two threads may at most build one table twice. A table is a pure function of its key (exponent, Poisson's
    ratios, cell, tolerance): it holds nothing of a caller, and the first to need it pays the 10 to 50 ms for all
    later uses. A store owned by a solver or a problem would be made anew for every fit of a series, since
    ``solver="auto"`` names a solver and holds none. So there is one, of bounded size, the only store of the
    package that outlives its callers; `tests/test_house.py` holds that there is no other.

    Parameters
    ----------
    most : int
        Number of tables kept; the one unused for longest is dropped first.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._kept: OrderedDict[Hashable, Any] = OrderedDict()
        self._lock = Lock()

    def __len__(self) -> int:
        return len(self._kept)

    def __reduce__(self) -> tuple[type[Self], tuple[int]]:
        # A copy in another process begins empty.
        return type(self), (self._most,)

    def get(self, key: Hashable, build: Callable[[], Table]) -> Table:
        """Table stored under `key`, made by `build` if there is none; the key must hold all it depends on."""
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                table: Table = self._kept[key]
                return table
        return self.put(key, build())

    def put(self, key: Hashable, table: Table) -> Table:
        """Store a table under a key, in place of any table there, and return it."""
        with self._lock:
            self._kept[key] = table
            self._kept.move_to_end(key)
            if len(self._kept) > self._most:
                self._kept.popitem(last=False)
        return table


#: A table has up to some 800 kB, most have 10.
TABLES = TableStore(4096)
#: Ranges of sizes per octave, of which one table serves any: radii and nodes go at most 9 % further than asked.
PER_OCTAVE = 8.0


def even_legendre(nodes: FloatArray, count: int) -> FloatArray:
    """Values of the even Legendre polynomials P_0, P_2, ..., P_(2 count - 2) at `nodes`: shape (nodes, count)."""
    return np.asarray(np.polynomial.legendre.legvander(nodes, 2 * count - 2)[:, ::2], dtype=np.float64)


class EvenRule(NamedTuple):
    """Positive half of a Gauss-Legendre rule: exact on (0, 1) for even polynomials of degree 4 n - 2.

    An even integrand needs half the nodes that the ordinary rule on (0, 1) would take.

    Parameters
    ----------
    nodes, weights : ndarray (n,)
        The rule.
    projection : ndarray (n, n)
        From values p(x_i) to the coefficients of p in P_0, P_2, ...: exact up to degree 2 n.
    with_edge : ndarray (n + 1,)
        The nodes and 1.
    """

    nodes: FloatArray
    weights: FloatArray
    projection: FloatArray
    with_edge: FloatArray

    def power_weights(self, exponent: float) -> FloatArray:
        """Weights v_i with sum v_i p(x_i) = int_0^1 x^exponent p(x) dx.

        Exact for even polynomials p of degree up to 2 n - 2, whatever the exponent, because
        int_0^1 x^a P_2k dx = prod_(j<=k) (a - 2j + 2) / prod_(j<=k) (a + 2j + 1) / (a + 1).
        """
        even = 2.0 * np.arange(1, self.nodes.size)
        moments = np.empty(self.nodes.size)
        moments[0] = 1.0 / (exponent + 1.0)
        moments[1:] = (exponent + 2.0 - even) / (exponent + 1.0 + even)
        return np.multiply.accumulate(moments) @ self.projection


def _legendre(*counts: int) -> dict[int, tuple[FloatArray, FloatArray]]:
    """Gauss-Legendre nodes and weights for several even node counts, in increasing order, to full precision.

    Nodes by Newton's method on P_n, weights 2/((1 - x^2) P_n'^2). The recurrence of P_n runs once for all counts,
    so that together they cost as much as the largest alone, and the Newton steps are taken on a Taylor series of
    P_n about the starting points, from Legendre's equation. numpy's and scipy's rules, from eigenvalues, carry
    weights with errors of 1e-11 at 128 nodes and 1e-10 at 400, which the condition of wide contacts raises to 1e-8;
    these stay at 1e-15 in every integral tried.
    """
    sizes = [count // 2 for count in counts]
    ends = np.cumsum(sizes)
    degree = np.repeat(counts, sizes)
    half = np.concatenate([np.arange(size, 0, -1) for size in sizes])
    start = np.cos(np.pi * (half - 0.25) / (degree + 0.5))
    before, here = np.ones_like(start), start.copy()
    for n in range(2, counts[-1] + 1):
        # Nodes of smaller rules have come to their end.
        on = slice(int(np.searchsorted(degree, n)), None)
        after = ((2 * n - 1) * start[on] * here[on] - (n - 1) * before[on]) / n
        before[on], here[on] = here[on], after
    terms = [here, degree * (start * here - before) / (start * start - 1.0)]
    for k in range(_TERMS - 2):
        # (1 - x^2) P^(k+2) = 2 (k + 1) x P^(k+1) + (k (k + 1) - n (n + 1)) P^(k), each over its factorial.
        bend = 2.0 * (k + 1) ** 2 * start * terms[-1] + (k * (k + 1) - degree * (degree + 1.0)) * terms[-2]
        terms.append(bend / ((k + 1) * (k + 2) * (1.0 - start * start)))
    series = np.array(terms)
    derivative = series[1:] * np.arange(1.0, _TERMS)[:, None]
    step = np.zeros_like(start)
    for _ in range(_NEWTON_STEPS):
        step -= _polynomial(series, step) / _polynomial(derivative, step)
    x, slope = start + step, _polynomial(derivative, step)
    weights = 2.0 / ((1.0 - x * x) * slope * slope)
    rules = zip(np.split(x, ends), np.split(weights, ends), strict=True)
    return {
        count: (
            read_only(np.concatenate((-nodes[::-1], nodes))),
            read_only(np.concatenate((own[::-1], own))),
        )
        for count, (nodes, own) in zip(counts, rules, strict=False)
    }


def _polynomial(coefficients: FloatArray, x: FloatArray) -> FloatArray:
    """Values (n,) of n power series, each at its own point: coefficients (terms, n), points x (n,)."""
    total = np.zeros_like(x)
    for coefficient in coefficients[::-1]:
        total = total * x + coefficient
    return total


def _even(count: int) -> EvenRule:
    nodes, weights = legendre_rule(2 * count)
    nodes, weights = nodes[count:], weights[count:]
    orders = 4.0 * np.arange(count) + 1.0
    projection = read_only((even_legendre(nodes, count) * orders).T * weights)
    return EvenRule(nodes, weights, projection, read_only(np.append(nodes, 1.0)))


# Finding the nodes takes longer than solving a contact problem with them, so the common rules are constants: those
# of up to 64 nodes, those a sphere asks for beside a solution of up to 16 nodes (40 + 4 n), and twice 1 to 20 for
# the even rules. Larger ones are kept with the tables.
_LEGENDRE = _legendre(*sorted({*range(2, 42, 2), *range(4, 108, 4)}))


def legendre_rule(count: int) -> tuple[FloatArray, FloatArray]:
    """Gauss-Legendre nodes and weights on (-1, 1), for an even count."""
    if count in _LEGENDRE:
        return _LEGENDRE[count]
    return TABLES.get(("legendre", count), lambda: _legendre(count)[count])


_EVEN = {count: _even(count) for count in range(1, 21)}


def even_rule(count: int) -> EvenRule:
    """Gauss-Legendre rule of `count` nodes on (0, 1) for even integrands."""
    return _EVEN[count] if count in _EVEN else TABLES.get(("even rule", count), lambda: _even(count))


@dataclass(frozen=True)
class Resolution:
    """Node counts of one numerical solution of the contact problem.

    Parameters
    ----------
    radial : int
        Number of nodes in x = r/a.
    wavenumbers : int
        Number of nodes in u, the wavenumber times the thickness: Gauss-Legendre in s, u = first (exp(s) - 1).
    first, reach : float
        The scale of the smallest u in that map, and the largest u.
    """

    radial: int
    wavenumbers: int
    first: float
    reach: float

    @classmethod
    def choose(cls, scales: Scales, eps: float, rtol: float) -> Self:
        """Node counts for contact radii up to `eps` = a/h at relative error `rtol`, on a body of these `scales`.

        Raises
        ------
        RangeError
            If radial nodes times wavenumbers would pass `MOST_NODES`, before any is computed.
        """
        digits = 0.5 - log10(rtol)
        wide = eps / scales.decay
        radial = ceil(0.55 * wide**1.38 + (0.4 + 0.28 * wide) * digits)
        # The condition of wide contacts on a rigid base grows as wide^3: the tail must be that much smaller.
        reach = 1.15 * digits + 2.0 + 0.5 * log1p(0.1 * wide)
        first, count = _graded(scales, wide, digits, reach)
        if radial * count > MOST_NODES:
            raise RangeError(
                f"the exact law would take {radial:.0f} x {count:.0f} nodes at a/h = {eps:.3g}, and it takes "
                f"{MOST_NODES} of both together at most: with these E, E_axial and G_axial the layer's "
                f"displacements decay as exp(-{scales.decay:.2g} z), so that a contact acts "
                f"{1.0 / scales.decay:.3g} times as wide as it is; "
                "check the moduli and their units, press less deep, or allow a larger rtol"
            )
        return cls(
            radial=max(2, radial),
            wavenumbers=4 * ceil(0.25 * count),
            first=first / scales.decay,
            reach=reach / scales.decay,
        )

    @property
    def size(self) -> int:
        """Number of cosines cos(eps x u) that one contact radius takes: radial nodes times wavenumbers.

        eps is a/h, contact radius over thickness.
        """
        return self.radial * self.wavenumbers

    def scaled(self, radial: float, wavenumbers: float) -> Resolution:
        """The same grading with the node counts multiplied by `radial` and `wavenumbers`."""
        return replace(
            self,
            radial=ceil(radial * self.radial),
            wavenumbers=4 * ceil(0.25 * wavenumbers * self.wavenumbers),
        )

    def finer(self, share: float = 1.0) -> Resolution:
        """About twice the nodes, graded finer and reaching further, as a check; `share` < 1 refines less."""
        return Resolution(
            ceil(1.5**share * self.radial) + 1,
            4 * ceil(0.25 * 2.0**share * self.wavenumbers),
            0.25**share * self.first,
            1.2**share * self.reach,
        )

    def wavenumber_rule(self) -> tuple[FloatArray, FloatArray]:
        """Nodes u (the wavenumber times the thickness) and their weights, each (wavenumbers,).

        Of the rules tried (tripling and equal panels, Gauss-Laguerre, this one) the single Gauss rule on an
        exponential variable takes the fewest nodes: 24 instead of 35 at a/h = 2 and 1e-6.
        """
        nodes, weights = legendre_rule(self.wavenumbers)
        half_span = 0.5 * log1p(self.reach / self.first)
        grown = np.exp(half_span * nodes + (half_span + log(self.first)))
        return grown - self.first, half_span * weights * grown


def series_terms(scales: Scales, eps: float, rtol: float) -> int:
    """Number of terms of an expansion in the contact radius, for a/h up to `eps` at relative error `rtol`.

    The expansion is that of `RadiusSeries`. Fitted to 1500 expansions over layers on bases of every stiffness. For
    anisotropic layers whose displacements decay slowly with depth (`Scales.decay` < 1) it is larger, as 60 random
    layers with complex decay roots needed.
    """
    length = float(Stretch.to(eps, scales.softness).length) * (1.0 - log(min(scales.decay, 1.0)))
    return ceil((0.5 - log10(rtol)) * (0.8 + (1.0 if scales.softness == 0.0 else 0.75) * length) + 1.0)


def curve_terms(scales: Scales, varpi: float, exponent: float, rtol: float) -> int:
    """Number of terms of one polynomial for the master curve up to `varpi`, at relative error `rtol`.

    There are as many contact radii to solve for. varpi is the half-space contact radius at the depth over the
    thickness, `exponent` that of the power law that measures it. Fitted to 2700 curves of power laws on layers of
    every Poisson's ratio, for errors of 1e-3 to 1e-8; one curve in ten needs more terms than this, and is solved
    again.
    """
    digits = 1.0 - log10(rtol)
    start, bend = (0.4, 1.12 + 0.26 * scales.firmness) if scales.softness == 0.0 else (0.5, 0.6)
    length = float(Stretch.to(varpi, scales.softness).length) * (1.0 + 0.25 / exponent)
    # What an error is estimated from is four terms.
    return max(4, ceil(digits * (start + bend * length) + 1.4))


def _graded(scales: Scales, wide: float, digits: float, reach: float) -> tuple[float, float]:
    """Scale of the smallest wavenumbers (`Resolution.first`) and the number of nodes in u.

    `wide` is a/h over the slowest decay rate, `digits` about -log10 of the error allowed, `reach` the largest u. A
    pole of L at -x costs exp(-4 n sqrt(x/(first span))) with n nodes on s in [0, span]: the smaller x, the finer
    the grading. The layer's fastest decay is one. A substrate softer than the layer adds one where the
    layer bends, at ratio^(1/3) (0.3 of it where measured), and one at `stretch`, which carries less of the
    kernel; the digits needed of each are fitted.
    """
    first = 1.0 if wide < 4.0 else 3.0
    base = max(2.2 + 0.6 * wide, 1.0 + 1.1 * wide)
    poles = [(0.5 * scales.decay / scales.fastest, digits)]
    if scales.ratio < 1.0:
        poles.append((0.3 * scales.ratio ** (1.0 / 3.0), digits - 0.5 * log10(scales.ratio)))
        small = digits + 1.0 + 0.5 * log10(scales.ratio)
        if small > 0.0:
            poles.append((scales.stretch * scales.decay, small))
    growth = (0.34 if scales.ratio >= 1.0 else 0.5) + 0.13 * wide
    count = digits * (base + growth * max(0.0, -log(first)))
    for _ in range(_GRADING_STEPS):
        finest = min(x * (1.74 * count / wanted) ** 2 for x, wanted in poles) / log1p(reach / first)
        if finest >= first:
            break
        first = finest
        count = digits * (base + growth * max(0.0, -log(first)))
    return first, count
