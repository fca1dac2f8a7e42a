"""Master curves of a sphere or a measured tip, for many contacts at once, from tables of the flat punch.

The solution of `punch_solution` does not depend on the shape. With Poisson's ratios fixed it depends on eps = a/h
and on one ratio k of the body, analytically on both; so it is held at the nodes r/a as Chebyshev polynomials in a
stretched eps and in ln k, and the curve of a sphere or of a measured tip costs its contraction with the shape. What
is interpolated has no dimension and is of order one, however wide the contact:

    ln kappa, ln g(1), g/kappa, rho/g(1),     kappa = int_0^1 g dx,  g(1) = 1 + int_0^1 rho dx,

with g and rho the flat punch's solution and resolvent row of `punch_solution`. The radii are placed where the tip's
power law (`Indenter.power_law`) would have them, by a table of that law's own contact radius; there the flat punch
is read off its table and contracted with the shape. Truncation errors are estimated as in `contact_problem`. Cells
and store are those of `curve_family`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray, read_only
from underlay.errors import InputError
from underlay.mechanics.exact.batch import CurveBatch, curves_through
from underlay.mechanics.exact.contact_problem import LARGEST_EPS, SHARE_OF_NODES, UNEVEN, contact_factors
from underlay.mechanics.exact.curve_family import (
    Cell,
    curve_family,
    first_ratios,
    range_end,
    range_number,
    ratio_span,
    solved_alone,
)
from underlay.mechanics.exact.master_curve import (
    MOST_IN_POWERS,
    Factor,
    Stretch,
    chebyshev_angles,
    chebyshev_coefficients,
    chebyshev_values,
    monomials,
    polynomial,
    reach,
    truncation_error,
)
from underlay.mechanics.exact.nodes import (
    TABLES,
    EvenRule,
    Resolution,
    curve_terms,
    even_legendre,
    even_rule,
    series_terms,
)
from underlay.mechanics.exact.punch_solution import PunchGrid, PunchSolution, proved_resolution
from underlay.mechanics.indenters import Indenter
from underlay.mechanics.kernel import Family, Kernel, Scales

# Of the share of an error that a solution's nodes may take: what either interpolation leaves out. What the nodes
# themselves leave out is rough in eps, and beyond a/h = 5 a series does not end above it: at 0.4 of the tolerance
# there was no table, after 1 s of trying; at 0.005 there are, but for soft bases; at 0.0005, with 7 % more nodes,
# also for a base a thirtieth as stiff as the layer up to a/h = 20.
_SHARE_OF_SOLUTION, _SHARE_OF_RATIO, _SHARE_OF_RADIUS = 0.0005, 0.3, 0.3
_MOST_RATIOS, _MOST_RADII = 24, 96
_NARROW = 4.0  # a/h: narrower contacts take so few nodes that sorting them gains nothing
_FINER = 0.03  # of the tolerance of the widest: where nodes change the solution jumps by what they leave out
# What a series leaves out is read off its last four coefficients.
_FEWEST_TERMS = 4
# No further than this share of the end of the shape: there the solution of each contact knows better; and nearly
# to where nothing is solved for: searches stand at that edge.
_SHARE_OF_SHAPE, _SHARE_OF_EPS = 0.97, 1.0 - 1e-6
_PLACED = 1e-2  # the radii are placed as well as this
# The radii are placed this much wider than the power law would have them: too near a curve would end too soon.
_WIDER = 1.03
_MORE_TERMS = 4  # where an estimate says that a curve is too coarse
# A sphere's contact ten thicknesses wide takes 28 at 1e-6; beside a solution of its own they cost next to nothing.
_MOST_TERMS = MOST_IN_POWERS
# On a softer base a curve that should take more than these errs by too much with the most there may be, and to find
# that out takes a table. On others it may also be too wide, which the tables say sooner than a solution.
_HOPELESS = _MOST_TERMS + _MORE_TERMS
_RANGES_BELOW = 5
# Of ln k and ln h: a difference of polynomials, whose truncation is 1e-7 of the derivative and rounding 1e-9.
_STEP = 1e-7
# A contact, one a step further in ln k, and one in ln h.
_SHIFTS = _STEP * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])


class PunchCell(NamedTuple):
    """Key of one table of the flat punch: the bodies, the ranges of ratio and contact radius, and the accuracy.

    Parameters
    ----------
    family : Family
        The bodies, which differ in one ratio k.
    ratio : int or None
        Number of the range of ln k (`ratio_span`); None for a family with a single member.
    range : int
        Number of the range of eps = a/h (`range_end`).
    rtol : float
        Relative error asked for.
    """

    family: Family
    ratio: int | None
    range: int
    rtol: float

    @property
    def top(self) -> float:
        """Largest a/h of the cell."""
        return min(range_end(self.range), LARGEST_EPS)


@dataclass(frozen=True)
class PunchFamily:
    """The flat punch's solution against contact radius a/h and the ratio k of the bodies, over one cell.

    kappa is the flat punch's stiffness over that on a half-space.

    k is the ratio in which the bodies of the family differ.

    Parameters
    ----------
    cell : PunchCell
        Bodies and ranges for which the table holds.
    rule : EvenRule
        Nodes r/a and weights.
    resolution : Resolution
        Nodes of the solutions behind it.
    stretch : Stretch
        The variable ln(1 + rate a/h) of the polynomials.
    coefficients : ndarray (ratio terms, radius terms, 2 + 2 nodes)
        Of ln kappa, ln g(1), g/kappa and rho/g(1) (module's head): in powers of the variable of `RatioSpan`, and in
        Chebyshev polynomials of the stretched a/h.
    """

    cell: PunchCell
    rule: EvenRule
    resolution: Resolution
    stretch: Stretch
    coefficients: FloatArray

    def at(self, log_ratios: FloatArray, eps: FloatArray) -> PunchSolution:
        """Solution on bodies of ratios ln k (...,), at contact radii over thickness `eps` (..., radii).

        k is the ratio in which the bodies of the family differ.
        """
        terms, radii, columns = self.coefficients.shape
        if terms > 1 and self.cell.ratio is not None:
            place = ratio_span(self.cell.ratio).place(log_ratios)
            flat = place[..., None] ** np.arange(terms) @ self.coefficients.reshape(terms, -1)
            table = flat.reshape(*place.shape, radii, columns)
        else:
            table = self.coefficients[0]
        values = chebyshev_values(self.stretch.z(eps), radii) @ table
        kappa, edge = np.exp(values[..., 0]), np.exp(values[..., 1])
        count = self.rule.nodes.size
        g, rho = values[..., 2 : 2 + count], values[..., 2 + count :]
        return PunchSolution(eps, self.rule, g * kappa[..., None], rho * edge[..., None], kappa)


def punch_family(cell: PunchCell) -> PunchFamily | None:
    """Table of one cell, cached; None where it would take too many terms, or no such body is possible."""
    return TABLES.get(("punch", cell), lambda: _tabulated(cell))


def _tabulated(cell: PunchCell) -> PunchFamily | None:
    share = SHARE_OF_NODES * cell.rtol
    try:
        return _expanded(cell, share, 1 if cell.ratio is None else _first_ratios(cell, share))
    except InputError:
        return None


def _first_ratios(cell: PunchCell, share: float) -> int:
    """Number of ratios k to solve at first; fewer on far stiffer bases.

    These differ from a rigid one by about eps/k, eps = a/h.
    """
    changed = min(4.0 * cell.top / float(np.exp(ratio_span(cell.ratio or 0).low)), 1.0)
    return max(first_ratios(_SHARE_OF_RATIO * share / changed), _FEWEST_TERMS)


def _expanded(cell: PunchCell, share: float, ratios: int) -> PunchFamily | None:
    """Solve at Chebyshev points in ln k and in a/h, and expand, with more points where needed; None if too many.

    `share` is the absolute error allowed, `ratios` the number of points in ln k.

    k is the ratio in which the bodies of the family differ.
    """
    angles = chebyshev_angles(ratios)
    span = ratio_span(cell.ratio or 0)
    bodies = [cell.family.kernel(ratio) for ratio in span.ratios(np.cos(angles)).tolist()]
    middle = bodies[ratios // 2].scales
    hardest, resolution = _demanding(bodies, cell.top, cell.rtol)
    stretch = Stretch.to(cell.top, middle.softness)
    radii = max(series_terms(middle, cell.top, share), _FEWEST_TERMS)
    while True:
        eps_angles = chebyshev_angles(radii)
        groups = _groups(bodies, stretch.v(np.cos(eps_angles)), resolution, cell.rtol)
        # One body tells whether these radii are enough before all are solved for.
        first = chebyshev_coefficients(_table_values(bodies[hardest], groups), eps_angles)
        if truncation_error(first) <= _SHARE_OF_RADIUS * share:
            values = np.stack([_table_values(body, groups) for body in bodies])
            by_radius = np.stack([chebyshev_coefficients(own, eps_angles) for own in values])
            if truncation_error(np.moveaxis(by_radius, 1, 0).reshape(radii, -1)) <= _SHARE_OF_RADIUS * share:
                break
        radii += radii // 4
        if radii > _MOST_RADII:
            return None
    table = by_radius
    if ratios > 1:
        by_ratio = chebyshev_coefficients(values.reshape(ratios, -1), angles)
        if truncation_error(by_ratio) > _SHARE_OF_RATIO * share:
            return None if 2 * ratios > _MOST_RATIOS else _expanded(cell, share, ratios + ratios // 2)
        terms = chebyshev_coefficients(by_radius.reshape(ratios, -1), angles).reshape(by_radius.shape)
        table = np.tensordot(monomials(ratios).T, terms, 1)
    return PunchFamily(
        cell, even_rule(resolution.radial), resolution, stretch, read_only(np.ascontiguousarray(table))
    )


class _Group(NamedTuple):
    """Contact radii that share nodes, and the matrix from values at these to those at the finest nodes."""

    grid: PunchGrid
    spread: FloatArray


def _demanding(bodies: list[Kernel], top: float, rtol: float) -> tuple[int, Resolution]:
    """Index of the body, the first or the last (-1), that needs more nodes for a/h up to `top`, and its nodes."""
    ends = [(number, proved_resolution(bodies[number], top, _SHARE_OF_SOLUTION * rtol)) for number in (0, -1)]
    return max(ends, key=lambda end: (end[1].radial, end[1].wavenumbers))


def _groups(bodies: list[Kernel], eps: FloatArray, widest: Resolution, rtol: float) -> list[_Group]:
    """Split increasing radii a/h into groups with fewer nodes for narrower contacts, which saves time.

    `widest` has the node counts for the largest of `eps`.
    """
    nodes = even_rule(widest.radial).nodes
    groups, end, resolution = [], eps.size, widest
    while end:
        narrower = 0.5 * float(eps[end - 1])
        start = int(np.searchsorted(eps, narrower)) if narrower > _NARROW else 0
        own, rule = eps[start:end], even_rule(resolution.radial)
        spread = (even_legendre(nodes, resolution.radial) @ rule.projection).T
        groups.append(_Group(PunchGrid.of(own, resolution), spread))
        end, resolution = start, _demanding(bodies, narrower, _FINER * rtol)[1]
    return groups[::-1]


def _table_values(body: Kernel, groups: list[_Group]) -> FloatArray:
    """The interpolated quantities ln kappa, ln g(1), g/kappa, rho/g(1) of one body, (radii, 2 + 2 nodes).

    kappa is the flat punch's stiffness over that on a half-space.

    k is the ratio in which the bodies of the family differ.
    """
    return np.concatenate([_table_values_of(body, group) for group in groups])


def _table_values_of(body: Kernel, group: _Group) -> FloatArray:
    punch = group.grid.solve(body.values(group.grid.u))
    edge = 1.0 + punch.rho @ punch.rule.weights
    kappa = punch.kappa[:, None]
    return np.concatenate(
        (
            np.log(kappa),
            np.log(edge)[:, None],
            punch.g / kappa @ group.spread,
            punch.rho / edge[:, None] @ group.spread,
        ),
        axis=1,
    )


class TipContacts(NamedTuple):
    """Contacts of one tip on bodies whose ratios lie in one range, to depths in one range.

    Parameters
    ----------
    tip : Indenter
        Scaled to its own unit of length.
    family : Family
        The bodies, which differ in one ratio k.
    span : int or None
        Number of the range of ln k (`ratio_span`); None for a family with a single member.
    octave : int
        Number of the range of varpi (half-space contact radius over thickness) of the table that places the radii.
    rtol : float
        Relative error asked for.
    log_ratio, thickness, top : ndarray (sets,)
        ln k, the thickness in the tip's unit, and the largest varpi.
    """

    tip: Indenter
    family: Family
    span: int | None
    octave: int
    rtol: float
    log_ratio: FloatArray
    thickness: FloatArray
    top: FloatArray

    def part(self, rows: NDArray[np.intp]) -> TipContacts:
        """Contacts of the given row numbers."""
        return self._replace(
            log_ratio=self.log_ratio[rows], thickness=self.thickness[rows], top=self.top[rows]
        )


class TipCurves(NamedTuple):
    """Master curves of some contacts, the nodes behind them, and the largest a/h of each (sets,).

    The derivatives in `batch.slopes` are those of ln P at fixed depth in ln k, k the ratio of the bodies, and in
    ln(thickness).
    """

    batch: CurveBatch
    resolution: Resolution
    eps: FloatArray


def tip_curves(asked: TipContacts) -> Iterator[tuple[NDArray[np.intp], TipCurves]]:
    """Iterate over (row numbers of contacts, their curves) for the contacts that the tables cover.

    A contact whose curve was too coarse comes again with a finer one. Where the range of a contact goes beyond the
    tip's shape its curve ends there.
    """
    rows, exponent = np.arange(asked.top.size), asked.tip.power_law.exponent
    scales = _scales(asked)
    terms = curve_terms(scales, range_end(asked.octave), exponent, asked.rtol / UNEVEN)
    if scales.softness > 0.0 and terms > _HOPELESS:
        return
    terms = min(terms, _MOST_TERMS)
    while rows.size and terms <= _MOST_TERMS:
        part = asked.part(rows)
        placing = _placing(part, exponent)
        if placing is None:
            return
        eps = _within_shape(part, placing, terms)
        terms = eps.shape[1] + _MORE_TERMS
        numbers = np.array([range_number(last) for last in eps[:, -1].tolist()])
        coarse = np.zeros(rows.size, dtype=bool)
        for number in sorted(set(numbers[eps[:, -1] <= LARGEST_EPS].tolist())):
            here = np.flatnonzero(numbers == number)
            found = _contracted(part.part(here), eps[here], placing.stretch, number)
            if found is not None:
                coarse[here] = ~(found.batch.error_estimate <= asked.rtol)
                yield rows[here], found
        rows = rows[coarse]


class _Placing(NamedTuple):
    """Table by which contact radii are placed: ln(a/a_half) of the tip's power law against varpi.

    `radius` (ratio terms, rows, 4) is in powers of the variable of `RatioSpan`, and of z, as in `CurveFamily`.

    varpi is the half-space contact radius at the depth over the thickness.
    """

    stretch: Stretch
    radius: FloatArray

    def table(self, asked: TipContacts) -> FloatArray:
        """Polynomials in z for ln(a/a_half) of the contacts, (sets, rows, 4), or (1, rows, 4) for all."""
        if asked.span is None or len(self.radius) == 1:
            return self.radius[:1]
        place = ratio_span(asked.span).place(asked.log_ratio)[:, None, None]
        # Horner's rule, not a product of matrices: that rounds otherwise for more contacts than for one.
        table = np.broadcast_to(self.radius[-1], (len(place), *self.radius.shape[1:]))
        for term in self.radius[-2::-1]:
            table = table * place + term
        return table


def _scales(asked: TipContacts) -> Scales:
    """Scales (decay rates, stiffness ratios) of the body in the middle of the range of ratios."""
    family, span = asked.family, asked.span
    middle = 1.0 if span is None else ratio_span(span).middle
    return TABLES.get(("scales", family, span), lambda: family.kernel(middle).scales)


def _within_shape(asked: TipContacts, placing: _Placing, count: int) -> FloatArray:
    """Contact radii a/h (sets, count), up to the end of the contact's range, of the tip's shape or of a/h = 20."""
    tops = asked.top.copy()
    shape = asked.tip.max_radius / asked.thickness
    end = np.minimum(_SHARE_OF_SHAPE * shape, _SHARE_OF_EPS * LARGEST_EPS)
    farthest = np.minimum(0.5 * (1.0 + _SHARE_OF_SHAPE) * shape, LARGEST_EPS)
    varpi, eps = _radii(asked, placing, tops, count)
    # Radii beyond the shape lie at its end: between few of them a straight line leaves the last too far out.
    while (beyond := eps[:, -1] > farthest).any():
        for row in np.flatnonzero(beyond).tolist():
            tops[row] = np.interp(end[row], eps[row], varpi[row])
        varpi, eps = _radii(asked, placing, tops, count)
    return eps


def _radii(
    asked: TipContacts, placing: _Placing, tops: FloatArray, count: int
) -> tuple[FloatArray, FloatArray]:
    """varpi and a/h at `count` points of curves up to varpi = `tops` (sets,), each (sets, count).

    varpi is the half-space contact radius at the depth over the thickness.
    """
    measure, stretch = asked.tip.power_law, placing.stretch
    points = np.cos(chebyshev_angles(count))
    # The last point lies at the end itself, wherever the shape leaves the others.
    ends = reach(count) * stretch.over(tops[:, None]).length
    varpi = Stretch(ends, stretch.rate).v(points)
    # Beyond the end of what places them a contact so wide grows as the power law's: its factor stays.
    factor = polynomial(placing.table(asked), np.minimum(stretch.z(varpi), 1.0))
    chi = _WIDER * varpi * np.exp(factor)
    thickness = asked.thickness[:, None]
    deepest = asked.tip.abel(np.array(asked.tip.max_radius))
    lengths = asked.tip.halfspace_radius(np.minimum(measure.abel(chi * thickness), deepest))
    return varpi, np.minimum(lengths, asked.tip.max_radius) / thickness


def _placing(asked: TipContacts, exponent: float) -> _Placing | None:
    """Table that places radii up to the end of the range of depths, or of a lower one if there is none."""
    made = _on_one_body if asked.span is None else _on_a_family
    for octave in range(asked.octave, asked.octave - _RANGES_BELOW, -1):
        key = ("placing", exponent, asked.family, asked.span, octave)
        found = TABLES.get(key, partial(made, asked._replace(octave=octave), exponent))
        if found is not None:
            return found
    return None


def _on_a_family(asked: TipContacts, exponent: float) -> _Placing | None:
    cell = Cell(exponent, asked.family, asked.span or 0, asked.octave, _PLACED)
    table = curve_family(cell)
    if table is None or len(table.edges) > 2:
        return None
    return _Placing(table.stretch, table.coefficients[:, 0, Factor.RADIUS])


def _on_one_body(asked: TipContacts, exponent: float) -> _Placing | None:
    found = solved_alone(exponent, asked.family, 1.0, asked.octave, _PLACED)
    if found is None:
        return None
    return _Placing(found.curve.stretch, found.curve.coefficients[:1, Factor.RADIUS])


def _contracted(asked: TipContacts, eps: FloatArray, stretch: Stretch, number: int) -> TipCurves | None:
    """Master curves from the flat punch's table at radii eps = a/h (sets, radii); None without a table.

    `stretch` gives the rate of the curves' variable, `number` the range of a/h of the table.
    """
    table = punch_family(PunchCell(asked.family, asked.span, number, asked.rtol))
    if table is None:
        return None
    measure = asked.tip.power_law
    # Beside each contact one of the same radius on a layer a step further in ln k, and in ln h.
    punch = table.at(asked.log_ratio[:, None] + _SHIFTS[:, 0], eps[:, None] * np.exp(-_SHIFTS[:, 1])[:, None])
    thickness = asked.thickness[:, None, None]
    varpi, logarithms = contact_factors(
        punch, asked.tip, measure, thickness * np.exp(_SHIFTS[:, 1:]), eps[:, None] * thickness
    )
    varpi, factors = varpi[:, 0], logarithms[:, 0]
    slopes = _slopes(measure.exponent, factors, (logarithms[:, 1:] - logarithms[:, :1]) / _STEP)
    # The last radius may fall short of its range: the curve ends where its points do.
    tops = np.minimum(asked.top, varpi[:, -1])
    batch = curves_through(measure, varpi, np.concatenate((factors, slopes), axis=2), tops, stretch)
    errors = SHARE_OF_NODES * asked.rtol + UNEVEN * batch.error_estimate
    return TipCurves(replace(batch, error_estimate=errors), table.resolution, eps[:, -1])


def _slopes(exponent: float, factors: FloatArray, moved: FloatArray) -> FloatArray:
    """Derivatives d ln P/ds at fixed depth (sets, radii, numbers), from those at fixed contact radius.

    `factors` are the logarithms of the three factors (sets, radii, 3), and `moved`, (sets, numbers, radii, 3),
    their derivatives in each number s at one contact radius. There depth and force go as a_half^exponent and a_half
    w times their factors, a_half the half-space contact radius.
    """
    excess = factors[..., Factor.RADIUS] + factors[..., Factor.STIFFNESS] - factors[..., Factor.FORCE]
    through_depth = (exponent + 1.0) * np.expm1(excess)[:, None] * moved[..., Factor.RADIUS]
    return np.asarray((moved[..., Factor.FORCE] + through_depth).swapaxes(1, 2))
