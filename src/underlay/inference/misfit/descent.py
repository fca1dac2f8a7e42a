"""The optimum of one combination: Levenberg-Marquardt in the parameters, drift, jump and ramp solved for."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.misfit.blocked import Blocked
from underlay.inference.misfit.competition import Competition
from underlay.inference.misfit.drift import DRIFTS
from underlay.inference.misfit.linearised import Linearised
from underlay.inference.misfit.shapes import JUMPS, RAMPS, acting_columns
from underlay.inference.misfit.sizes import over_noise

__all__ = ["Combination", "Place", "descend"]

_MOST_STEPS = 12
# A step that gains less than the square of this share of a standard deviation is the last: z by a four-hundredth.
_SETTLED = 0.1
# Within so many standard deviations the linear model says where the optimum is and how low; nothing is asked there.
_SHORT = 0.3
# No step goes further than this in a scaled coordinate: a factor of 7.
_FARTHEST = 2.0
# Damping after a step that went wrong: less would take nearly the same step again.
_DAMPED = 0.1
# Curvature of a coordinate that does not act, as a share of the largest: keeps it where it is.
_LEAST = 1e-12


@dataclass(frozen=True)
class Combination:
    """One of what is weighed: correlated noise (tau, g) or None, drift, jump and ramp (10 + 2,), and s^2.

    And about how large those of drift, jump and ramp are that act, (m,).
    """

    noise: tuple[float, float] | None
    amounts: FloatArray
    variance: float
    misfits: FloatArray

    @classmethod
    def of(cls, competition: Competition, at: int) -> Combination:
        """One of those that were weighed, by its number."""
        noise, amounts = competition.noises[competition.places[at, 0]], competition.amounts[at]
        every = competition.misfits
        curves = len(every) // (DRIFTS + JUMPS + RAMPS)
        acting = amounts[acting_columns(np.ones_like(amounts), curves)] > 0.0
        return cls(noise, amounts, float(competition.variance[at]), every[acting])


@dataclass(frozen=True)
class Place:
    """One combination at one vector: N and c of the coordinates, and S, all else solved for; s^2, and misfits.

    2 c is the slope of S: its derivatives are those with the misfits held, which have their best values, and what
    these add moves with the vector too (Golub and Pereyra 1973, doi:10.1137/0710036).
    """

    vector: FloatArray
    normal: FloatArray
    gradient: FloatArray
    square: float
    variance: float
    misfits: FloatArray

    @classmethod
    def of(
        cls, blocked: Blocked, vector: FloatArray, combination: Combination, misfits: FloatArray | None = None
    ) -> Place:
        """Solve for the misfits and known errors at a scaled vector (k,); raises InputError without a law.

        The derivatives are those with `misfits`, which a place near by had: those of the combination by default.
        """
        return cls.about(blocked, vector, combination, blocked.linearised(vector), misfits)

    @classmethod
    def about(
        cls,
        blocked: Blocked,
        vector: FloatArray,
        combination: Combination,
        model: Linearised,
        misfits: FloatArray | None = None,
    ) -> Place:
        """Return the same where the model about the vector is known."""
        known, variance = len(vector), np.array([combination.variance])
        misfits = combination.misfits if misfits is None else misfits
        acting = acting_columns(combination.amounts, len(blocked.curves))
        products, _ = model.products([combination.noise], combination.amounts, misfits)
        scale = over_noise(combination.amounts[None], variance)[:, acting]
        (bordered,) = model.bordered(products, scale, variance)
        first = len(acting)
        if len(model.precision) > known:
            # Amplitudes of known errors go with the misfits.
            order = np.arange(len(bordered))
            order[first:-1] = np.roll(order[first:-1], -known)
            bordered = bordered[order[:, None], order]
            first = len(bordered) - known - 1
        cross = bordered[:first, first:]
        solved = np.linalg.solve(bordered[:first, :first], cross)
        left = bordered[first:, first:] - cross.T @ solved
        best = -solved[: len(acting), -1] * scale[0]
        return cls(vector, left[:-1, :-1], left[:-1, -1], float(left[-1, -1]), combination.variance, best)

    def step(self, damping: float, free: NDArray[np.bool_]) -> FloatArray:
        """Damped Gauss-Newton step (k,) of the coordinates that are `free`."""
        step, (entries,) = np.zeros(len(self.vector)), np.nonzero(free)
        damped = self.normal[entries[:, None], entries]
        diagonal = damped.diagonal().copy()
        if not diagonal.size or not diagonal.max() > 0.0:
            return step
        np.fill_diagonal(damped, (1.0 + damping) * diagonal + _LEAST * diagonal.max())
        step[entries] = -np.linalg.solve(damped, self.gradient[entries])
        return np.minimum(np.maximum(step, -_FARTHEST), _FARTHEST)

    def tangent(self, index: int) -> FloatArray:
        """d vector / d entry along the profile of an entry, (k,): the others as the linear model has them."""
        others = np.arange(len(self.vector)) != index
        normal, tangent = self.normal[np.ix_(others, others)], np.ones(len(self.vector))
        if others.any() and (largest := float(np.diag(normal).max())) > 0.0:
            least = np.diag(np.full(len(normal), _LEAST * largest))
            tangent[others] = -np.linalg.solve(normal + least, self.normal[others, index])
        else:
            tangent[others] = 0.0
        return tangent

    def curvature(self, index: int) -> float:
        """d gradient / d entry along the profile of an entry: half of how S bends."""
        return float(self.normal[index] @ self.tangent(index))

    def gain(self, step: FloatArray) -> float:
        """By how much a step should lower S, in s^2."""
        return float(-(2.0 * self.gradient + self.normal @ step) @ step) / self.variance

    def is_straight(self, step: FloatArray, share: float) -> bool:
        """Whether the square of a step (k,) is below a share of a standard deviation in every entry."""
        acting = np.diag(self.normal) > 0.0
        if share <= 0.0 or not acting.all():
            return False
        deviation = np.sqrt(self.variance * np.diag(np.linalg.inv(self.normal)))
        return bool((step * step <= share * deviation).all())

    def moved(self, vector: FloatArray) -> Place:
        """Return the place at a vector near by, as the linear model has it."""
        step = vector - self.vector
        square = self.square - self.gain(step) * self.variance
        return replace(self, vector=vector, gradient=self.gradient + self.normal @ step, square=square)


def descend(
    blocked: Blocked,
    vector: FloatArray,
    combination: Combination,
    held: int | None = None,
    most_steps: int = _MOST_STEPS,
    model: Linearised | None = None,
    misfits: FloatArray | None = None,
    straight: float = 0.0,
) -> Place:
    """Optimum of one combination from a scaled vector (k,), with one entry held where it is if wanted.

    `model` is that about the vector, and `misfits` those of a place near by, where they are known. A step whose
    square is below the share `straight` of a standard deviation in every entry is the last one, taken unseen.

    Raises
    ------
    InputError
        If there is no law at the vector.
    """
    low, high = blocked.problem.bounds.T
    here = Place.about(blocked, vector, combination, model or blocked.linearised(vector), misfits)
    damping = 1e-6
    for _ in range(most_steps):
        downhill = -here.gradient
        free = ((here.vector > low) | (downhill > 0.0)) & ((here.vector < high) | (downhill < 0.0))
        if held is not None:
            free[held] = False
        target = np.clip(here.vector + here.step(damping, free), low, high)
        step = target - here.vector
        if 0.0 <= here.gain(step) < _SHORT**2 or here.is_straight(step, straight):
            return here.moved(target)
        there = _exists(blocked, target, combination, here.misfits)
        if there is None or not there.square < here.square:
            damping = max(10.0 * damping, _DAMPED)
            continue
        settled = here.square - there.square < _SETTLED**2 * here.variance
        here, damping = there, 0.1 * damping
        if settled:
            break
    return here


def _exists(
    blocked: Blocked, vector: FloatArray, combination: Combination, misfits: FloatArray
) -> Place | None:
    try:
        return Place.of(blocked, vector, combination, misfits)
    except InputError:
        return None
