"""JKR for many parameter sets at once: one tip, any work of adhesion, any depths, one ratio of moduli.

The elastic contact does not depend on the work of adhesion. So the four functions of its radius a that JKR needs,

    w_el,   Q = sqrt(pi a/theta)/g(1),   P_el,   K = 4 theta a kappa,

are tabulated once over ln a (`PunchNodes`) and, where a ratio of moduli varies, over its logarithm (`Span`). They
are depth and force without adhesion, and factors from the flat punch (g(1) and kappa of `radius_relation`). A set
of work dgamma is the curve w = w_el - sqrt(dgamma) Q and P = P_el - sqrt(dgamma) K Q. Behind a spring of compliance
C the travel of its other end is y = w + C P. A set's contact radius at a given travel is the root of y(a) beyond
the minimum of y, by Newton's method for all sets and points together; at the minimum the tip comes off.

The radii at which tables end, and the ranges of the ratio, are fixed numbers: the result for a set does not depend
on the other sets. Branches with more than one stable piece, and adhesion that is tiny against the load, are left to
the law of a single contact.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from enum import IntEnum
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.mechanics.adhesion.adhesive_law import in_touch
from underlay.mechanics.adhesion.radius_relation import RadiusRelation, largest_radius, solve_relation
from underlay.mechanics.contact import AdhesionTable, AdhesiveReadings, Contact
from underlay.mechanics.exact.curve_family import RatioSpan, ratio_numbers, ratio_span
from underlay.mechanics.exact.master_curve import chebyshev_angles, lagrange
from underlay.mechanics.indenters import PowerLawShape

_OCTAVES, _PER_OCTAVE = 12, 20
# Places in a range of the ratio that are solved for: the polynomial through 11 is good to 9^-11 = 3e-11.
_PLACES = np.cos(chebyshev_angles(11))
# Of the radius at zero depth on a half-space: a set whose table does not reach this far down is left out.
_LOWEST = 0.03
# Newton from the chord, or from the parabola at the end of the branch, takes three or four steps. One of less than
# _CLOSE in ln a squares to below the rounding of the next.
_STEPS, _CLOSE = 40, 1e-8


class Quantity(IntEnum):
    """The four tabulated functions of the contact radius a, those that JKR needs of the elastic contact.

    Depth w_el and force P_el without adhesion, Q = sqrt(pi a/theta)/g(1) and K = 4 theta a kappa, with theta the
    elastic constant and g(1) and kappa those of `radius_relation`.
    """

    DEPTH = 0
    PULL = 1
    FORCE = 2
    STIFFNESS = 3


@dataclass(frozen=True)
class PunchNodes:
    """The four functions (`Quantity`) over ln a for one or several bodies, as cubic Hermite interpolants.

    The logarithms have their exact values and slopes at the nodes: dP_el/da = K
    dw_el/da and d(a kappa)/da = g(1)^2. With 20 nodes to an octave the error is below 1e-8, held by a test.

    kappa is the flat punch's stiffness over that on a half-space.

    Parameters
    ----------
    log_radius : ndarray (nodes,)
        ln a, evenly spaced.
    cubics : ndarray (4, 4, bodies, nodes - 1)
        For each function the coefficients of 1, t, t^2, t^3 of its logarithm, with t from 0 to 1 in each interval.
    """

    log_radius: FloatArray
    cubics: FloatArray

    @classmethod
    def of(cls, relation: RadiusRelation, end: float) -> Self:
        """Tabulate the elastic contact of one body from radius `end` (m) inwards."""
        log_radius = np.log(end) + np.linspace(-_OCTAVES * np.log(2.0), 0.0, _OCTAVES * _PER_OCTAVE + 1)
        radius = np.minimum(np.exp(log_radius), end)
        here, theta = relation.at(radius), relation.theta
        stiffness = 4.0 * theta * radius * here.kappa
        pull = np.sqrt(np.pi * radius / theta) / here.edge
        values = np.log(np.stack((here.depth, pull, here.force, stiffness)))
        slopes = np.stack(
            (
                radius * here.depth_slope / here.depth,
                0.5 - radius * here.edge_rate,
                radius * stiffness * here.depth_slope / here.force,
                here.edge**2 / here.kappa,
            )
        )
        step = log_radius[1] - log_radius[0]
        low, rise = values[:, :-1], np.diff(values)
        left, right = step * slopes[:, :-1], step * slopes[:, 1:]
        cubics = np.stack((low, left, 3.0 * rise - 2.0 * left - right, left + right - 2.0 * rise), axis=1)
        return cls(log_radius, cubics[:, :, None, :])

    @property
    def step(self) -> float:
        """Spacing of the nodes in ln a."""
        return float(self.log_radius[1] - self.log_radius[0])


class Columns:
    """Evaluates the four functions (`Quantity`) at given ln a.

    Parameters
    ----------
    nodes : PunchNodes
        The tables.
    table : ndarray of int
        Index of the body, for each entry of `log_radius`.
    log_radius : ndarray
        ln a.
    """

    def __init__(self, nodes: PunchNodes, table: NDArray[np.intp], log_radius: FloatArray) -> None:
        place = (log_radius - nodes.log_radius[0]) / nodes.step
        cells = nodes.log_radius.size - 1
        cell = np.minimum(place.astype(np.intp), cells - 1)
        self._nodes, self._t, self._place = nodes, place - cell, cell + cells * table

    def at(self, which: Quantity) -> tuple[FloatArray, FloatArray]:
        """Values of one of the four functions, and their derivatives in ln a."""
        t = self._t
        one, two, three, four = (np.take(row, self._place) for row in self._nodes.cubics[which])
        value = np.exp(one + t * (two + t * (three + t * four)))
        return value, value * ((two + t * (2.0 * three + 3.0 * t * four)) / self._nodes.step)


@dataclass(frozen=True)
class Span:
    """Tables up to one contact radius, of a fixed body or at the Chebyshev points of a range of the ratio.

    In ln k, k the ratio of moduli, the functions are interpolated by polynomials through Chebyshev points in ranges
    of ln 4. They are analytic in ln k with their nearest poles at Im ln k = pi (see `curve_family`): each point
    gains a factor of 9.

    Parameters
    ----------
    points : tuple of PunchNodes
        One, or one at each Chebyshev point of the ratio.
    span : RatioSpan
        The range of the ratio.
    """

    points: tuple[PunchNodes, ...]
    span: RatioSpan

    @classmethod
    def solve(
        cls, contact_at: Callable[[float], Contact], end: float, rtol: float, number: int | None
    ) -> Self | None:
        """Solve up to the radius `end` (m), for range `number` of the ratio, or a fixed body (None).

        None where there is no solution.
        """
        span = ratio_span(number or 0)
        places = np.zeros(1) if number is None else _PLACES
        try:
            contacts = [contact_at(ratio) for ratio in span.ratios(places).tolist()]
            relations = [solve_relation(contact, end, rtol) for contact in contacts]
        except InputError:
            return None
        return cls(tuple(PunchNodes.of(relation, end) for relation in relations), span)

    def nodes(self, sets: int, ratio: FloatArray | None) -> tuple[PunchNodes, NDArray[np.intp]]:
        """Tables of `sets` sets at their ratios (sets,), and the index of each set's table."""
        first = self.points[0]
        if ratio is None:
            return first, np.zeros(sets, dtype=np.intp)
        weights = lagrange(self.span.place(np.log(ratio)), _PLACES)
        # Sums in a fixed order: a set's table does not depend on how many there are.
        cubics = np.zeros((*first.cubics.shape[:2], sets, first.cubics.shape[-1]))
        for weight, point in zip(weights.T, self.points, strict=True):
            cubics += weight[:, None] * point.cubics
        return PunchNodes(first.log_radius, cubics), np.arange(sets)


@dataclass(frozen=True)
class _Sets:
    """Curves w(a), P(a) of parameter sets, from tables.

    Parameters
    ----------
    nodes : PunchNodes
        The tables, one for all or one for each set.
    table : ndarray
        Index of the table of each set.
    root_work : ndarray
        sqrt(dgamma) of each, dgamma the work of adhesion (J/m^2).
    compliance : ndarray
        Of the spring (m/N) of each.
    """

    nodes: PunchNodes
    table: NDArray[np.intp]
    root_work: FloatArray
    compliance: FloatArray

    def of(self, rows: NDArray[np.intp] | tuple[slice, None]) -> _Sets:
        """Sets selected by `rows`, which may repeat; ``(slice, None)`` adds an axis for points."""
        return _Sets(self.nodes, self.table[rows], self.root_work[rows], self.compliance[rows])

    def columns(self, log_radius: FloatArray) -> Columns:
        """The four functions at ln a, an array that broadcasts with the sets."""
        return Columns(self.nodes, self.table, log_radius)

    def force(self, here: Columns) -> tuple[FloatArray, FloatArray]:
        """Contact force P (N) and dP/d ln a (N)."""
        force, pull, stiffness = (here.at(i) for i in (Quantity.FORCE, Quantity.PULL, Quantity.STIFFNESS))
        product = stiffness[0] * pull[0]
        slope = stiffness[1] * pull[0] + stiffness[0] * pull[1]
        return force[0] - self.root_work * product, force[1] - self.root_work * slope

    def depth(self, here: Columns) -> tuple[FloatArray, FloatArray]:
        """Depth w (m) and dw/d ln a (m)."""
        depth, pull = here.at(Quantity.DEPTH), here.at(Quantity.PULL)
        return depth[0] - self.root_work * pull[0], depth[1] - self.root_work * pull[1]

    def travel(self, log_radius: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Travel y = w + C P (m) and dy/d ln a; force and its slope under load control (C infinite)."""
        here = self.columns(log_radius)
        if np.isinf(self.compliance).all():
            return self.force(here)
        depth = self.depth(here)
        if not self.compliance.any():
            return depth
        force = self.force(here)
        return depth[0] + self.compliance * force[0], depth[1] + self.compliance * force[1]


@dataclass(frozen=True)
class JKRTable(AdhesionTable):
    """JKR contacts of one tip on one body (or bodies differing in one ratio), for any work of adhesion.

    Parameters
    ----------
    contact_at : callable
        The contact at a value of the ratio of moduli that varies; the same at any value where none does.
    contact : Contact
        One of these.
    states : str
        Which states are taken; see `JKR`.
    rtol : float
        Relative error of the elastic solution.
    spans : dict
        Cache of tables, by the octave of the radius at which they end and the number of the range of the ratio.
    """

    contact_at: Callable[[float], Contact]
    contact: Contact
    states: str
    rtol: float
    spans: dict[tuple[int, int], Span | None] = field(default_factory=dict, repr=False, compare=False)

    def readings(
        self, work: FloatArray, travel: FloatArray, compliance: FloatArray, ratio: FloatArray | None
    ) -> AdhesiveReadings:
        """Force and stiffness of sets at given travels of the spring's far end: `AdhesionTable.readings`."""
        found = AdhesiveReadings.empty(*travel.shape)
        for rows, sets, wide in self._groups(work, np.maximum(travel.max(axis=1), 0.0), compliance, ratio):
            self._solve(sets, rows, wide, travel, found)
        return found

    def pull_offs(self, work: FloatArray, ratio: FloatArray | None) -> FloatArray:
        """Pull-off force (N) and depth (m) of each set, (2, sets); see `AdhesionTable.pull_offs`."""
        found, shallow = np.full((2, work.size), np.nan), np.zeros(work.size)
        for compliance, sign, row in ((np.inf, -1.0, found[0]), (0.0, 1.0, found[1])):
            held = np.full(work.size, compliance)
            for rows, sets, wide in self._groups(work, shallow, held, ratio):
                _, least, good = self._branches(sets, wide)
                row[rows[good]] = sign * _ends_of(sets.of(good), least[good])[1]
        return found

    def _groups(
        self, work: FloatArray, deepest: FloatArray, compliance: FloatArray, ratio: FloatArray | None
    ) -> Iterator[tuple[NDArray[np.intp], _Sets, NDArray[np.bool_]]]:
        """Iterate over groups of sets that share a table: row numbers, the sets, and for which it is wide enough.

        Sets for which it is not come again with a wider table. `deepest` (m), (sets,), are the largest depths.
        """
        octave = self._first_octaves(work, deepest)
        cells = (np.zeros(work.size) if ratio is None else ratio_numbers(ratio)).astype(np.intp)
        waiting = np.ones(work.size, dtype=bool)
        while waiting.any():
            first = np.flatnonzero(waiting)[0]
            key = (int(octave[first]), int(cells[first]))
            rows = np.flatnonzero(waiting & (octave == key[0]) & (cells == key[1]))
            span = self._span(*key, varies=ratio is not None)
            wide = np.zeros(rows.size, dtype=bool)
            if span is not None:
                nodes, table = span.nodes(rows.size, None if ratio is None else ratio[rows])
                sets = _Sets(nodes, table, np.sqrt(work[rows]), compliance[rows])
                wide = _reaches(sets, deepest[rows])
                yield rows, sets, wide
            waiting[rows[wide]] = False
            octave[rows[~wide]] += 1
            if span is None or self._is_last(key[0]):
                waiting[rows] = False

    def _first_octaves(self, work: FloatArray, deepest: FloatArray) -> NDArray[np.intp]:
        """Octave of the contact radius that each set needs on a half-space; on a layer it may need more."""
        measure = self.contact.indenter.power_law
        wide = np.maximum(1.2 * self._reference(measure, work), measure.halfspace_radius(deepest))
        octave = np.ceil(np.log2(wide / self._unit))
        return (np.minimum(octave, 0.0) if self._ends else octave).astype(np.intp)

    def _reference(self, measure: PowerLawShape, work: FloatArray) -> FloatArray:
        """Contact radii (m) of zero depth on a half-space, for works of adhesion (J/m^2)."""
        drop = np.sqrt(np.pi * work / self.contact.theta) / measure.abel_coefficient
        return np.asarray(drop ** (1.0 / (measure.exponent - 0.5)))

    @property
    def _ends(self) -> bool:
        return bool(np.isfinite(largest_radius(self.contact)))

    @property
    def _unit(self) -> float:
        """Radius (m) at which octave 0 ends: the largest that can be solved, or 1 m where there is no limit."""
        return largest_radius(self.contact) if self._ends else 1.0

    def _is_last(self, number: int) -> bool:
        return self._ends and number >= 0

    def _span(self, octave: int, cell: int, *, varies: bool) -> Span | None:
        """Cached tables that end at the radius of this octave; None where there is no solution."""
        key = (octave, cell)
        if key not in self.spans:
            end = self._unit * 2.0**octave
            contact_at = self.contact_at if varies else lambda _: self.contact
            self.spans[key] = Span.solve(contact_at, end, self.rtol, cell if varies else None)
        return self.spans[key]

    def _branches(
        self, sets: _Sets, wide: NDArray[np.bool_]
    ) -> tuple[FloatArray, NDArray[np.intp], NDArray[np.intp]]:
        """Travels at the nodes, (sets, nodes), the index of their minimum, and the usable sets.

        Usable are sets for which the table is wide enough and that have a single stable branch.
        """
        grid = sets.nodes.log_radius
        y = sets.of((slice(None), None)).travel(grid)[0]
        least = y.argmin(axis=1)
        rising = (np.diff(y, axis=1) > 0.0) | (np.arange(grid.size - 1) < least[:, None])
        lowest = np.log(_LOWEST * self._reference(self.contact.indenter.power_law, sets.root_work**2))
        good = np.flatnonzero(wide & (least > 0) & rising.all(axis=1) & (lowest > grid[0]))
        return y, least, good

    def _solve(
        self,
        sets: _Sets,
        rows: NDArray[np.intp],
        wide: NDArray[np.bool_],
        travel: FloatArray,
        found: AdhesiveReadings,
    ) -> None:
        """Write force and stiffness of the usable sets (see `_branches`) into `found`."""
        y, least, good = self._branches(sets, wide)
        if not good.size:
            return
        grid = sets.nodes.log_radius
        sets, rows, y, least = sets.of(good), rows[good], y[good], least[good]
        end, start = _ends_of(sets, least)
        which, point = np.nonzero(in_touch(self.states, travel[rows], start[:, None]))
        own, target = sets.of(which), travel[rows[which], point]
        here = own.columns(_roots(own, target, _brackets(grid, y, end, start, which, target)))
        force, depth = own.force(here), own.depth(here)
        found.force[rows[which], point] = force[0]
        found.stiffness[rows[which], point] = force[1] / depth[1]
        found.possible[rows] = True


def _reaches(sets: _Sets, deepest: FloatArray) -> NDArray[np.bool_]:
    """Whether the widest contact of the table is at least as deep as `deepest` (m) and without tension, (sets,)."""
    here = sets.columns(np.full(sets.root_work.size, sets.nodes.log_radius[-1]))
    depth, force = sets.depth(here), sets.force(here)
    return (depth[1] > 0.0) & (force[1] > 0.0) & (depth[0] >= deepest) & (force[0] >= 0.0)


def _ends_of(sets: _Sets, least: NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
    """ln a and y at the minimum of y (pull-off), from the node where it is least.

    dy/d ln a = 0 is solved by the Illinois variant of the regula falsi.
    """
    grid = sets.nodes.log_radius
    low, high = grid[least - 1], grid[np.minimum(least + 1, grid.size - 1)]
    below, above = sets.travel(low)[1], sets.travel(high)[1]
    side, x = np.zeros(least.size), low
    for _ in range(_STEPS):
        previous, x = x, low - below * (high - low) / (above - below)
        if (np.abs(x - previous) <= _CLOSE).all():
            break
        slope = sets.travel(x)[1]
        over = slope > 0.0
        # The end that stays twice is given half its weight.
        below = np.where(over, np.where(side == 1.0, 0.5 * below, below), slope)
        above = np.where(over, slope, np.where(side == -1.0, 0.5 * above, above))
        low, high, side = np.where(over, low, x), np.where(over, x, high), np.where(over, 1.0, -1.0)
    return x, sets.travel(x)[0]


def _brackets(
    grid: FloatArray,
    y: FloatArray,
    end: FloatArray,
    start: FloatArray,
    which: NDArray[np.intp],
    target: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Lower and upper bracket in ln a of each root of y = `target`, and a first guess.

    `y` (sets, nodes) are the travels at the nodes, `end` and `start` ln a and y at pull-off, (sets,), and `which`
    the set of each target.
    """
    upper = np.empty(target.size, dtype=np.intp)
    edges = np.searchsorted(which, np.arange(y.shape[0] + 1))
    for row, (first, last) in enumerate(pairwise(edges.tolist())):
        least = int(np.searchsorted(grid, end[row], side="right"))
        upper[first:last] = least + np.searchsorted(y[row, least:-1], target[first:last])
    below = np.maximum(upper - 1, 0)
    at_end = grid[below] <= end[which]
    low = np.where(at_end, end[which], grid[below])
    y_low, y_high = np.where(at_end, start[which], y[which, below]), y[which, upper]
    share = (target - y_low) / (y_high - y_low)
    return (
        low,
        grid[upper],
        low + (grid[upper] - low) * np.where(at_end, np.sqrt(np.maximum(share, 0.0)), share),
    )


def _roots(
    sets: _Sets, target: FloatArray, brackets: tuple[FloatArray, FloatArray, FloatArray]
) -> FloatArray:
    """ln a at which each set's travel is `target`, by Newton's method within brackets."""
    low, high, x = brackets
    for _ in range(_STEPS):
        value, slope = sets.travel(x)
        over = value > target
        low, high = np.where(over, low, x), np.where(over, x, high)
        trial = x - np.divide(value - target, slope, out=np.full_like(x, np.inf), where=slope > 0.0)
        new = np.where((trial >= low) & (trial <= high), trial, 0.5 * (low + high))
        settled = bool((np.abs(new - x) <= _CLOSE).all())
        x = new
        if settled:
            break
    return x
