"""Scaled coordinates: what optimisers and samplers see instead of 1e-9 metres and 1e6 pascals.

A quantity that is positive by nature (modulus, thickness, radius, compliance, noise) becomes q = ln(x / x0);
any other (contact depth, baseline, slope, Poisson's ratio, angle) becomes q = (x - x0) / s. x0 is the value
in the scene, so q = 0 is the start, and s is the range of the curve or the width of the prior: q does not
depend on the units.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.priors import Flat, Given, LogUniform, Prior, Uniform
from underlay.quantities import Quantity
from underlay.units import format_quantity

#: No contact law is asked for at scaled coordinates beyond this: a factor of 1e17 from the scene.
FAR = 40.0
#: Changes of scaled coordinates shorter than this change nothing that a curve could show.
SHORTEST = 1e-10


@dataclass(frozen=True)
class Spans:
    """Ranges of depth (m) and force (N) of the curves that a parameter acts on."""

    depth: float
    force: float

    def of(self, kind: str) -> float | None:
        """Natural scale (SI) of a length, force, stiffness or compliance from the ranges; None for other kinds."""
        scales = {
            "length": self.depth,
            "force": self.force,
            "stiffness": self.force / self.depth,
            "compliance": self.depth / self.force,
        }
        return scales.get(kind)


@dataclass(frozen=True)
class Coordinate:
    """Scaling of one free parameter: its physical value x (SI) and its scaled coordinate q.

    q = ln(x / reference) for a quantity that is positive by nature, else q = (x - reference) / scale.

    Parameters
    ----------
    name : str
        The path, with the curve's number in brackets when it is one curve's own, e.g. ``"layer.E[0]"``.
    path : str
        The path.
    quantity : Quantity
        Description of the quantity: unit, bounds, kind.
    prior : Prior
        Prior density of x.
    low, high : float
        Bounds of x (SI): prior's support within what is physically possible.
    reference : float
        Value (SI) at which q = 0, that of the scene.
    scale : float or None
        Change of x (SI) per unit of q, or None for q = ln(x / reference).
    """

    name: str
    path: str
    quantity: Quantity
    prior: Prior
    low: float
    high: float
    reference: float
    scale: float | None

    @property
    def bounds(self) -> tuple[float, float]:
        """Lower and upper bound of the scaled coordinate q; infinite where the physical value is unbounded."""
        if self.scale is None:
            low = np.log(self.low / self.reference) if self.low > 0.0 else -np.inf
            return float(low), float(np.log(self.high / self.reference))
        return (self.low - self.reference) / self.scale, (self.high - self.reference) / self.scale

    def physical(self, q: FloatArray) -> FloatArray:
        """Physical values x (SI) at scaled coordinates q, same shape."""
        return self.reference * np.exp(q) if self.scale is None else self.reference + self.scale * q

    def scaled(self, value: float) -> float:
        """Scaled coordinate q at a physical value x (SI)."""
        if self.scale is None:
            return float(np.log(value / self.reference))
        return (value - self.reference) / self.scale

    @property
    def even_density(self) -> float | None:
        """Log-density of the scaled coordinate q within its bounds if it is uniform there; None otherwise."""
        if self.scale is None and isinstance(self.prior, LogUniform):
            return -float(np.log(np.log(self.prior.high / self.prior.low)))
        if self.scale is not None and isinstance(self.prior, Uniform):
            return float(np.log(self.scale / (self.prior.high - self.prior.low)))
        return None

    def log_prior(self, q: FloatArray) -> FloatArray:
        """Log-density of the scaled coordinate q, same shape; -inf outside the bounds.

        It is the log-density of the physical value x plus ln |dx/dq|.
        """
        value = self.physical(np.asarray(q, dtype=np.float64))
        jacobian = np.log(value) if self.scale is None else np.log(self.scale)
        inside = (value >= self.low) & (value <= self.high)
        return np.where(inside, self.prior.log_density(value) + jacobian, -np.inf)


@dataclass(frozen=True, eq=False)
class ScaledSpace:
    """Scaling of all free parameters of a problem at once, for vectors (..., k) without a loop over entries.

    x are the physical values (SI) and q the scaled ones: q = ln(x / reference) or (x - reference) / scale.

    Parameters
    ----------
    reference, scale, logarithmic : ndarray (k,)
        Reference and scale of every coordinate, and whether it is a logarithm, whose scale is set to 1.
    low, high : ndarray (k,)
        Bounds of x (SI).
    even : float
        Sum of the log-densities of the coordinates whose density in q is uniform.
    uneven : tuple of (int, Coordinate)
        The others, with their entries.
    """

    reference: FloatArray
    scale: FloatArray
    logarithmic: NDArray[np.bool_]
    low: FloatArray
    high: FloatArray
    even: float
    uneven: tuple[tuple[int, Coordinate], ...]

    @classmethod
    def of(cls, coordinates: Sequence[Coordinate]) -> ScaledSpace:
        """Collect the scalings of a problem's free parameters."""
        densities = [c.even_density for c in coordinates]
        return cls(
            reference=np.array([c.reference for c in coordinates]),
            scale=np.array([1.0 if c.scale is None else c.scale for c in coordinates]),
            logarithmic=np.array([c.scale is None for c in coordinates]),
            low=np.array([c.low for c in coordinates]),
            high=np.array([c.high for c in coordinates]),
            even=sum(density for density in densities if density is not None),
            uneven=tuple((i, c) for i, c in enumerate(coordinates) if densities[i] is None),
        )

    def log_prior(self, q: FloatArray, physical: FloatArray) -> FloatArray:
        """Log-density (...) of the prior at scaled vectors `q` (..., k), which are `physical` (..., k) in SI."""
        inside = ((physical >= self.low) & (physical <= self.high)).all(axis=-1)
        total = np.where(inside, self.even, -np.inf)
        for index, coordinate in self.uneven:
            total = total + coordinate.log_prior(q[..., index])
        return total

    def physical(self, q: FloatArray) -> FloatArray:
        """Physical values (SI), (..., k), at scaled vectors q (..., k)."""
        values = self.reference + self.scale * q
        np.exp(q, out=values, where=self.logarithmic)
        return np.multiply(values, self.reference, out=values, where=self.logarithmic)

    def scaled(self, physical: FloatArray) -> FloatArray:
        """Scaled vectors (..., k) at physical values (SI), (..., k)."""
        ratio = np.where(self.logarithmic, physical / np.where(self.logarithmic, self.reference, 1.0), 1.0)
        return np.where(self.logarithmic, np.log(ratio), (physical - self.reference) / self.scale)

    def slopes(self, physical: FloatArray) -> FloatArray:
        """Derivatives dx/dq (SI) of physical values x in scaled ones q, (..., k), at physical values (..., k)."""
        return np.where(self.logarithmic, physical, self.scale)


def make_coordinate(
    name: str, path: str, quantity: Quantity, start: float, given: Given, spans: Spans
) -> Coordinate:
    """Choose the scaling and the bounds of one free parameter.

    Parameters
    ----------
    name, path, quantity
        As in `Coordinate`.
    start : float
        Value in the scene (SI).
    given : Prior, (low, high) or None
        Prior or bounds from the caller. Finite bounds mean LogUniform for a positive quantity whose lower bound is
        positive and Uniform otherwise; open ones or None mean `Flat`.
    spans : Spans
        Ranges of the curves it acts on.

    Raises
    ------
    InputError
        If the bounds are not in order, or the start is outside them.
    """
    # A compliance of exactly zero has no logarithm; it is then scaled by the curve's own compliance.
    logarithmic = quantity.is_scale and start > 0.0
    prior = _prior(name, given, logarithmic=logarithmic)
    possible = quantity.bounds
    low, high = max(prior.support[0], possible[0]), min(prior.support[1], possible[1])
    if not low <= start <= high:
        begin, *ends = (format_quantity(number, quantity.kind) for number in (start, low, high))
        raise InputError(
            f"{name} starts at {begin}, outside its bounds ({' to '.join(ends)}): change the value in the scene, "
            "or the bounds"
        )
    scale = None if logarithmic else _scale(quantity, prior, spans)
    return Coordinate(name, path, quantity, prior, low, high, start, scale)


def _prior(name: str, given: Given, *, logarithmic: bool) -> Prior:
    if isinstance(given, Prior):
        return given
    if given is None:
        return Flat(log=logarithmic)
    try:
        low, high = (float(end) for end in given)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{name}: give a prior such as Normal(...), (low, high) or None; got {given!r}"
        ) from error
    if not low < high:
        raise InputError(f"{name}: the lower bound must be below the upper one; got {low!r} and {high!r}")
    if not (np.isfinite(low) and np.isfinite(high)):
        return Flat(low, high, log=logarithmic)
    return LogUniform(low, high) if logarithmic and low > 0.0 else Uniform(low, high)


def _scale(quantity: Quantity, prior: Prior, spans: Spans) -> float:
    """Natural size of a change of the parameter (SI), by which it is scaled.

    From the curves' ranges, else the width of its prior, else the quantity's default.
    """
    own = spans.of(quantity.kind)
    if own is not None:
        return own
    if prior.informative:
        low, high = prior.quantile(np.array([0.16, 0.84]))
        return float(0.5 * (high - low))
    return quantity.natural_scale
