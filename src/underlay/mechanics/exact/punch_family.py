"""The flat punch on bodies that differ in one ratio, tabulated over the contact radius: it serves every tip.

The solution of `punch_solution` does not know the shape. With Poisson's ratios fixed it depends on eps = a/h and
on one ratio k of the body, analytically on both; so it is held at the nodes r/a as Chebyshev polynomials in a
stretched eps and in ln k, and the curve of a sphere or of a measured tip costs its contraction with the shape
(`tip_law`). What is interpolated has no dimension and is of order one, however wide the contact:

    ln kappa, ln g(1), g/kappa, rho/g(1),     kappa = int_0^1 g dx,  g(1) = 1 + int_0^1 rho dx.

Cells and store are those of `curve_family`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from underlay._arrays import FloatArray, read_only
from underlay.errors import InputError
from underlay.mechanics.exact.contact_curve import SHARE_OF_NODES
from underlay.mechanics.exact.contact_problem import LARGEST_EPS
from underlay.mechanics.exact.curve_family import first_ratios, range_end, ratio_span
from underlay.mechanics.exact.gauss import EvenRule, even_legendre, even_rule
from underlay.mechanics.exact.master_curve import (
    Stretch,
    chebyshev_angles,
    chebyshev_coefficients,
    monomials,
    truncation_error,
)
from underlay.mechanics.exact.nodes import Resolution, series_terms
from underlay.mechanics.exact.punch_solution import PunchSolution, cosines, proved_resolution
from underlay.mechanics.exact.tables import TABLES
from underlay.mechanics.kernel import Family, Kernel

__all__ = ["PunchCell", "PunchFamily", "punch_family"]

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


class PunchCell(NamedTuple):
    """Which table.

    Parameters
    ----------
    family : Family
        The bodies.
    ratio : int or None
        Number of the span in ln k; None for a family of one.
    range : int
        Number of the span in eps.
    rtol : float
        Relative error asked for.
    """

    family: Family
    ratio: int | None
    range: int
    rtol: float

    @property
    def top(self) -> float:
        """Largest eps."""
        return min(range_end(self.range), LARGEST_EPS)


@dataclass(frozen=True)
class PunchFamily:
    """The flat punch against contact radius and ratio, over one cell.

    Parameters
    ----------
    cell : PunchCell
        Where it holds.
    rule : EvenRule
        Nodes r/a and weights.
    resolution : Resolution
        Nodes of the solutions behind it.
    stretch : Stretch
        Of eps.
    coefficients : ndarray (ratio terms, radius terms, 2 + 2 nodes)
        Of what the module's first lines name: in powers of the place of ln k in the span, and in Chebyshev
        polynomials of the stretched eps.
    """

    cell: PunchCell
    rule: EvenRule
    resolution: Resolution
    stretch: Stretch
    coefficients: FloatArray

    def at(self, log_ratios: FloatArray, eps: FloatArray) -> PunchSolution:
        """Solution on the bodies at ln k (...,), at contact radii `eps` (..., radii)."""
        terms, radii, columns = self.coefficients.shape
        if terms > 1 and self.cell.ratio is not None:
            place = ratio_span(self.cell.ratio).place(log_ratios)
            flat = place[..., None] ** np.arange(terms) @ self.coefficients.reshape(terms, -1)
            table = flat.reshape(*place.shape, radii, columns)
        else:
            table = self.coefficients[0]
        # The last radius may pass the end by rounding.
        angle = np.arccos(np.minimum(self.stretch.z(eps), 1.0))
        values = np.cos(angle[..., None] * np.arange(radii)) @ table
        kappa, edge = np.exp(values[..., 0]), np.exp(values[..., 1])
        count = self.rule.nodes.size
        g, rho = values[..., 2 : 2 + count], values[..., 2 + count :]
        return PunchSolution(eps, self.rule, g * kappa[..., None], rho * edge[..., None], kappa)


def punch_family(cell: PunchCell) -> PunchFamily | None:
    """Table of one cell; None where there is none: out of terms, or no body."""
    return TABLES.get(("punch", cell), lambda: _tabulated(cell))


def _tabulated(cell: PunchCell) -> PunchFamily | None:
    share = SHARE_OF_NODES * cell.rtol
    try:
        return _expanded(cell, share, 1 if cell.ratio is None else _first_ratios(cell, share))
    except InputError:
        return None


def _first_ratios(cell: PunchCell, share: float) -> int:
    """How many ratios to begin with: what a far stiffer base adds to a rigid one is some eps/k of the whole."""
    changed = min(4.0 * cell.top / float(np.exp(ratio_span(cell.ratio or 0).low)), 1.0)
    return max(first_ratios(_SHARE_OF_RATIO * share / changed), _FEWEST_TERMS)


def _expanded(cell: PunchCell, share: float, ratios: int) -> PunchFamily | None:
    """Solve at Chebyshev points in ln k and in eps, and expand; at more points if need be."""
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
        first = chebyshev_coefficients(_told(bodies[hardest], groups), eps_angles)
        if truncation_error(first) <= _SHARE_OF_RADIUS * share:
            values = np.stack([_told(body, groups) for body in bodies])
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
    """Contact radii (radii,) that share nodes, their `cosines`, and from values at those nodes to all nodes."""

    eps: FloatArray
    resolution: Resolution
    waves: FloatArray
    spread: FloatArray


def _demanding(bodies: list[Kernel], top: float, rtol: float) -> tuple[int, Resolution]:
    """Which body needs the most nodes for radii up to `top`, the first or the last, and these."""
    ends = [(number, proved_resolution(bodies[number], top, _SHARE_OF_SOLUTION * rtol)) for number in (0, -1)]
    return max(ends, key=lambda end: (end[1].radial, end[1].wavenumbers))


def _groups(bodies: list[Kernel], eps: FloatArray, widest: Resolution, rtol: float) -> list[_Group]:
    """Sort increasing radii by the nodes they need: half of them are far below the widest, which takes the most."""
    nodes = even_rule(widest.radial).nodes
    groups, end, resolution = [], eps.size, widest
    while end:
        narrower = 0.5 * float(eps[end - 1])
        start = int(np.searchsorted(eps, narrower)) if narrower > _NARROW else 0
        own, rule = eps[start:end], even_rule(resolution.radial)
        spread = (even_legendre(nodes, resolution.radial) @ rule.projection).T
        groups.append(_Group(own, resolution, cosines(own, resolution), spread))
        end, resolution = start, _demanding(bodies, narrower, _FINER * rtol)[1]
    return groups[::-1]


def _told(body: Kernel, groups: list[_Group]) -> FloatArray:
    """What is interpolated, (radii, 2 + 2 nodes)."""
    return np.concatenate([_told_of(body, group) for group in groups])


def _told_of(body: Kernel, group: _Group) -> FloatArray:
    punch = PunchSolution.solve(body, group.eps, group.resolution, waves=group.waves)
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
