"""Profile of a number of the noise: its restricted likelihood, all other parameters following it.

t is twice the fall of the restricted log-likelihood (`noise_estimate.py`) below its maximum, with the other
numbers of the noise at their most likely values and the model fitted again under each. Its threshold is
chi-square's: for white noise that makes the interval of sigma the one of (n - k) s^2 / sigma^2, which is
chi-square with n - k degrees of freedom, to order 1 / (n - k).
"""

from __future__ import annotations

import numpy as np

from underlay._arrays import FloatArray, read_only
from underlay.inference.least_squares.engine import minimise
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.least_squares.frozen_noise import freeze
from underlay.inference.least_squares.noise_estimate import most_likely, restricted_log_likelihood
from underlay.inference.least_squares.objective import Objective
from underlay.inference.model.forward import Reading
from underlay.inference.problem import Problem
from underlay.inference.profiling.profile_result import LikelihoodProfile
from underlay.inference.profiling.walk import HIGHEST
from underlay.scene.noise_model import NoiseModel

__all__ = ["noise_profile"]

_STEP = 0.5  # of z = sqrt(t), as in `walk.py`
_STEEPEST = 2.0 * _STEP  # a rise of z in one step beyond which the step is taken again, shorter
_GROWTH = 2.0
_FARTHEST = 12.0  # scaled coordinate: a factor 1.6e5
_MOST_STEPS = 60
# Rounds of model and noise in turn: they are orthogonal for a Gaussian, and the second changes little.
_MOST_ROUNDS = 5
_SETTLED = 1e-4


def noise_profile(fit: Fit, name: str) -> LikelihoodProfile:
    """Walk the restricted likelihood from the fit to both sides.

    Parameters
    ----------
    fit : Fit
        With the number free.
    name : str
        ``"noise.force"``, ``"noise.correlation_time"``, ... as in `Fit.names`.
    """
    index = fit.names.index(name)
    best = restricted_log_likelihood(fit.problem, fit.vector, _linear(fit.problem, fit.vector))
    below, above = (_side(fit, index, best, direction) for direction in (-1.0, 1.0))
    vectors = np.array([*below[0][::-1], fit.vector, *above[0]])
    rises = np.array([*below[1][::-1], 0.0, *above[1]])
    return LikelihoodProfile(
        name=name,
        fit=fit,
        values=read_only(fit.problem.coordinates[index].physical(vectors[:, index])),
        delta_chi_square=read_only(np.maximum(rises, 0.0)),
        vectors=read_only(vectors),
        ends=(below[2], above[2]),
    )


def _side(fit: Fit, index: int, best: float, direction: float) -> tuple[list[FloatArray], list[float], str]:
    """Vectors and rises outwards from the fit, and why they end."""
    bound = fit.problem.bounds[index][1 if direction > 0.0 else 0]
    here = float(fit.vector[index])
    room = abs(bound - here)
    deviation = float(np.sqrt(fit.scaled_covariance[index, index]))
    step = shortest = _STEP * deviation if 0.0 < deviation < 1.0 else 0.1
    vectors: list[FloatArray] = []
    rises: list[float] = []
    travelled, z = 0.0, 0.0
    for _ in range(_MOST_STEPS):
        step = min(step, room - travelled)
        if step <= 1e-12 * (1.0 + travelled):
            return vectors, rises, "bound"
        # A number that is lost in the others lies far out on a plateau and is walked back from all the way.
        if travelled >= _FARTHEST and direction * (here + direction * travelled) >= _FARTHEST:
            return vectors, rises, "none"
        start = vectors[-1] if vectors else fit.vector
        vector, likelihood = _held(fit, start, index, here + direction * (travelled + step))
        rise = 2.0 * (best - likelihood)
        climb = float(np.sqrt(max(rise, 0.0))) - z
        if climb > _STEEPEST and step > 1e-3 * shortest:
            step *= max(_STEP / climb, 0.1)
            continue
        travelled, z = travelled + step, z + climb
        vectors.append(vector)
        rises.append(rise)
        if rise > HIGHEST**2:
            return vectors, rises, "data"
        step = min(_STEP * step / abs(climb), _GROWTH * step) if climb else _GROWTH * step
    return vectors, rises, "none"


def _held(fit: Fit, start: FloatArray, index: int, q: float) -> tuple[FloatArray, float]:
    """All else at its best with entry `index` at q: the vector (k,) and its restricted log-likelihood."""
    problem = fit.problem
    vector: FloatArray = np.array(start)
    vector[index] = q
    others = sorted(problem.noise_entries - {index})
    for _ in range(_MOST_ROUNDS):
        objective = Objective(problem, freeze(problem, vector, _noises(fit, vector)))
        minimum = minimise(objective, vector)
        found = vector if minimum is None else minimum.vector
        linear = _linear(problem, found)
        if not others:
            return found, restricted_log_likelihood(problem, found, linear)
        renewed = most_likely(problem, found, others, linear)
        settled = bool((np.abs(renewed - vector) < _SETTLED).all())
        vector = renewed
        if settled:
            break
    return vector, restricted_log_likelihood(problem, vector, linear)


def _noises(fit: Fit, vector: FloatArray) -> list[NoiseModel]:
    """Noise of every curve at a vector; a size that is no parameter stays as the fit estimated it."""
    return [
        noise.of_size(float(fitted.sigma(member.force)[0])) if member.scale_is_unknown else noise
        for member, noise, fitted in zip(
            fit.problem.members, fit.problem.noises(vector), fit.noises, strict=True
        )
    ]


def _linear(problem: Problem, vector: FloatArray) -> list[tuple[Reading, FloatArray]]:
    """Model of every curve and its derivatives (n, k) in SI."""
    physical = problem.physical(vector)
    return [member.jacobian(physical) for member in problem.members]
