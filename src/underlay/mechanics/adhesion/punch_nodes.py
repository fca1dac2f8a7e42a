"""Tables of what adhesion needs of the elastic contact, over ln a and over one ratio of moduli.

Over ln a: cubics of the logarithms of the four functions that have their values and slopes at the nodes. The
slopes are exact: dP_el/da = K dw_el/da and d(a kappa)/da = g(1)^2. With 20 nodes to an octave the error is below
1e-8, held by a test.

Over the logarithm of a ratio of moduli: polynomials at the points of Chebyshev in spans of ln 4. The functions are
analytic in ln k with their nearest poles at Im ln k = pi (see `curve_family`): each point gains a factor of 9.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Self

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.mechanics.adhesion.radius_relation import RadiusRelation, solve_relation
from underlay.mechanics.contact import Contact

__all__ = ["Columns", "PunchNodes", "Quantity", "Span"]

_OCTAVES, _PER_OCTAVE = 12, 20
# Spans of the ratio, with edges at no round number; at 11 points the polynomial is good to 9^-11 = 3e-11.
_SPAN, _EDGE, _POINTS = float(np.log(4.0)), float(np.log(1.37)), 11


class Quantity(IntEnum):
    """The four functions of the radius."""

    DEPTH = 0
    PULL = 1
    FORCE = 2
    STIFFNESS = 3


@dataclass(frozen=True)
class PunchNodes:
    """The four functions over ln a for one or several bodies.

    Parameters
    ----------
    log_radius : ndarray (nodes,)
        ln a, evenly.
    cubics : ndarray (4, 4, bodies, nodes - 1)
        For each function the coefficients of 1, t, t^2, t^3 of its logarithm, with t from 0 to 1 in each interval.
    """

    log_radius: FloatArray
    cubics: FloatArray

    @classmethod
    def of(cls, relation: RadiusRelation, end: float) -> Self:
        """Tabulate one relation from `end` (m) inwards."""
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
        """Between two nodes, in ln a."""
        return float(self.log_radius[1] - self.log_radius[0])


class Columns:
    """The four functions at given ln a.

    Parameters
    ----------
    nodes : PunchNodes
        The tables.
    table : ndarray of int
        Which body, for each entry of `log_radius`.
    log_radius : ndarray
        ln a.
    """

    def __init__(self, nodes: PunchNodes, table: NDArray[np.intp], log_radius: FloatArray) -> None:
        place = (log_radius - nodes.log_radius[0]) / nodes.step
        cells = nodes.log_radius.size - 1
        cell = np.minimum(place.astype(np.intp), cells - 1)
        self._nodes, self._t, self._place = nodes, place - cell, cell + cells * table

    def at(self, which: Quantity) -> tuple[FloatArray, FloatArray]:
        """One of the four and its derivative in ln a."""
        t = self._t
        one, two, three, four = (np.take(row, self._place) for row in self._nodes.cubics[which])
        value = np.exp(one + t * (two + t * (three + t * four)))
        return value, value * ((two + t * (2.0 * three + 3.0 * t * four)) / self._nodes.step)


@dataclass(frozen=True)
class Span:
    """Tables up to one radius, of a fixed body or at the Chebyshev points of a span of the ratio.

    Parameters
    ----------
    points : tuple of PunchNodes
        One, or one at each point of the ratio.
    middle : float
        Of the span, in ln k.
    """

    points: tuple[PunchNodes, ...]
    middle: float = 0.0

    @staticmethod
    def numbers(sets: int, ratio: FloatArray | None) -> NDArray[np.intp]:
        """Numbers of the spans that ratios (sets,) belong to; zero where there is none."""
        if ratio is None:
            return np.zeros(sets, dtype=np.intp)
        return np.floor((np.log(ratio) - _EDGE) / _SPAN).astype(np.intp)

    @classmethod
    def solve(
        cls, contact_at: Callable[[float], Contact], end: float, rtol: float, number: int | None
    ) -> Self | None:
        """Solve up to the radius `end` (m), for the span of this number or a fixed body; None where it cannot."""
        middle = 0.0 if number is None else _EDGE + (number + 0.5) * _SPAN
        places = np.zeros(1) if number is None else _chebyshev(_POINTS)
        try:
            contacts = [contact_at(float(np.exp(middle + 0.5 * _SPAN * place))) for place in places]
            relations = [solve_relation(contact, end, rtol) for contact in contacts]
        except InputError:
            return None
        return cls(tuple(PunchNodes.of(relation, end) for relation in relations), middle)

    def nodes(self, sets: int, ratio: FloatArray | None) -> tuple[PunchNodes, NDArray[np.intp]]:
        """Tables of `sets` sets, and which of them each set has."""
        first = self.points[0]
        if ratio is None:
            return first, np.zeros(sets, dtype=np.intp)
        weights = _weights(2.0 * (np.log(ratio) - self.middle) / _SPAN, _chebyshev(len(self.points)))
        # Sums in a fixed order: a set's table does not depend on how many there are.
        cubics = np.zeros((*first.cubics.shape[:2], sets, first.cubics.shape[-1]))
        for weight, point in zip(weights.T, self.points, strict=True):
            cubics += weight[:, None] * point.cubics
        return PunchNodes(first.log_radius, cubics), np.arange(sets)


def _chebyshev(count: int) -> FloatArray:
    """Points of Chebyshev in (-1, 1)."""
    return np.cos(np.pi * (np.arange(count) + 0.5) / count)


def _weights(x: FloatArray, points: FloatArray) -> FloatArray:
    """Weights of Lagrange's polynomials, (x, points): products, which are exact at the points too."""
    differences = x[:, None] - points
    weights = np.ones((x.size, points.size))
    for column, point in enumerate(points):
        for other, apart in enumerate(points):
            if other != column:
                weights[:, column] *= differences[:, other] / (point - apart)
    return weights
