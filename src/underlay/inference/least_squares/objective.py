"""Weighted residuals of a problem with their analytic Jacobian: what the searches minimise.

The noise is frozen: it is that of a current model, and a fit updates it from outside until nothing changes.
(Weights that follow the parameters without the normalisation of the likelihood would pull the model towards large
noise.)

Some parameters are stepped in a transformed number in which the force is nearly linear: the modulus of the base,
which is what the layer stands on (`BaseSteps`), a layer's Poisson's ratio (`PoissonSteps`), and amounts of effects
that begin at zero (`PowerSteps`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.least_squares.models import FrozenNoise, Models
from underlay.inference.least_squares.projection import (
    Fractions,
    LinearDirections,
    Places,
    Point,
    Rows,
    projected,
)
from underlay.inference.model.coordinates import FAR, Coordinate
from underlay.inference.model.members import Member
from underlay.inference.problem import Problem
from underlay.scene.noise import NoiseModel

_BASE, _LAYER = "substrate.E", "layer.E"
_NU = "layer.nu"
# What is left of 1 - 2 nu where a layer gives way sideways, as `PoissonSteps` takes it. Between nu = 0.4 and 0.5
# the logarithm of the exact force is straight in ln(room) with 0.2 of contacts a third as wide as the layer is
# thick, 0.17 at 0.8, 0.1 at 1.5.
_LATERAL = 0.13
#: Models are smooth in scaled coordinates: over a step no longer than this derivatives change by as much of
#: themselves.
HAIR = 1e-3
# Models are extrapolated linearly where that is wrong by less than this share of a standard error of the fit.
_NEGLIGIBLE = 1e-3


class Course(ABC):
    """Steps of m scaled parameters in transformed numbers in which the force is nearly linear.

    A small step equals the change of the scaled parameter.

    Attributes
    ----------
    entries : ndarray of int (m,)
        Their entries in a scaled vector.
    """

    entries: NDArray[np.intp]

    def straight(self, here: FloatArray, changes: FloatArray) -> FloatArray:
        """Steps (s, k) from scaled vectors `here` (s, k) that lead to `changes` (s, k) of them.

        Changes may be infinite; the array is overwritten.
        """
        changes[:, self.entries] = self._steps(here, changes[:, self.entries])
        return changes

    def changes(self, here: FloatArray, steps: FloatArray, longest: float) -> FloatArray:
        """Changes (s, k) of scaled vectors `here` (s, k) that steps (s, k) lead to, each `longest` at most."""
        result = steps.copy()
        result[:, self.entries] = self._changes(here, steps[:, self.entries], longest)
        return result

    @abstractmethod
    def _steps(self, here: FloatArray, change: FloatArray) -> FloatArray:
        """Steps (s, m) that lead to changes (s, m) of the entries."""

    @abstractmethod
    def _changes(self, here: FloatArray, step: FloatArray, longest: float) -> FloatArray:
        """Changes (s, m) of the entries that steps (s, m) lead to."""


@dataclass(frozen=True)
class BaseSteps(Course):
    """Steps of the free moduli of m bases.

    With k the ratio of the base's modulus to the layer's, the force goes nearly with a power of k where the base is
    soft, and with its compliance 1/k where it is stiff: with u = -ln(1 + 1/k) in both cases. A step that is
    straight in ln k leads far too far down from a stiff base, and up towards a rigid one it never arrives. Steps
    up from a soft base (k < 1) stay linear in ln k: in u they would lead beyond what is as good as rigid.

    Parameters
    ----------
    entries : ndarray of int (m,)
        Their entries in a scaled vector.
    layers : ndarray of int (m,)
        Entries of the layers' moduli; any where they are known.
    free : FloatArray
        One where the layer's modulus is free, zero where it is known, (m,).
    at_start : FloatArray
        ln k of the scene's own numbers, (m,).
    """

    entries: NDArray[np.intp]
    layers: NDArray[np.intp]
    free: FloatArray
    at_start: FloatArray

    @classmethod
    def of(cls, members: Sequence[Member], coordinates: Sequence[Coordinate]) -> Self | None:
        """Find the free moduli of bases of a problem's curves; None where there are none."""
        found: dict[int, tuple[int, float, float]] = {}
        for member in members:
            base, layer = (member.entries.get(path) for path in (_BASE, _LAYER))
            if base is None or _LAYER not in member.base:
                continue
            known = member.base[_LAYER] if layer is None else coordinates[layer].reference
            at_start = float(np.log(coordinates[base].reference / known))
            found.setdefault(base, (layer or 0, float(layer is not None), at_start))
        if not found:
            return None
        layers, free, start = zip(*found.values(), strict=True)
        return cls(np.array(list(found)), np.array(layers), np.array(free), np.array(start))

    def _at(self, here: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """ln k, u and du/d(ln k) = 1 / (1 + k) at scaled vectors (s, k), (s, m) each."""
        log_ratio = here[:, self.entries] - self.free * here[:, self.layers] + self.at_start
        inverse = np.exp(-log_ratio)
        return log_ratio, -np.log1p(inverse), inverse / (1.0 + inverse)

    def _steps(self, here: FloatArray, change: FloatArray) -> FloatArray:
        log_ratio, u, slope = self._at(here)
        up_from_soft = (log_ratio < 0.0) & (change > 0.0)
        return np.where(up_from_soft, change, (log_share(log_ratio + change) - u) / slope)

    def _changes(self, here: FloatArray, step: FloatArray, longest: float) -> FloatArray:
        log_ratio, u, slope = self._at(here)
        # u = 0 is a rigid base: no step leads beyond it.
        there = np.minimum(u + slope * step, log_share(log_ratio + longest))
        up_from_soft = (log_ratio < 0.0) & (step > 0.0)
        change = np.where(up_from_soft, step, -np.log(np.expm1(-there)) - log_ratio)
        return np.where(step == 0.0, 0.0, np.clip(change, -longest, longest))


def log_share(log_ratio: FloatArray) -> FloatArray:
    """u = -ln(1 + 1/k), in which the force is nearly linear, from ln k.

    k is the modulus of the base over that of the layer.
    """
    return np.asarray(-np.logaddexp(0.0, -log_ratio))


@dataclass(frozen=True)
class PoissonSteps(Course):
    """Steps of the free Poisson's ratios of m isotropic layers; none leads further than it is long.

    A bonded layer that is thin compared with the contact responds with its confined compression modulus, which
    grows with 1/(1 - 2 nu) until the layer yields sideways instead. Where a curve shows Poisson's ratio at all it
    does so by that; a step that is straight in nu leads too far up. Steps up are linear in the logarithm of the
    distance of nu from (1 + `_LATERAL`) / 2, a little above one half.

    Parameters
    ----------
    entries : ndarray of int (m,)
        Their entries in a scaled vector.
    reference, scale : FloatArray
        Reference and scale of their coordinates, (m,): nu = reference + scale * scaled parameter.
    """

    entries: NDArray[np.intp]
    reference: FloatArray
    scale: FloatArray

    @classmethod
    def of(cls, members: Sequence[Member], coordinates: Sequence[Coordinate]) -> Self | None:
        """Find the free Poisson's ratios of isotropic layers of a problem's curves; None where there are none.

        The in-plane ratio of a transversely isotropic layer goes up to one, and acts in another way.
        """
        others = {
            m.entries[_NU] for m in members if _NU in m.entries and not m.scene.layer.material.isotropic
        }
        found = {i: c for i, c in enumerate(coordinates) if c.path == _NU and i not in others}
        if not found:
            return None
        reference, scale = np.array([[c.reference, c.scale or 1.0] for c in found.values()]).T
        return cls(np.array(list(found)), reference, scale)

    def _room(self, here: FloatArray) -> FloatArray:
        """That distance in scaled parameters at scaled vectors (s, k), (s, m)."""
        room = 1.0 - 2.0 * (self.reference + self.scale * here[:, self.entries]) + _LATERAL
        return np.asarray(room / (2.0 * self.scale))

    def _steps(self, here: FloatArray, change: FloatArray) -> FloatArray:
        room = self._room(here)
        return np.where(change > 0.0, -room * np.log1p(-change / room), change)

    def _changes(self, here: FloatArray, step: FloatArray, longest: float) -> FloatArray:
        del longest
        room = self._room(here)
        return np.where(step > 0.0, -room * np.expm1(-step / room), step)


@dataclass(frozen=True)
class PowerSteps(Course):
    """Steps of m numbers q by whose exponentials to a power p the force changes, such as an amount of stiffening.

    A step up is straight in exp(p q), in which the force is, and one down in q: there zero is at no distance. None
    leads further than it is long.

    Parameters
    ----------
    entries : ndarray of int (m,)
        Their entries in a scaled vector.
    powers : FloatArray
        p of each, (m,).
    """

    entries: NDArray[np.intp]
    powers: FloatArray

    @classmethod
    def of(cls, coordinates: Sequence[Coordinate]) -> Self | None:
        """Find them by what their quantities declare; None where there are none."""
        found = {
            i: c.quantity.power for i, c in enumerate(coordinates) if c.scale is None and c.quantity.power
        }
        return cls(np.array(list(found)), np.array(list(found.values()))) if found else None

    def _steps(self, here: FloatArray, change: FloatArray) -> FloatArray:
        del here
        return np.where(change > 0.0, np.expm1(self.powers * change) / self.powers, change)

    def _changes(self, here: FloatArray, step: FloatArray, longest: float) -> FloatArray:
        del here, longest
        return np.where(step > 0.0, np.log1p(self.powers * np.maximum(step, 0.0)) / self.powers, step)


@dataclass
class Objective:
    """Weighted residuals and their Jacobian at full scaled vectors, for frozen noise; counts evaluations.

    Prior measurements (`Prior.penalty`) follow the points as further residuals, one per informative prior.

    Parameters
    ----------
    problem : Problem
        What is fitted.
    noise : FrozenNoise
        Frozen noise of every curve.
    held : frozenset of int
        Entries of a vector that a search leaves unchanged.
    members : tuple of Member, optional
        Curves used in place of the problem's, such as their block averages.
    failures : int
        How many evaluations failed because no contact law exists.

    Attributes
    ----------
    asked : Models
        Source of models and their derivatives.
    """

    problem: Problem
    noise: FrozenNoise
    held: frozenset[int] = frozenset()
    members: tuple[Member, ...] = ()
    failures: int = 0
    _largest: float = field(default=1.0, repr=False)

    def __post_init__(self) -> None:
        self.members = self.members or self.problem.members
        noisy = self.problem.noise_entries
        coordinates = self.problem.coordinates
        #: Entries of a vector that a search varies: not the noise's, and not those held.
        self.active = [i for i in range(len(coordinates)) if i not in noisy and i not in self.held]
        #: Those with an informative prior, by which the size of the noise moves the optimum.
        self.informative = [i for i, c in enumerate(coordinates) if c.prior.informative and i not in noisy]
        self._own_entries = [np.array(list(one.entries.values()), dtype=np.intp) for one in self.members]
        # Errors that curves have in common make the residuals of each depend on what any reads.
        self._common = self.problem.common if self.members is self.problem.members else None
        everything = np.arange(len(coordinates))
        self._entries = self._own_entries if self._common is None else [everything] * len(self.members)
        # As in `Rows.entries`.
        self._some_entries = [None if np.array_equal(own, everything) else own for own in self._entries]
        self.asked = Models(self.members)

    @property
    def evaluations(self) -> int:
        """How many models were computed."""
        return self.asked.count

    @cached_property
    def points(self) -> int:
        """Number of points of all curves."""
        return sum(len(member.force) for member in self.members)

    # --- what lmfit and the results ask -----------------------------------------------------------------

    def residuals(self, vector: FloatArray) -> FloatArray:
        """Whitened residuals, (model - data) / sigma, of all points and of the priors, at a scaled vector (k,).

        Where no contact law exists every residual is the root of the largest sum of squares seen, so that a
        minimiser steps back.
        """
        if np.abs(vector).max(initial=0.0) > FAR:
            return self._refused()
        physical = self.problem.physical(vector)
        try:
            models = self.asked.models(physical)
        except InputError:
            return self._refused()
        parts = self._whitened([model - one.force for model, one in zip(models, self.members, strict=True)])
        if self.informative:
            parts.append(self._penalties(physical)[0])
        residuals = np.concatenate(parts) if len(parts) > 1 else parts[0]
        # The sum of squares is finite only if every entry is.
        square = float(residuals @ residuals)
        if not np.isfinite(square):
            return self._refused()
        self._largest = max(self._largest, square**0.5)
        return residuals

    def _refused(self) -> FloatArray:
        self.failures += 1
        return np.full(self.points + len(self.informative), self._largest)

    def square(self, vector: FloatArray) -> float:
        """Sum of the squared whitened residuals at a scaled vector (k,)."""
        residuals = self.residuals(vector)
        return float(residuals @ residuals)

    def jacobian(self, vector: FloatArray, *, rough: bool = False) -> FloatArray:
        """Derivatives of the whitened residuals in the scaled parameters at a vector (k,), (n + priors, k).

        `rough` allows less exact ones, as in `Forward.jacobian`.
        """
        physical = self.problem.physical(vector)
        return self._rows(self.asked.columns(physical, rough=rough), physical).T

    def normals(self, vector: FloatArray) -> tuple[list[FloatArray], FloatArray]:
        """J'J over the parameters that vary, of each curve and of all with the priors, each (active, active).

        J are the derivatives of the whitened residuals in the scaled parameters at a vector (k,).
        """
        physical = self.problem.physical(vector)
        slopes, kept = self.problem.space.slopes(physical), np.ix_(self.active, self.active)
        scale, parts = np.outer(slopes, slopes), []
        rows = self._whitened_rows(self.asked.columns(physical, rough=False))
        for own, entries in zip(rows, self._entries, strict=True):
            normal = np.zeros(scale.shape)
            # numpy.ix_ takes longer than so small a product.
            normal[entries[:, None], entries] = own @ own.T
            parts.append((normal * scale)[kept])
        return parts, sum(parts, self._prior_places(vector[None], physical[None]).normal[0][kept])

    def exists(self, vector: FloatArray) -> bool:
        """Whether a contact law, and those that its derivatives need, exist at a scaled vector (k,)."""
        if np.abs(vector).max(initial=0.0) > FAR:
            return False
        try:
            self.asked.columns(self.problem.physical(vector), rough=True)
        except InputError:
            return False
        return True

    def follows(self, vector: FloatArray, square: float) -> bool:
        """Whether the last models can be extrapolated linearly to a scaled vector (k,), and keep them there if so.

        The error must be small beside the standard errors, `square` being the sum of squares. False where a law was
        refused on the way.
        """
        physical = self.problem.physical(vector)
        slopes = np.abs(self.problem.space.slopes(physical))

        def near(step: FloatArray, columns: list[FloatArray]) -> bool:
            length = float((np.abs(step) / slopes).max(initial=0.0))
            if length > HAIR:
                return False
            curvature = 0.0
            for rows, entries in zip(self._whitened_rows(columns), self._entries, strict=True):
                norms = np.sqrt(np.einsum("kn,kn->k", rows, rows))
                curvature += float(norms @ np.abs(step[entries])) ** 2
            return bool(length * curvature**0.5 <= _NEGLIGIBLE * (square / self.points) ** 0.5)

        return not self.failures and self.asked.follow(physical, near)

    def loss(self, vector: FloatArray) -> float:
        """Minus twice the log-likelihood at a scaled vector (k,), with the noise frozen and the priors included."""
        normalisation = sum(
            float(noise.log_normalisation(sigma, member.curve.time))
            for member, noise, sigma in self._curves()
        )
        if self._common is not None:
            normalisation -= self._common.log_determinant
        return self.square(vector) - 2.0 * normalisation

    # --- what the engine asks ---------------------------------------------------------------------------

    def point(self, vector: FloatArray, low: FloatArray, high: FloatArray) -> Point | None:
        """Point of the search at `vector` (k,), as in `places`; None where there is no law."""
        place = self.places(vector[None], low[None], high[None])
        return place.point(0) if np.isfinite(place.square[0]) else None

    def places(self, vectors: FloatArray, low: FloatArray, high: FloatArray) -> Places:
        """Points of the search at s scaled vectors, their linear parameters solved for.

        `vectors`, and the limits `low` and `high` of each, are (s, k). Relaxing fractions are solved for too where
        that is worth a further model.
        """
        if self._fractions is None:
            return self._places(vectors, low, high)
        here = self._places(np.array([self._fractions.feasible(one) for one in vectors]), low, high)
        for row in np.flatnonzero(np.isfinite(here.square)).tolist():
            solved = self._fractions.solved(here.point(row))
            if solved is not None and ((solved >= low[row]) & (solved <= high[row])).all():
                own = np.arange(len(vectors)) == row
                there = self._places(solved[None], low[own], high[own])
                here = here.replaced(own & (there.square < here.square), there)
        return here

    def _places(self, vectors: FloatArray, low: FloatArray, high: FloatArray) -> Places:
        """`places` without solving for the relaxing fractions."""
        possible = np.abs(vectors).max(axis=1, initial=0.0) <= FAR
        if not possible.all():
            vectors = np.where(possible[:, None], vectors, 0.0)
        physical = self.problem.physical(vectors)
        columns, models = self.asked.several(physical, possible)
        slopes = self.problem.space.slopes(physical)
        curves = [
            Rows(residuals, rows * (slopes if entries is None else slopes[:, entries])[:, :, None], entries)
            for residuals, rows, entries in zip(
                self._whitened([m - one.force for m, one in zip(models, self.members, strict=True)]),
                self._spread(self._each_whitened(columns)),
                self._some_entries,
                strict=True,
            )
        ]
        prior = self._prior_places(vectors, physical)
        here = projected(curves, prior, self._linear, low, high)
        for entry, power in self._powers:
            # At the optimum the readings pull as hard as the prior; farther away the first order leads faster.
            pull = np.minimum(here.gradient[:, entry] - prior.gradient[:, entry], -prior.gradient[:, entry])
            here.normal[:, entry, entry] += power * np.maximum(pull, 0.0)
        possible &= np.isfinite(here.square)
        if possible.all():
            return here
        self.failures += int(np.count_nonzero(~possible))
        return replace(here, square=np.where(possible, here.square, np.inf))

    @cached_property
    def courses(self) -> tuple[Course, ...]:
        """Transformations of those parameters in which the force is far from linear."""
        coordinates = self.problem.coordinates
        found = (
            BaseSteps.of(self.members, coordinates),
            PoissonSteps.of(self.members, coordinates),
            PowerSteps.of(coordinates),
        )
        return tuple(steps for steps in found if steps is not None)

    @cached_property
    def _powers(self) -> list[tuple[int, float]]:
        """Entries whose curvature is added to J'J, and the power p in which the force changes with them.

        In q, the logarithm of such a number, the residuals' second derivative is p times the first, and adds p
        times the pull of the readings to the curvature of the sum of squares. Without it a step overshoots by so
        much, where a prior holds a number that the readings pull towards zero, that a search may not settle.
        """
        known = self.problem.coordinates
        return [
            (i, known[i].quantity.power)
            for i in self.informative
            if known[i].scale is None and known[i].quantity.power
        ]

    @cached_property
    def _linear(self) -> LinearDirections:
        return LinearDirections.of(self.problem, set(self.active) - set(self.informative))

    @cached_property
    def _fractions(self) -> Fractions | None:
        return Fractions.of(self.problem, set(self.active) - set(self.informative), self._linear)

    def _prior_places(self, vectors: FloatArray, physical: FloatArray) -> Places:
        """Contributions of the informative priors to r'r, J'r and J'J at scaled vectors (s, k).

        r are their residuals and J the derivatives; `physical` are the same vectors in SI.
        """
        count, k = vectors.shape
        square, gradient, normal = np.zeros(count), np.zeros((count, k)), np.zeros((count, k, k))
        for row in range(count if self.informative else 0):
            values, slopes = self._penalties(physical[row])
            columns = slopes * self.problem.space.slopes(physical[row])
            square[row], gradient[row] = float(values @ values), values @ columns
            normal[row] = columns.T @ columns
        return Places(vectors, square, gradient, normal)

    # --- their weights ------------------------------------------------------------------------------------

    def _rows(self, columns: list[FloatArray], physical: FloatArray) -> FloatArray:
        """Derivatives of the residuals in the scaled parameters, (k, n + p), from those of each curve in SI."""
        slopes = self.problem.space.slopes(physical)
        rows = np.zeros((len(slopes), self.points + len(self.informative)))
        end = 0
        for own, entries in zip(self._whitened_rows(columns), self._entries, strict=True):
            rows[entries, end : end + own.shape[1]] = own * slopes[entries, None]
            end += own.shape[1]
        if self.informative:
            rows[:, end:] = (self._penalties(physical)[1] * slopes).T
        return rows

    def _whitened(self, forces: list[FloatArray]) -> list[FloatArray]:
        """Forces (N), (..., n) each, divided by the noise and decorrelated.

        Errors that several curves have in common are included.
        """
        own = self._each_whitened(forces)
        return own if self._common is None else self._common.whitened(own)

    def _whitened_rows(self, columns: list[FloatArray]) -> list[FloatArray]:
        return self._spread(self._each_whitened([own.T for own in columns]))

    def _each_whitened(self, forces: list[FloatArray]) -> list[FloatArray]:
        """Forces (N), (..., n) each, divided by the noise of their own curve and decorrelated."""
        return [
            noise.whiten(force / sigma, member.curve.time)
            for force, (member, noise, sigma) in zip(forces, self._curves(), strict=True)
        ]

    def _spread(self, rows: list[FloatArray]) -> list[FloatArray]:
        """Whitened derivatives of each curve in its own parameters, (..., e, n).

        In all parameters where curves have errors in common.
        """
        if self._common is None:
            return rows
        spread = []
        for own, entries in zip(rows, self._own_entries, strict=True):
            every = np.zeros((*own.shape[:-2], len(self.problem.coordinates), own.shape[-1]))
            every[..., entries, :] = own
            spread.append(every)
        return self._common.whitened(spread)

    def _curves(self) -> Iterator[tuple[Member, NoiseModel, FloatArray]]:
        return zip(self.members, self.noise.models, self.noise.sigmas, strict=True)

    def _penalties(self, physical: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Residuals of the informative priors, in standard deviations (p,), and their derivatives (p, k).

        `physical` are the parameters (k,) in SI, in which the derivatives are taken.
        """
        which = self.informative
        values, slopes = np.zeros(len(which)), np.zeros((len(which), len(physical)))
        for row, index in enumerate(which):
            values[row], slopes[row, index] = self.problem.coordinates[index].prior.penalty(physical[index])
        return values, slopes
