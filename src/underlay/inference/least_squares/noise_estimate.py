"""The noise that a fit leaves behind: estimated where it was not given, renewed where it follows the model.

Numbers of the noise are found by restricted maximum likelihood at the current optimum (Harville 1977,
doi:10.1080/01621459.1977.10480998): minus log-likelihood plus half the logarithm of det(J'V^-1 J), which pays
for the parameters already fitted. For white noise of unknown size that is the familiar S / (n - k).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import optimize

from underlay._arrays import FloatArray
from underlay.inference.least_squares.frozen_noise import FrozenNoise, freeze
from underlay.inference.least_squares.objective import Objective
from underlay.inference.model.forward import Reading
from underlay.inference.problem import Problem
from underlay.scene.noise_model import NoiseModel

__all__ = [
    "Renewal",
    "first_noises",
    "most_likely",
    "noise_covariance",
    "renew",
    "restricted_log_likelihood",
]

# A change of the weights by less than this moves a fit by less than its numerical tolerance times sigma.
_SETTLED = 1e-4
_RANK = float(np.finfo(float).eps)
# 1 / 0.6745: standard deviation of a normal variable over its median absolute value.
_MEDIAN_TO_SD = 1.4826022185056018


# In ln sigma, where the restricted likelihood is a parabola over a step of this size to 1e-3.
_CURVATURE_STEP = 0.03


@dataclass(frozen=True)
class Renewal:
    """Noise at an optimum.

    Parameters
    ----------
    vector : FloatArray
        The vector with the numbers of the noise renewed, (k,).
    noise : FrozenNoise
        Frozen noise there.
    settled : bool
        Whether the parameters need no further fit: the weights are those they were fitted with, or only their
        common size changed, which moves nothing.
    """

    vector: FloatArray
    noise: FrozenNoise
    settled: bool


def first_noises(problem: Problem, vector: FloatArray) -> tuple[NoiseModel, ...]:
    """Noise of every curve at a scaled vector; an unknown size from the scatter of neighbouring points."""
    return tuple(
        noise.of_size(member.scatter) if member.scale_is_unknown else noise
        for member, noise in zip(problem.members, problem.noises(vector), strict=True)
    )


def renew(objective: Objective, vector: FloatArray, *, robust: bool) -> Renewal:
    """Estimate, or compute again, the noise at an optimum of the other parameters."""
    problem = objective.problem
    if problem.noise_entries:
        physical = problem.physical(vector)
        linear = [member.jacobian(physical) for member in problem.members]
        vector = most_likely(problem, vector, sorted(problem.noise_entries), linear)
    noises, sized = problem.noises(vector), any(member.scale_is_unknown for member in problem.members)
    if not (problem.noise_entries or sized or any(noise.follows_force for noise in noises)):
        return Renewal(vector, objective.noise, settled=True)
    if sized:
        sizes = _sizes(objective, vector, robust=robust)
        noises = tuple(
            noise.of_size(size) if member.scale_is_unknown else noise
            for member, noise, size in zip(problem.members, noises, sizes, strict=True)
        )
    renewed = freeze(problem, vector, noises)
    return Renewal(vector, renewed, _is_settled(objective, renewed, robust=robust))


def _is_settled(objective: Objective, renewed: FrozenNoise, *, robust: bool) -> bool:
    old = objective.noise
    ratios = [new / before for new, before in zip(renewed.sigmas, old.sigmas, strict=True)]
    common = 1.0
    if not objective.has_measured_priors and not robust:
        # Without a prior or a loss to weigh against, a common factor of all sigmas moves nothing.
        common = float(np.mean([ratio.mean() for ratio in ratios]))
    alike = all(
        len(new.correlation) == len(before.correlation)
        and np.allclose(np.array(new.correlation), np.array(before.correlation), rtol=_SETTLED, atol=0.0)
        for new, before in zip(renewed.models, old.models, strict=True)
    )
    return alike and all(float(np.abs(ratio / common - 1.0).max()) < _SETTLED for ratio in ratios)


def _sizes(objective: Objective, vector: FloatArray, *, robust: bool) -> list[float]:
    """Size of the noise (N) of every curve from its residuals, S / (n - k) with the k it pays for."""
    ends = np.cumsum([len(member.force) for member in objective.problem.members])
    # Noise of unknown size is white: all its points have one standard deviation.
    before = [float(sigma[0]) for sigma in objective.noise.sigmas]
    residuals = np.split(objective.residuals(vector), ends)
    if robust:
        return [
            size * _MEDIAN_TO_SD * float(np.median(np.abs(r)))
            for size, r in zip(before, residuals, strict=False)
        ]
    normals, total = objective.normals(vector)
    # The pseudo-inverse of J'J as numpy.linalg.pinv has it, without the calls.
    values, directions = np.linalg.eigh(total)
    fixed = directions[:, values > _RANK * len(values) * values.max(initial=0.0)]
    inverse = (fixed / values[len(values) - fixed.shape[1] :]) @ fixed.T
    sizes = []
    for size, own, normal in zip(before, residuals, normals, strict=False):
        degrees = len(own) - float(np.sum(inverse * normal))
        sizes.append(size * float(np.sqrt(own @ own / degrees)))
    return sizes


def most_likely(
    problem: Problem,
    vector: FloatArray,
    entries: Sequence[int],
    linear: Sequence[tuple[Reading, FloatArray]],
) -> FloatArray:
    """Vector with its noise entries at the maximum of the restricted likelihood."""
    low, high = problem.bounds[list(entries)].T

    def loss(part: FloatArray) -> float:
        return -restricted_log_likelihood(problem, _with(vector, entries, part), linear)

    found = optimize.minimize(
        loss,
        vector[list(entries)],
        method="Nelder-Mead",
        bounds=list(zip(low, high, strict=True)),
        options={"xatol": 1e-5, "fatol": 1e-8, "maxiter": 400 * len(entries)},
    )
    return _with(vector, entries, found.x)


def noise_covariance(problem: Problem, vector: FloatArray) -> FloatArray:
    """Scaled covariance (m, m) of the free numbers of the noise, in the order of their entries.

    The inverse curvature of the restricted likelihood, by central differences; the model is frozen, to which
    the noise of a Gaussian is orthogonal. Infinite variances where the curvature is not that of a maximum.
    """
    entries = sorted(problem.noise_entries)
    physical = problem.physical(vector)
    linear = [member.jacobian(physical) for member in problem.members]
    steps = _CURVATURE_STEP * np.eye(len(entries))

    def at(offset: FloatArray) -> float:
        return restricted_log_likelihood(problem, _with(vector, entries, vector[entries] + offset), linear)

    curvature = np.empty((len(entries), len(entries)))
    for i, first in enumerate(steps):
        for j, second in enumerate(steps):
            plus, minus = at(first + second) + at(-first - second), at(first - second) + at(second - first)
            curvature[i, j] = (minus - plus) / (4.0 * _CURVATURE_STEP**2)
    if not (np.linalg.eigvalsh(curvature) > 0.0).all():
        return np.diag(np.full(len(entries), np.inf))
    return np.asarray(np.linalg.inv(curvature))


def _with(vector: FloatArray, entries: Sequence[int], part: FloatArray) -> FloatArray:
    changed = np.array(vector)
    changed[list(entries)] = part
    return changed


def restricted_log_likelihood(
    problem: Problem, vector: FloatArray, linear: Sequence[tuple[Reading, FloatArray]]
) -> float:
    """Restricted log-likelihood, up to a constant, of the noise in `vector`; the model is frozen in `linear`.

    `linear` holds for every curve the reading and its derivatives (n, k) in SI.
    """
    physical, slopes = problem.physical(vector), problem.slopes(vector)
    mechanical = [i for i in range(len(vector)) if i not in problem.noise_entries]
    total, normal = 0.0, np.zeros((len(mechanical), len(mechanical)))
    for member, (reading, columns) in zip(problem.members, linear, strict=True):
        noise, time = member.noise_at(physical), member.curve.time
        sigma = member.sigma(reading, noise)
        if not (sigma > 0.0).all():
            return -np.inf
        residuals = noise.whiten((member.force - reading.force) / sigma, time)
        if member.scale_is_unknown:
            # Its size is the most likely one beside the other numbers, paid for as in `_sizes`.
            degrees = len(residuals) * (1.0 - len(mechanical) / problem.n_points)
            size = float(np.sqrt(residuals @ residuals / degrees))
            sigma, residuals = size * sigma, residuals / size
        total += float(noise.log_normalisation(sigma, time)) - 0.5 * float(residuals @ residuals)
        rows = noise.whiten((columns * slopes)[:, mechanical].T / sigma, time)
        normal += rows @ rows.T
    for index, coordinate in enumerate(problem.coordinates):
        if coordinate.prior.informative and index in problem.noise_entries:
            total -= 0.5 * coordinate.prior.penalty(float(physical[index]))[0] ** 2
    sign, log_determinant = np.linalg.slogdet(normal) if mechanical else (1.0, 0.0)
    return total - 0.5 * float(log_determinant) if sign > 0.0 else total
