"""Master curves of a sphere or a measured tip off the tables of the flat punch, for many contacts at once.

The radii are placed where the tip's power law (`depth_measure`) would have them, by a table of that law's own
contact radius; there the flat punch is read off its table and contracted with the shape. What a curve leaves out is
estimated as where it is solved for (`contact_curve`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import RangeError
from underlay.mechanics.exact.contact_curve import SHARE_OF_NODES, known_curve
from underlay.mechanics.exact.contact_problem import (
    LARGEST_EPS,
    UNEVEN,
    ContactProblem,
    contact_factors,
    depth_measure,
)
from underlay.mechanics.exact.curve_batch import CurveBatch, curves_through
from underlay.mechanics.exact.curve_family import Cell, curve_family, range_end, range_number, ratio_span
from underlay.mechanics.exact.master_curve import (
    MOST_IN_POWERS,
    Factor,
    Stretch,
    chebyshev_angles,
    polynomial,
    reach,
)
from underlay.mechanics.exact.nodes import Resolution, curve_terms
from underlay.mechanics.exact.punch_family import PunchCell, punch_family
from underlay.mechanics.exact.tables import TABLES
from underlay.mechanics.indenters import Indenter, PowerLaw
from underlay.mechanics.kernel import Family, Scales

__all__ = ["TipContacts", "TipCurves", "tip_curves"]

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
_BESIDE = _STEP * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])


class TipContacts(NamedTuple):
    """Contacts of one tip on bodies of one span of a family, and of one range.

    Parameters
    ----------
    tip : Indenter
        In a unit of its own.
    family : Family
        The bodies.
    span : int or None
        Number of the span in ln k; None for a family of one.
    octave : int
        Number of the range of varpi of the table that places the radii.
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
        """Some of them."""
        return self._replace(
            log_ratio=self.log_ratio[rows], thickness=self.thickness[rows], top=self.top[rows]
        )


class TipCurves(NamedTuple):
    """Curves of some contacts, what they were read off, the radii of each, and the largest a/h (sets,).

    Their slopes are those in ln k, k the ratio of the bodies, and in the logarithm of the thickness.
    """

    batch: CurveBatch
    resolution: Resolution
    radii: int
    eps: FloatArray


def tip_curves(asked: TipContacts) -> Iterator[tuple[NDArray[np.intp], TipCurves]]:
    """Curves of the contacts that the tables reach, with the rows that they are of; a later one is finer.

    Where the range of a contact goes beyond the shape its curve ends there.
    """
    rows, exponent = np.arange(asked.top.size), depth_measure(asked.tip).exponent
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
            found = _contracted(part.part(here), eps[here], placing.stretch.softness, number)
            if found is not None:
                coarse[here] = ~(found.batch.error_estimate <= asked.rtol)
                yield rows[here], found
        rows = rows[coarse]


class _Placing(NamedTuple):
    """What places the radii: ln(a/a_half) against varpi.

    `radius` (ratio terms, rows, 4) is in powers of the place of ln k in the span, and of z, as in `CurveFamily`.
    """

    stretch: Stretch
    radius: FloatArray

    def table(self, asked: TipContacts) -> FloatArray:
        """Polynomials in z (sets or 1, rows, 4) of the contacts."""
        if asked.span is None or len(self.radius) == 1:
            return self.radius[:1]
        place = ratio_span(asked.span).place(asked.log_ratio)[:, None, None]
        # Horner's rule, not a product of matrices: that rounds otherwise for more contacts than for one.
        table = np.broadcast_to(self.radius[-1], (len(place), *self.radius.shape[1:]))
        for term in self.radius[-2::-1]:
            table = table * place + term
        return table


def _scales(asked: TipContacts) -> Scales:
    """Scales of a body in the middle of the span."""
    family, span = asked.family, asked.span
    middle = 1.0 if span is None else ratio_span(span).middle
    return TABLES.get(("scales", family, span), lambda: family.kernel(middle).scales)


def _within_shape(asked: TipContacts, placing: _Placing, count: int) -> FloatArray:
    """Radii a/h (sets, count) of curves up to the end of their range, of the shape or of what is solved for."""
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
    """Varpi and a/h at the radii of curves up to `tops` (sets,), each (sets, count)."""
    measure, stretch = depth_measure(asked.tip), placing.stretch
    points = np.cos(chebyshev_angles(count))
    # The last point lies at the end itself, wherever the shape leaves the others.
    ends = [reach(count) * Stretch.to(top, stretch.softness).length for top in tops.tolist()]
    varpi = np.stack([Stretch(end, stretch.softness).v(points) for end in ends])
    # Beyond the end of what places them a contact so wide grows as the power law's: its factor stays.
    factor = polynomial(placing.table(asked), np.minimum(stretch.z(varpi), 1.0))
    chi = _WIDER * varpi * np.exp(factor)
    thickness = asked.thickness[:, None]
    deepest = asked.tip.abel(np.array(asked.tip.max_radius))
    lengths = asked.tip.halfspace_radius(np.minimum(measure.abel(chi * thickness), deepest))
    return varpi, np.minimum(lengths, asked.tip.max_radius) / thickness


def _placing(asked: TipContacts, exponent: float) -> _Placing | None:
    """What places radii up to the end of the range, or of one below: the laws may end before this does."""
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
    problem = ContactProblem.of(PowerLaw(exponent, 1.0), 1.0, asked.family.kernel(1.0))
    try:
        curve = known_curve(problem, range_end(asked.octave), _PLACED).curve
    except RangeError:
        return None
    return _Placing(curve.stretch, curve.coefficients[:1, Factor.RADIUS])


def _contracted(asked: TipContacts, eps: FloatArray, softness: float, number: int) -> TipCurves | None:
    """Read the flat punch at radii eps (sets, radii) and contract it with the shape; None without a table."""
    table = punch_family(PunchCell(asked.family, asked.span, number, asked.rtol))
    if table is None:
        return None
    measure = depth_measure(asked.tip)
    # Beside each contact one of the same radius on a layer a step further in ln k, and in ln h.
    punch = table.at(asked.log_ratio[:, None] + _BESIDE[:, 0], eps[:, None] * np.exp(-_BESIDE[:, 1])[:, None])
    thickness = asked.thickness[:, None, None]
    varpi, logarithms = contact_factors(
        punch, asked.tip, measure, thickness * np.exp(_BESIDE[:, 1:]), eps[:, None] * thickness
    )
    varpi, factors = varpi[:, 0], logarithms[:, 0]
    slopes = _slopes(measure.exponent, factors, (logarithms[:, 1:] - logarithms[:, :1]) / _STEP)
    # The last radius may fall short of its range: the curve ends where its points do.
    tops = np.minimum(asked.top, varpi[:, -1])
    batch = curves_through(measure, varpi, np.concatenate((factors, slopes), axis=2), tops, softness)
    errors = SHARE_OF_NODES * asked.rtol + UNEVEN * batch.error_estimate
    return TipCurves(replace(batch, error_estimate=errors), table.resolution, eps.shape[1], eps[:, -1])


def _slopes(exponent: float, factors: FloatArray, moved: FloatArray) -> FloatArray:
    """d ln P/ds at fixed depth (sets, radii, numbers).

    From the logarithms of the factors (sets, radii, 3) and how these move with each number at one contact radius,
    (sets, numbers, radii, 3): there depth and force go as a_half^exponent and a_half w times their factors.
    """
    excess = factors[..., Factor.RADIUS] + factors[..., Factor.STIFFNESS] - factors[..., Factor.FORCE]
    through_depth = (exponent + 1.0) * np.expm1(excess)[:, None] * moved[..., Factor.RADIUS]
    return np.asarray((moved[..., Factor.FORCE] + through_depth).swapaxes(1, 2))
