"""Profile likelihood of one parameter, with all others optimised at each of its values.

For each value of the parameter the others are fitted again. With the noise fixed, the rise of the weighted sum of
squares S is t = S(q) - S_min, q being the scaled parameter, and an interval is where t stays below the quantile of
chi-square with one degree of freedom, or of F(1, n - k) where the size of the noise was estimated (n readings, k
parameters). Unlike a standard error it can be infinite on one side, and says so.

Where the curve has two optima (thin and soft, thick and stiff) the chi-square threshold is too small: the 95 %
intervals of such curves cover 88 to 91 % (`tests/studies/coverage.py`). `calibrate` takes the threshold from curves
simulated at the ends instead; see `profiling/calibrated_profile.py`.

Where the noise was not stated there is no single likelihood: the profile is then made of the ends of the
statistical intervals that `Fit.answer` states, at every level (a confidence curve: Birnbaum 1961,
doi:10.1080/01621459.1961.10482107, with z^2, level = 2 Phi(z) - 1, for the level). A parameter of the noise has its
own profile (`noise_profile`).

The profile is computed outwards from the optimum in steps of about half a standard deviation of z = sqrt(t), in
which it is nearly linear, and interpolated monotonically between the steps. lmfit's `conf_interval` looks for two
crossings and fails where one does not exist.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy import special

from underlay._arrays import FloatArray, read_only
from underlay._given import require_given
from underlay._threads import one_thread
from underlay.inference.least_squares import fit as least_squares_fit
from underlay.inference.least_squares.engine import minimise
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.least_squares.models import freeze
from underlay.inference.least_squares.objective import Objective
from underlay.inference.least_squares.settle import most_likely, restricted_log_likelihood
from underlay.inference.model.coordinates import Coordinate
from underlay.inference.model.forward import Reading
from underlay.inference.problem import Problem
from underlay.inference.profiling.calibrated_profile import calibrated
from underlay.inference.profiling.profile_result import (
    LikelihoodProfile,
    require_draws,
)
from underlay.inference.profiling.walk import HIGHEST
from underlay.inference.profiling.walked import index_of, walked
from underlay.scene.noise import NoiseModel

# Steps of a noise profile, as in `walk.py`: step in z = sqrt(t); rise of z in one step beyond which a shorter step
# is tried; largest growth of a step; farthest scaled coordinate (a factor 1.6e5); most steps.
_STEP = 0.5
_STEEPEST = 2.0 * _STEP
_GROWTH = 2.0
_FARTHEST = 12.0
_MOST_STEPS = 60
# Most alternations between model and noise (they are orthogonal for a Gaussian, and the second changes little), and
# the change of a scaled coordinate below which they end.
_MOST_ROUNDS = 5
_SETTLED = 1e-4
# z to which a profile is computed where its threshold is not known beforehand.
_HIGHEST_CALIBRATED = 6.0
# Standard deviates of the levels whose interval ends are computed, up to 99.9 %; those of 68 and 95 % are among
# them.
_HEIGHTS = np.array([0.25, 0.5, 0.75, special.ndtri(0.84), 1.4, 1.7, special.ndtri(0.975), 2.4, 2.9, 3.29])


@one_thread()
def profile(
    problem: Problem | Fit, name: str, *, calibrate: int = 0, level: float = 0.95, seed: int = 0
) -> LikelihoodProfile:
    """Profile likelihood of one parameter.

    Parameters
    ----------
    problem : Problem or Fit
        A problem is fitted first.
    name : str
        The parameter, as in `Problem.names`. The profile of a parameter of the noise, such as
        ``"noise.correlation_time"``, is that of the restricted likelihood; those of others keep the fit's noise.
    calibrate : int, default 0
        Number of curves that are simulated and fitted at each of two or three places per end, so that the interval
        has its coverage where the chi-square threshold does not: 99 are usual, 19 the fewest for 95 %. None by
        default.
    level : float, default 0.95
        Confidence whose ends are calibrated.
    seed : int, default 0
        Seed of the simulated curves: the same seed gives the same interval.

    Returns
    -------
    LikelihoodProfile
        Its `basis` says which threshold was used and why.

    Raises
    ------
    InputError
        If the parameter is not free, there are too few curves for the level, or a parameter of the noise is to be
        calibrated.
    FitError
        If too many of the simulated curves cannot be fitted.
    """
    require_given(problem, "problem", Problem, Fit)
    fit = least_squares_fit(problem) if isinstance(problem, Problem) else problem
    if name in fit.names and name.startswith("noise.") and not calibrate:
        return noise_profile(fit, name)
    index_of(fit, name)
    if calibrate:
        require_draws(calibrate, level, seed)
    elif fit.problem.noise_is_open and fit.statistics.robust == "none":
        return _of_answers(fit, name)
    found = _walked(fit, name, _HIGHEST_CALIBRATED if calibrate else HIGHEST)
    return calibrated(found, level, calibrate, seed) if calibrate else found


def _of_answers(fit: Fit, name: str) -> LikelihoodProfile:
    """Profile made of the ends of the statistical intervals at several levels."""
    index = fit.names.index(name)
    coordinate = fit.problem.coordinates[index]
    middle = coordinate.scaled(fit.answer(name).value)
    parts = [fit.interval(name, float(2.0 * special.ndtr(z) - 1.0), part="statistical") for z in _HEIGHTS]
    (below, low, low_reason), (above, high, high_reason) = (
        _ends_outwards(coordinate, middle, [part.high if upper else part.low for part in parts], upper=upper)
        for upper in (False, True)
    )
    q = np.array([*below[::-1], middle, *above])
    vectors = np.tile(fit.vector, (len(q), 1))
    vectors[:, index] = q
    return LikelihoodProfile(
        name=name,
        fit=fit,
        values=read_only(np.asarray(coordinate.physical(q))),
        delta_chi_square=read_only(np.square([*low[::-1], 0.0, *high])),
        vectors=read_only(vectors),
        ends=(low_reason, high_reason),
        averaged=True,
    )


def _ends_outwards(
    coordinate: Coordinate, middle: float, ends: Sequence[float], *, upper: bool
) -> tuple[list[float], list[float], str]:
    """One side of a profile made of the ends (SI) of intervals at growing levels.

    Returns the scaled ends that lie further out than the one before, their heights, and why the side ends.
    """
    bound = coordinate.high if upper else coordinate.low
    places: list[float] = []
    heights: list[float] = []
    last = middle
    for end, height in zip(ends, _HEIGHTS.tolist(), strict=True):
        if not math.isfinite(end):
            return places, heights, "none"
        if end == bound == 0.0 and coordinate.scale is None:
            return places, heights, "bound"
        at = coordinate.scaled(end)
        if (at > last) if upper else (at < last):
            places.append(at)
            heights.append(height)
            last = at
        if end == bound:
            return places, heights, "bound"
    return places, heights, "data"


def _walked(fit: Fit, name: str, highest: float) -> LikelihoodProfile:
    found, better = walked(fit, name, highest)
    if better is not None:
        # A lower minimum was found on the way: start again from there.
        again = _refit(fit, better)
        if again.statistics.chi_square < fit.statistics.chi_square:
            return _walked(again, name, highest)
    return found


def _refit(fit: Fit, vector: FloatArray) -> Fit:
    problem = fit.problem
    moved = problem.revised(scenes=problem.scenes(vector))
    return least_squares_fit(moved, start="given")


def noise_profile(fit: Fit, name: str) -> LikelihoodProfile:
    """Profile of a parameter of the noise: its restricted likelihood, with all other parameters optimised.

    The rise t is twice the decrease of the restricted log-likelihood (`least_squares/settle.py`) from its maximum,
    with the other parameters of the noise at their most likely values and the model fitted again under each. Its
    threshold is chi-square's: for white noise that makes the interval of sigma the one of (n - k) s^2 / sigma^2 (s
    the estimated standard deviation, n readings, k parameters), which is chi-square with n - k degrees of freedom,
    to order 1 / (n - k).

    Parameters
    ----------
    fit : Fit
        A fit with the parameter free.
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
    """One side of a noise profile: vectors and rises t outwards from the fit, and why the side ends."""
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
        # A parameter that others can replace may have its best value far out on a plateau, from which it must come
        # back.
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
    """The vector (k,) optimised with entry `index` at q, and its restricted log-likelihood."""
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
    """Noise of every curve at a vector; where its size is no parameter, that estimated by the fit."""
    return [
        noise.of_size(float(fitted.sigma(member.force)[0])) if member.scale_is_unknown else noise
        for member, noise, fitted in zip(
            fit.problem.members, fit.problem.noises(vector), fit.noises, strict=True
        )
    ]


def _linear(problem: Problem, vector: FloatArray) -> list[tuple[Reading, FloatArray]]:
    """Readings of the model for every curve, and their derivatives (n, k) in SI."""
    physical = problem.physical(vector)
    return [member.jacobian(physical) for member in problem.members]
