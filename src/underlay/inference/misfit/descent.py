"""The optimum of one combination of noise, drift and jump: Levenberg-Marquardt, drift and jump solved for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.misfit.blocked import Blocked
from underlay.inference.misfit.sizes import Sizes

__all__ = ["Combination", "Place", "descend"]

_MOST_STEPS = 12
# A step below this share of a standard deviation moves no interval.
_SETTLED = 0.02
# No step goes further than this in a scaled coordinate: a factor of 7.
_FARTHEST = 2.0
# Curvature of a coordinate that does not act, as a share of the largest: keeps it where it is.
_LEAST = 1e-12


@dataclass(frozen=True)
class Combination:
    """One of what is weighed: correlated noise (tau, g) or None, and the sizes of drift and jump."""

    noise: tuple[float, float] | None
    sizes: tuple[float, float]


@dataclass(frozen=True)
class Place:
    """One combination at one vector: N, c and S with drift and jump solved for, and s^2."""

    vector: FloatArray
    normal: FloatArray
    gradient: FloatArray
    square: float
    variance: float

    @classmethod
    def of(cls, blocked: Blocked, vector: FloatArray, combination: Combination) -> Place:
        """Solve for drift, jump and known errors at a scaled vector (k,); raises InputError without a law."""
        model = blocked.linearised(vector)
        k, known = len(model.precision), len(vector)
        gram, _ = model.gram(combination.noise)
        scale = np.r_[Sizes.scale(combination.sizes, k, len(blocked.curves)), 1.0]
        gram = gram * np.outer(scale, scale)
        gram[range(k, len(scale) - 1), range(k, len(scale) - 1)] += 1.0
        reduced = _without(gram, slice(k, -1))
        variance = float(_without(reduced, slice(known, -1))[-1, -1]) / (model.readings - k)
        # What is measured besides weighs s^2 against the readings.
        reduced[range(k), range(k)] += variance * model.precision
        reduced[:k, -1] += variance * model.pull
        reduced[-1, :k] += variance * model.pull
        reduced[-1, -1] += variance * model.offset
        reduced = _without(reduced, slice(known, -1))
        return cls(vector, reduced[:-1, :-1], reduced[:-1, -1], float(reduced[-1, -1]), variance)

    def step(self, damping: float, free: NDArray[np.bool_]) -> FloatArray:
        """Damped Gauss-Newton step (k,) of the coordinates that are `free`."""
        step = np.zeros(len(self.vector))
        normal = self.normal[np.ix_(free, free)]
        diagonal = np.diag(normal)
        if not diagonal.size or not diagonal.max() > 0.0:
            return step
        damped = normal + np.diag(damping * diagonal + _LEAST * diagonal.max())
        step[free] = -np.linalg.solve(damped, self.gradient[free])
        return np.asarray(np.clip(step, -_FARTHEST, _FARTHEST))

    def gain(self, step: FloatArray) -> float:
        """By how much a step should lower S, in s^2."""
        return float(-(2.0 * self.gradient + self.normal @ step) @ step) / self.variance


def descend(blocked: Blocked, vector: FloatArray, combination: Combination, held: int | None = None) -> Place:
    """Optimum of one combination from a scaled vector (k,), with one entry held where it is if wanted.

    Raises
    ------
    InputError
        If there is no law at the vector.
    """
    low, high = blocked.problem.bounds.T
    here, damping = Place.of(blocked, vector, combination), 1e-6
    for _ in range(_MOST_STEPS):
        downhill = -here.gradient
        free = ((here.vector > low) | (downhill > 0.0)) & ((here.vector < high) | (downhill < 0.0))
        if held is not None:
            free[held] = False
        target = np.clip(here.vector + here.step(damping, free), low, high)
        there = _exists(blocked, target, combination)
        if there is None or not there.square < here.square:
            if here.gain(target - here.vector) < _SETTLED**2:
                break
            damping = max(10.0 * damping, 1e-3)
            continue
        settled = here.square - there.square < _SETTLED**2 * here.variance
        here, damping = there, 0.1 * damping
        if settled:
            break
    return here


def _without(products: FloatArray, entries: slice) -> FloatArray:
    """Products (m, m) of columns, those of some of them solved for: their Schur complement."""
    count = len(products)
    gone = np.arange(count)[entries]
    kept = np.setdiff1d(np.arange(count), gone)
    left = products[np.ix_(kept, kept)]
    if not len(gone):
        return left
    cross = products[np.ix_(gone, kept)]
    return np.asarray(left - cross.T @ np.linalg.solve(products[np.ix_(gone, gone)], cross))


def _exists(blocked: Blocked, vector: FloatArray, combination: Combination) -> Place | None:
    try:
        return Place.of(blocked, vector, combination)
    except InputError:
        return None
