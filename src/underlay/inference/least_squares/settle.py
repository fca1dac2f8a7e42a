"""Fit all readings from one start, estimating the noise again until the weights no longer change.

The engine searches; lmfit, whose minimisers its users know, confirms an optimum and minimises robust losses.

The noise is estimated where it was not given, and computed again where it follows the model. Its numbers are found
by restricted maximum likelihood at the current optimum (Harville 1977, doi:10.1080/01621459.1977.10480998): minus
log-likelihood plus half the logarithm of det(J'V^-1 J), with J the derivatives of the model and V the covariance of
the noise, which accounts for the parameters already fitted. For white noise of unknown size that is the familiar S
/ (n - k), of the sum of squares S of n readings with k parameters.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy import optimize
from scipy.linalg import lapack

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.least_squares.engine import FINE, GiveUp, minimise
from underlay.inference.least_squares.models import LOSSES, SQUARES, FrozenNoise, freeze
from underlay.inference.least_squares.objective import BaseSteps, Objective
from underlay.inference.least_squares.projection import acting
from underlay.inference.model.forward import Reading
from underlay.inference.problem import Problem
from underlay.scene.noise import NoiseModel

#: lmfit's minimisers that a fit may name: Levenberg-Marquardt (MINPACK), trust region.
METHODS = ("leastsq", "least_squares")
# Relative tolerance of a step and of the sum of squares: lmfit's own (1.5e-8) lets a fit stop where two unit
# systems differ in the sixth digit.
_TOLERANCE = 1e-8
# Evaluations at most: from an optimum three are usual, from a robust start ten; a valley without an end takes
# hundreds.
_MOST_EVALUATIONS = 300
# What lmfit allows in no name.
_UNNAMEABLE = re.compile(r"\W+")
# Relative change of the weights that counts as none: it moves a fit by less than its numerical tolerance times
# sigma.
_SETTLED = 1e-4
# Relative size, times their number, below which a singular value is rounding.
_RANK = float(np.finfo(float).eps)
# 1 / 0.6745: standard deviation of a normal variable over its median absolute value.
_MEDIAN_TO_SD = 1.4826022185056018
# Step in ln sigma, over which the restricted likelihood is a parabola to 1e-3.
_CURVATURE_STEP = 0.03
# Times that a fit renews its noise at most.
_MAX_ROUNDS = 12
# Where every law is solved for, as of a stack, a step is cut to a factor e: a longer first one leads to thin layers
# whose laws cost ten times as much (of the fits of tests/benchmarks, that over one further layer took five times as
# long).
_CAREFUL = 1.0
# The search where the base's modulus is known. Of a thin and stiff layer on a known soft base E h^3 alone acts, and
# far along that valley a law costs up to a second. With 1000 readings z changes by less than one on a factor of
# twenty where a fit leaves it.
_KNOWN_BASE = replace(FINE, endless=5e-4, walled=5e-4)
# `Search.swinging` on a known base, as a part of the variance. Of 700 fits (samples that relax or stiffen, fringes,
# drags; modulus and thickness free) one ends higher for it by more than 0.005 of the variance, by 0.08, and two end
# lower by 1. They take 5 to 18 % fewer models, the longest 20 to 40 %.
_SWINGING = 0.05


@dataclass(frozen=True)
class Minimiser:
    """One of lmfit's minimisers, with the loss function that it minimises.

    Parameters
    ----------
    method : {"leastsq", "least_squares"}
        Levenberg-Marquardt (MINPACK) or trust region.
    loss : str, optional
        One of `LOSSES`, for which the method must be ``"least_squares"``; by default the sum of squares.
    """

    method: str = "leastsq"
    loss: str | None = None

    def __call__(self, objective: Objective, start: FloatArray) -> tuple[FloatArray, Any]:
        """Minimise the weighted sum of squares, or its robust loss, from a scaled vector (k,).

        Returns
        -------
        vector : FloatArray
            The optimum, (k,).
        result : MinimizerResult
            lmfit's, whose values are scaled parameters.
        """
        # The engine alone needs no lmfit, and it takes a second to load.
        import lmfit  # noqa: PLC0415

        active = objective.active
        names = [_UNNAMEABLE.sub("_", objective.problem.names[i]).strip("_") for i in active]
        low, high = objective.problem.bounds.T
        parameters: Any = [
            lmfit.Parameter(name, value=float(start[i]), min=float(low[i]), max=float(high[i]))
            for name, i in zip(names, active, strict=True)
        ]
        if self.method == "least_squares":
            # leastsq takes the list as it is and spares itself a copy.
            parameters, named = lmfit.Parameters(), parameters
            parameters.add_many(*named)

        def vector(current: Any) -> FloatArray:
            full: FloatArray = np.array(start)
            full[active] = [current[name].value for name in names]
            return full

        def jacobian(current: Any) -> FloatArray:
            columns = objective.jacobian(vector(current), rough=True)[:, active]
            # The minimiser leaves an entry whose column is zero where it is.
            return np.where(acting(np.linalg.norm(columns, axis=0)), columns, 0.0)

        options: dict[str, Any] = {"ftol": _TOLERANCE, "xtol": _TOLERANCE, "gtol": 0.0}
        if self.method == "least_squares":
            options |= {"gtol": None, "loss": self.loss or "linear"}
        rho = (LOSSES[self.loss] if self.loss else SQUARES).rho
        least, lowest, its_residuals = np.inf, start, np.zeros(0)

        def residuals(current: Any) -> FloatArray:
            nonlocal least, lowest, its_residuals
            there = vector(current)
            found = objective.residuals(there)
            loss = float(rho(found * found).sum())
            if loss < least:
                # A copy: a minimiser may write into what it is given.
                least, lowest, its_residuals = loss, there, found.copy()
            return found

        minimiser = lmfit.Minimizer(residuals, parameters, max_nfev=_MOST_EVALUATIONS)
        result = minimiser.minimize(method=self.method, Dfun=jacobian, **options)
        if result.aborted:
            # What lmfit then says is the place asked last, not the best; and of leastsq it is memory that MINPACK
            # has given back, which may hold any numbers by now.
            for name, i in zip(names, active, strict=True):
                result.params[name].value = float(lowest[i])
            result.residual = its_residuals
            result._calculate_statistics()  # noqa: SLF001  there is no public way to tell it the residuals
        return vector(result.params), result


def first_noises(problem: Problem, vector: FloatArray) -> tuple[NoiseModel, ...]:
    """Noise of every curve at a scaled vector (k,); an unknown size from the scatter of neighbouring points."""
    return tuple(
        noise.of_size(member.scatter) if member.scale_is_unknown else noise
        for member, noise in zip(problem.members, problem.noises(vector), strict=True)
    )


def renew(objective: Objective, vector: FloatArray, *, robust: bool) -> tuple[FloatArray, FrozenNoise, bool]:
    """Estimate the noise at an optimum of the other parameters, or compute it again there.

    Parameters
    ----------
    objective : Objective
        With the noise under which the optimum was found.
    vector : FloatArray
        Scaled vector of the optimum, (k,).
    robust : bool
        Whether an unknown size comes from the median of the residuals, so that outliers do not count.

    Returns
    -------
    vector : FloatArray
        Scaled vector with the new numbers of the noise, (k,).
    noise : FrozenNoise
        Frozen noise there.
    settled : bool
        Whether the parameters need no further fit: the weights are those they were fitted with, or only their
        common size changed, which moves nothing.
    """
    problem = objective.problem
    if problem.noise_entries:
        physical = problem.physical(vector)
        linear = [member.jacobian(physical) for member in problem.members]
        vector = most_likely(problem, vector, sorted(problem.noise_entries), linear)
    noises, sized = problem.noises(vector), any(member.scale_is_unknown for member in problem.members)
    if not (problem.noise_entries or sized or any(noise.follows_force for noise in noises)):
        return vector, objective.noise, True
    if sized:
        sizes = _sizes(objective, vector, robust=robust)
        noises = tuple(
            noise.of_size(size) if member.scale_is_unknown else noise
            for member, noise, size in zip(problem.members, noises, sizes, strict=True)
        )
    renewed = freeze(problem, vector, noises)
    return vector, renewed, _is_settled(objective, renewed, robust=robust)


def _is_settled(objective: Objective, renewed: FrozenNoise, *, robust: bool) -> bool:
    old = objective.noise
    ratios = [new / before for new, before in zip(renewed.sigmas, old.sigmas, strict=True)]
    common = 1.0
    if not objective.informative and not robust:
        # Without a prior or a loss to weigh against, a common factor of all sigmas moves nothing.
        common = float(np.mean([ratio.mean() for ratio in ratios]))
    alike = all(
        len(new.correlation) == len(before.correlation)
        and np.allclose(np.array(new.correlation), np.array(before.correlation), rtol=_SETTLED, atol=0.0)
        for new, before in zip(renewed.models, old.models, strict=True)
    )
    return alike and all(float(np.abs(ratio / common - 1.0).max()) < _SETTLED for ratio in ratios)


def _sizes(objective: Objective, vector: FloatArray, *, robust: bool) -> list[float]:
    """Standard deviation of the noise (N) of every curve from its residuals: root of S / (n - k).

    S is the sum of squares of its n residuals, k the curve's share of the fitted parameters. With `robust` it is
    scaled from the median absolute residual instead.
    """
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
    """Scaled vector (k,) with its noise parameters at the maximum of the restricted likelihood.

    Parameters
    ----------
    problem : Problem
        What is fitted.
    vector : FloatArray
        Scaled vector, (k,).
    entries : sequence of int
        Entries of the noise parameters.
    linear : sequence of (Reading, FloatArray)
        For every curve its model and the model's derivatives (n, k) in SI.
    """
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
    """Covariance (m, m) of the scaled free parameters of the noise, in the order of their entries.

    The inverse curvature of the restricted likelihood, by central differences; the model is frozen, to which the
    noise of a Gaussian is orthogonal. Infinite variances where the curvature is not that of a maximum.
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
    """Restricted log-likelihood, up to a constant, of the noise in a scaled vector (k,), the model unchanged.

    `linear` holds for every curve its model and the model's derivatives (n, k) in SI.
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


@dataclass(frozen=True)
class Optimum:
    """The optimum at which a fit ended, settled on all readings.

    Parameters
    ----------
    objective : Objective
        Weighted by the noise at the optimum.
    vector : FloatArray
        Scaled vector of the optimum, (k,).
    success : bool
        Whether the search met its tolerance.
    message : str
        Why it stopped.
    minimiser : Minimiser, optional
        lmfit's minimiser, where the optimum is its.
    lmfit : MinimizerResult, optional
        lmfit's result.
    """

    objective: Objective
    vector: FloatArray
    success: bool
    message: str
    minimiser: Minimiser | None = None
    lmfit: Any = None

    @property
    def loss_function(self) -> str | None:
        """Name of the robust loss; None for least squares."""
        return None if self.minimiser is None else self.minimiser.loss

    @cached_property
    def triangle(self) -> FloatArray:
        """R of the QR decomposition, (k, k), of the whitened residuals' derivatives in the scaled parameters.

        It has the same singular values and directions as these.
        """
        jacobian = self.objective.jacobian(self.vector)
        count = jacobian.shape[1]
        # As numpy.linalg.qr has it, without the calls.
        return np.asarray(lapack.dgeqrf(jacobian)[0][:count] * np.tri(count).T)


def settle(
    problem: Problem,
    vector: FloatArray,
    robust: Minimiser | None = None,
    *,
    steps: int | None = None,
    give_up: GiveUp | None = None,
) -> Optimum | None:
    """Fit all readings from one start, by the engine or by lmfit with a robust loss.

    Parameters
    ----------
    problem : Problem
        What is fitted.
    vector : FloatArray
        Scaled start, (k,).
    robust : Minimiser, optional
        lmfit's, with a robust loss; by default the engine minimises squares.
    steps : int, optional
        Largest number of steps of the engine.
    give_up : callable, optional
        Called with an `Ahead` before each step; the search is abandoned where it returns True.

    Returns
    -------
    Optimum or None
        None if there is no contact law at the start, or the search was abandoned.
    """
    try:
        objective = Objective(problem, freeze(problem, vector, first_noises(problem, vector)))
    except InputError:
        return None
    if not objective.exists(vector):
        return None
    found = _searched(objective, vector, robust, steps, give_up)
    for _ in range(_MAX_ROUNDS):
        if found is None:
            return None
        vector, objective.noise, settled = renew(objective, found.vector, robust=robust is not None)
        if vector is not found.vector:
            found = replace(found, vector=vector)
        if settled:
            break
        found = _searched(objective, found.vector, robust, steps)
    return found


def _searched(
    objective: Objective,
    start: FloatArray,
    robust: Minimiser | None,
    steps: int | None,
    give_up: GiveUp | None = None,
) -> Optimum | None:
    if not objective.active:
        return Optimum(objective, start, success=True, message="nothing to vary.")
    if robust is not None:
        return by_lmfit(objective, robust, start)
    search = FINE
    if not any(isinstance(course, BaseSteps) for course in objective.courses):
        search = replace(_KNOWN_BASE, swinging=_SWINGING / objective.points)
    if steps is not None:
        search = replace(search, steps=steps)
    if not objective.asked.in_batches:
        search = replace(search, longest=_CAREFUL)
    found = minimise(objective, start, search, give_up)
    if found is None and give_up:
        return None
    if found is None:
        # The law exists at the start, but not close to it.
        return Optimum(objective, start, success=False, message="no contact law beside the start")
    # No law was computed after the last step, which may lead to where there is none.
    known = objective.follows(found.vector, found.point.square) or objective.exists(found.vector)
    vector = found.vector if known else found.point.vector
    return Optimum(objective, vector, found.success, found.message)


def by_lmfit(objective: Objective, lmfit: Minimiser, start: FloatArray) -> Optimum:
    """The optimum that lmfit finds from a scaled vector (k,), with lmfit's result."""
    vector, result = lmfit(objective, start)
    return Optimum(objective, vector, bool(result.success), str(result.message), lmfit, result)
