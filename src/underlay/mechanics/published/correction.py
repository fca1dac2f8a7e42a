"""The record of a published correction: its formula, source and range, and how far off it was measured to be.

A `PublishedCorrection` turns a test (`LayerContact`: one tip, one layer thickness, two materials) into a `Factor`
that multiplies the half-space force, as a function of the size of the contact. A `Limit` is a range of a
`Quantity` of the test, and `OutOfRange` the record of a test outside one. `MeasuredError` is a table
of how far the formula is from the exact contact problem.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import product
from operator import attrgetter
from typing import Any, Self

import numpy as np
from numpy.polynomial import polynomial

from underlay._arrays import FloatArray, read_only
from underlay.errors import InputError
from underlay.mechanics.body import Material
from underlay.mechanics.halfspace import HalfspaceLaw
from underlay.mechanics.indenters import Cone, FlatPunch, Indenter, Paraboloid, Sphere

#: The three kinds of indenter the literature corrects for, and the library's indenters of each kind.
KINDS = {
    "sphere": (Paraboloid, Sphere),
    "cone": (Cone,),
    "flat punch": (FlatPunch,),
}
ELASTIC = "elastic, layer bonded"


def kind_of(indenter: Indenter) -> str | None:
    """The literature's name for the kind of `indenter` (a key of `KINDS`); None for other shapes."""
    if indenter.has_edge:
        return "flat punch"
    if indenter.opening is not None:
        return "cone"
    return None if indenter.curvature_radius is None else "sphere"


def tip_of(indenter: Indenter) -> Indenter:
    """The tip that a correction was made for: a true sphere becomes the paraboloid of its radius.

    Raises
    ------
    InputError
        If the literature has no correction for the shape.
    """
    if kind_of(indenter) is None:
        raise InputError(f'no published correction is for {indenter!r}; the solver "exact" takes every shape')
    return indenter if indenter.has_edge else indenter.power_law


@dataclass(frozen=True, kw_only=True)
class LayerContact:
    """One indenter on one layer and base, in the variables of the published corrections.

    Parameters
    ----------
    indenter : Indenter
        A paraboloid, a cone or a flat punch. Depth is measured from first contact and a cone's half-angle from
        its axis, in radians. The literature's sphere is Hertz's paraboloid.
    thickness : float
        Layer thickness h (m), finite.
    layer : Material
        Material of the layer.
    base : Material or None
        What the layer lies on; None is rigid.
    """

    indenter: Indenter
    thickness: float
    layer: Material
    base: Material | None

    @property
    def halfspace(self) -> HalfspaceLaw:
        """Law without the base: Hertz's, Sneddon's or Boussinesq's, with E/(1 - nu^2) of the layer."""
        return HalfspaceLaw(
            method="halfspace",
            reason="the layer alone, as if endlessly thick",
            max_depth=np.inf,
            error_estimate=np.inf,
            indenter=self.indenter,
            theta=self.layer.theta,
        )

    @property
    def exponent(self) -> float:
        """Exponent q of the contact size u ~ d^q: 1/2 for a sphere, 1 for a cone, 0 for a flat punch."""
        return 0.0 if self.indenter.has_edge else 1.0 / self.indenter.power_law.exponent

    def variable(self, depth: FloatArray) -> FloatArray:
        """Size of the contact relative to the layer, as in the literature; shape of `depth` d (m).

        X = sqrt(R d)/h for a sphere, y = d tan(half-angle)/h for a cone, eps = a/h for a flat punch.
        """
        radius, angle = self.indenter.curvature_radius, self.indenter.opening
        if radius is not None:
            return np.asarray(np.sqrt(radius * depth) / self.thickness)
        if angle is not None:
            return np.asarray(depth * np.tan(angle) / self.thickness)
        return np.full_like(depth, self.indenter.max_radius / self.thickness)

    def size_at(self, depth: float) -> float:
        """The contact size `variable` at one depth (m), as a float."""
        return float(self.variable(np.array([depth]))[0])

    def depth_ratio(self, depth: float) -> float:
        """Depth (m) over thickness, d/h."""
        return depth / self.thickness

    def depth_over_radius(self, depth: float) -> float:
        """Depth (m) over the radius of a sphere or punch; TypeError for a cone."""
        return depth / (self.radius_ratio * self.thickness)

    @property
    def radius_ratio(self) -> float:
        """R/h of a sphere or a/h of a punch; TypeError for a cone."""
        radius = self.indenter.max_radius if self.indenter.has_edge else self.indenter.curvature_radius
        if radius is None:
            raise TypeError("a cone has no radius")
        return radius / self.thickness

    @property
    def elastic_base(self) -> Material:
        """Material of an elastic base; TypeError if it is rigid."""
        if self.base is None:
            raise TypeError("the base is rigid")
        return self.base

    @property
    def modulus_ratio(self) -> float:
        """Young's modulus of the base over that of the layer, inf for a rigid base."""
        return np.inf if self.base is None else self.base.E / self.layer.E

    @property
    def reduced_modulus_ratio(self) -> float:
        """E/(1 - nu^2) of the base over that of the layer, inf for a rigid base."""
        return np.inf if self.base is None else self.base.theta / self.layer.theta


@dataclass(frozen=True)
class Quantity:
    """A dimensionless quantity of a test, with its name.

    Parameters
    ----------
    name : str
        Its name in messages, such as ``"R/h"``.
    attribute : str
        Where a `LayerContact` has it, such as ``"layer.nu"``; or its method that gives it at a depth.
    """

    name: str
    attribute: str

    def of(self, contact: LayerContact, max_depth: float) -> float:
        """Value in a test up to `max_depth` (m)."""
        value = attrgetter(self.attribute)(contact)
        return float(value(max_depth) if callable(value) else value)


#: The contact size that a factor depends on, by kind of indenter.
VARIABLES = {
    "sphere": Quantity("X = sqrt(R d)/h", "size_at"),
    "cone": Quantity("y = d tan(half-angle)/h", "size_at"),
    "flat punch": Quantity("eps = a/h", "size_at"),
}


LAYER_NU = Quantity("nu of the layer", "layer.nu")
DEPTH_OVER_RADIUS = Quantity("d/R", "depth_over_radius")
#: What the ranges and the measured errors of the corrections are stated in, by name.
QUANTITIES: Mapping[str, Quantity] = {
    quantity.name: quantity
    for quantity in (
        LAYER_NU,
        Quantity("nu of the base", "elastic_base.nu"),
        Quantity("E of the base over E of the layer", "modulus_ratio"),
        Quantity("R/h", "radius_ratio"),
        Quantity("d/h", "depth_ratio"),
        DEPTH_OVER_RADIUS,
    )
}


@dataclass(frozen=True)
class OutOfRange:
    """A quantity outside the range for which a correction was published or measured.

    Parameters
    ----------
    variable : str
        The quantity, e.g. ``"X = sqrt(R d)/h"`` or ``"nu of the layer"``.
    value : float
        Its value in this test, at the largest depth.
    low, high : float
        The range.
    """

    variable: str
    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.variable} is {self.value:.4g}, outside {self.low:.4g} to {self.high:.4g}"


@dataclass(frozen=True)
class Limit:
    """Allowed range of a quantity of the test."""

    quantity: Quantity
    low: float
    high: float

    def broken_by(self, contact: LayerContact, max_depth: float) -> OutOfRange | None:
        """Record of the value outside the range for a test up to `max_depth` (m); None if it is inside."""
        value = self.quantity.of(contact, max_depth)
        if self.low <= value <= self.high:
            return None
        return OutOfRange(self.quantity.name, value, self.low, self.high)


# Of a complex step: its square is lost beside any contact size.
_TINY = 1e-30


class Factor(ABC):
    """P/P_halfspace at equal depth, as a function of the dimensionless contact size u.

    u is sqrt(R d)/h, d tan(half-angle)/h or a/h; see `LayerContact.variable`.
    """

    @abstractmethod
    def value(self, u: FloatArray) -> FloatArray:
        """The factor (dimensionless) at contact sizes `u`, same shape: a formula that takes complex sizes too."""

    def slope(self, u: FloatArray) -> FloatArray:
        """Derivative of the factor with respect to u, shape of `u`, exact to rounding: Im f(u + i s)/s, s tiny.

        Squire and Trapp (1998), SIAM Review 40, 110: no difference is taken.
        """
        beside: Any = u + 1j * _TINY
        return np.asarray(np.imag(self.value(beside)) / _TINY)


@dataclass(frozen=True)
class PolynomialFactor(Factor):
    """A factor c_0 + c_1 u + c_2 u^2 + ... of the contact size u."""

    coefficients: tuple[float, ...]

    def value(self, u: FloatArray) -> FloatArray:
        """Value of the polynomial at `u`, same shape."""
        return np.asarray(polynomial.polyval(u, self.coefficients))


@dataclass(frozen=True)
class ConstantFactor(Factor):
    """A constant factor, as for a flat punch, whose a/h is the same at every depth."""

    number: float

    def value(self, u: FloatArray) -> FloatArray:
        """The constant, in the shape of `u`."""
        return np.full_like(u, self.number)


@dataclass(frozen=True, eq=False)
class MeasuredError:
    """Largest relative error of a correction's force up to a contact size, for given materials.

    Its entries are the largest |P/P_exact - 1|, in per cent, between
    zero and the contact size at the head of the column, rounded up to two digits. They were
    measured with a Nystrom solution of the Fredholm equation of the contact; the tests measure them again.

    Parameters
    ----------
    parameters : tuple of Quantity
        The material parameters that identify a row.
    nodes : tuple of ndarray
        Values of each parameter in the table, increasing.
    variable : ndarray, shape (columns,)
        Contact sizes u, increasing.
    worst : ndarray, shape (len(nodes[0]), ..., columns)
        Largest relative error between u = 0 and the column's u; inf where the formula makes no claim.
    """

    parameters: tuple[Quantity, ...]
    nodes: tuple[FloatArray, ...]
    variable: FloatArray
    worst: FloatArray

    @classmethod
    def from_table(cls, parameters: tuple[Quantity, ...], table: str) -> Self:
        """Parse a table: a first line of contact sizes, then lines of parameters followed by errors in per cent."""
        head, *lines = table.strip().splitlines()
        rows = np.array([[float(word) for word in line.split()] for line in lines])
        count = len(parameters)
        nodes = tuple(read_only(np.unique(rows[:, axis])) for axis in range(count))
        variable = np.array([float(word) for word in head.split()])
        worst = np.full((*(node.size for node in nodes), variable.size), np.nan)
        for row in rows:
            index = tuple(int(np.searchsorted(nodes[axis], row[axis])) for axis in range(count))
            worst[index] = 0.01 * row[count:]
        return cls(parameters, nodes, read_only(variable), read_only(worst))

    def up_to(self, contact: LayerContact, max_depth: float) -> float:
        """Estimated relative error of the force up to `max_depth` (m), inf outside what was measured.

        Between measured materials the worse of the neighbours is taken; between measured contact sizes the
        error is interpolated, from zero at zero.
        """
        variable = contact.size_at(max_depth)
        if variable > self.variable[-1]:
            return np.inf
        around = []
        for quantity, nodes in zip(self.parameters, self.nodes, strict=True):
            value = quantity.of(contact, max_depth)
            if not nodes[0] <= value <= nodes[-1]:
                return np.inf
            below = int(np.searchsorted(nodes, value, side="right")) - 1
            around.append((below,) if nodes[below] == value else (below, below + 1))
        # A column that holds inf may only be reached by its own interval: 0 * inf would be NaN.
        column = int(np.searchsorted(self.variable, variable))
        left = self.variable[column - 1] if column > 0 else 0.0
        share = (variable - left) / (self.variable[column] - left)
        estimates = []
        for index in product(*around):
            row = self.worst[index]
            start = float(row[column - 1]) if column > 0 else 0.0
            end = float(row[column])
            estimates.append(end if share == 1.0 or not np.isfinite(end) else start + share * (end - start))
        return max(estimates)


@dataclass(frozen=True, kw_only=True)
class PublishedCorrection:
    """One published correction for one kind of indenter.

    Parameters
    ----------
    name : str
        Name as a solver; corrections for several kinds of indenter may share one.
    indenter : str
        ``"sphere"`` (a paraboloid in every source), ``"cone"`` or ``"flat punch"``.
    substrate : str
        ``"rigid, layer bonded"``, ``"rigid, layer free to slip"`` or ``"elastic, layer bonded"``.
    equation : str
        The formula, with d the depth, h the thickness and alpha the half-angle from the axis.
    valid_range : tuple of float
        Range of `variable`.
    range_basis : str
        Where that range comes from.
    nu_range : tuple of float
        Range of the layer's Poisson's ratio.
    assumptions : tuple of str
        Assumptions of the source.
    source : str
        Author, year, journal.
    doi : str or None
        Its DOI, where confirmed.
    further_limits : tuple of Limit
        Other ranges set by the source or by the measurement of the error.
    factor : callable
        The `Factor` of a test, from its `LayerContact`.
    measured_error : MeasuredError
        Table of the formula's error against the exact contact problem.
    """

    name: str
    indenter: str
    substrate: str
    equation: str
    valid_range: tuple[float, float]
    range_basis: str
    nu_range: tuple[float, float]
    assumptions: tuple[str, ...]
    source: str
    doi: str | None
    further_limits: tuple[Limit, ...] = ()
    factor: Callable[[LayerContact], Factor] = field(repr=False, compare=False)
    measured_error: MeasuredError = field(repr=False, compare=False)

    @property
    def variable(self) -> str:
        """Name of the contact size on which the factor depends, such as ``"X = sqrt(R d)/h"``."""
        return VARIABLES[self.indenter].name

    @property
    def limits(self) -> tuple[Limit, ...]:
        """All ranges within which the correction may be used."""
        return (
            Limit(VARIABLES[self.indenter], *self.valid_range),
            Limit(LAYER_NU, *self.nu_range),
            *self.further_limits,
        )
