"""Profile likelihood of one parameter, with all others optimised at each of its values.

For each value of the parameter the others are fitted again. With the noise fixed, the rise of the weighted sum of
squares S is t = S(q) - S_min, q being the scaled parameter, and an interval is where t stays below the quantile of
chi-square with one degree of freedom, or of F(1, n - k) where the size of the noise was estimated (n readings, k
parameters). Unlike a standard error it can be infinite on one side, and says so.

Where the curve has two optima (thin and soft, thick and stiff) the chi-square threshold is too small: the 95 %
intervals of such curves cover 88 to 91 % (`tests/studies/coverage.py`). `calibrate` takes the threshold from curves
simulated at the ends instead, as below.

Where the noise was not stated there is no single likelihood: the profile is then made of the ends of the
statistical intervals that `Fit.answer` states, at every level (a confidence curve: Birnbaum 1961,
doi:10.1080/01621459.1961.10482107, with z^2, level = 2 Phi(z) - 1, for the level). A parameter of the noise has its
own profile (`noise_profile`).

The profile is computed outwards from the optimum in steps of about half a standard deviation of z = sqrt(t), in
which it is nearly linear, and interpolated monotonically between the steps. lmfit's `conf_interval` looks for two
crossings and fails where one does not exist.

Calibration: with two optima, a bound nearby or a parameter the curve hardly shows, t, the rise of chi-square at the
true value above its minimum, is not distributed as chi-square. Its distribution is then found by simulation
(parametric bootstrap; Beran 1987, doi:10.1093/biomet/74.3.457; Davison and Hinkley 1997,
doi:10.1017/CBO9780511802843, equation 4.11): curves are simulated from the best fit that has the hypothesised value
(`redrawn`), fitted as the data were, and t of that value is computed in each. With N curves the value is inside the
interval of a level where its t in the data is at most the k-th smallest of those, k = ceil((N + 1) level).

The centre, the fit from which curves are simulated, is the constrained fit, not the free one: the error of the
level is then of higher order in the number of points (DiCiccio, Martin and Stern 2001, doi:10.2307/3316051). In 160
curves with two optima both centres covered alike within chance (`tests/studies/coverage.py`).

An interval would need this at every value. Its ends are where it matters (`calibrated`): curves are simulated at
the end that chi-square gives, then at the end that follows from them, and so on until the end stays; then at the
bottom of a basin beyond it that chi-square rejects and its own curves may not. Between these centres the root of
the threshold is linear in the scaled parameter, beyond them constant.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy import special

from underlay._arrays import FloatArray, read_only
from underlay._given import require_given
from underlay._threads import one_thread
from underlay.data.curve import Curve
from underlay.errors import FitError, InputError
from underlay.inference.least_squares import fit as least_squares_fit
from underlay.inference.least_squares.engine import minimise
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.least_squares.fitting import quick_fit
from underlay.inference.least_squares.models import freeze
from underlay.inference.least_squares.objective import Objective
from underlay.inference.least_squares.settle import most_likely, restricted_log_likelihood
from underlay.inference.model.coordinates import Coordinate
from underlay.inference.model.forward import Reading
from underlay.inference.priors import LogNormal, Normal, Prior, Truncated
from underlay.inference.problem import Problem
from underlay.inference.profiling.profile_result import (
    HIGHEST,
    Calibration,
    Draws,
    LikelihoodProfile,
    require_chance,
    require_draws,
)
from underlay.inference.profiling.walk import constrained_fit, index_of, missed, outwards, walked
from underlay.scene.noise import NoiseModel

# Most alternations between model and noise (they are orthogonal for a Gaussian, and the second changes little), and
# the change of a scaled coordinate below which they end.
_MOST_ROUNDS = 5
_SETTLED = 1e-4
# Share of curves that cannot be fitted and are left out; with more of them what is left is a selection.
_MOST_FAILURES = 0.1
_MOST_CENTRES = 5  # centres of one end; one or two are usual
# Distance from a centre, over the half-width of the interval, within which the threshold there serves. It changes
# by a few tenths of its size over a half-width, its own chance with a hundred curves is a tenth.
_CLOSE = 0.1
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
    below, above = (_side(fit, index, -2.0 * best, direction) for direction in (-1.0, 1.0))
    vectors = np.array([*below[0][:0:-1], *above[0]])
    rises = np.array([*below[1][:0:-1], *above[1]])
    return LikelihoodProfile(
        name=name,
        fit=fit,
        values=read_only(fit.problem.coordinates[index].physical(vectors[:, index])),
        delta_chi_square=read_only(np.maximum(rises, 0.0)),
        vectors=read_only(vectors),
        ends=(below[2], above[2]),
    )


def _side(fit: Fit, index: int, base: float, direction: float) -> tuple[list[FloatArray], list[float], str]:
    """One side of a noise profile: vectors and rises t outwards from the fit, and why the side ends."""
    vectors, rises = [fit.vector], [0.0]
    places = vectors, rises
    reason = outwards(
        fit, index, base, places, direction, HIGHEST, lambda q: _held(fit, vectors[-1], index, q)
    )
    return vectors, rises, reason


class _Held(NamedTuple):
    """A scaled vector (k,) with a noise parameter held, and minus twice its restricted log-likelihood."""

    vector: FloatArray
    square: float


def _held(fit: Fit, start: FloatArray, index: int, q: float) -> _Held:
    """The vector (k,) optimised with entry `index` at q."""
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
            return _Held(found, -2.0 * restricted_log_likelihood(problem, found, linear))
        renewed = most_likely(problem, found, others, linear)
        settled = bool((np.abs(renewed - vector) < _SETTLED).all())
        vector = renewed
        if settled:
            break
    return _Held(vector, -2.0 * restricted_log_likelihood(problem, vector, linear))


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


# --- calibration by simulated curves ---------------------------------------------------------------------------


def redrawn(
    problem: Problem, vector: FloatArray, noises: Sequence[NoiseModel], rng: np.random.Generator
) -> Problem:
    """Return the problem with simulated data, of which the scaled vector (k,) is the truth.

    Every curve gets new noise on the model's force, as the likelihood assumes it (a depth error through the
    stiffness), and every prior that is a measurement is measured again: drawn about the vector's value with the
    prior's own uncertainty, as the curve is.

    Parameters
    ----------
    problem : Problem
        The problem with the measured curves.
    vector : FloatArray
        True scaled parameters of the simulated curves, (k,).
    noises : sequence of Noise
        Noise of every curve, its size known.
    rng : numpy Generator
        Random generator.
    """
    physical = problem.physical(vector)
    tests = []
    for member, noise in zip(problem.members, noises, strict=True):
        reading = member.reading(physical)
        drawn = noise.sample(rng, member.sigma(reading, noise), member.curve.time)
        tests.append(
            (
                member.scene,
                Curve(member.curve.depth, reading.force + drawn, member.curve.time, member.curve.segment),
            )
        )
    free = {
        coordinate.name: _measured_again(coordinate.prior, float(value), rng)
        for coordinate, value in zip(problem.coordinates, physical, strict=True)
    }
    return Problem.joint(
        tests,
        free,
        problem.shared,
        problem.noise,
        solver=problem.solver,
    )


def _measured_again(prior: Prior, value: float, rng: np.random.Generator) -> Prior:
    """Draw the centre of a prior that is a measurement about the true `value` (SI); return any other unchanged."""
    if isinstance(prior, Normal):
        return replace(prior, mean=value + prior.sd * rng.standard_normal())
    if isinstance(prior, LogNormal):
        return replace(prior, median=value * np.exp(prior.sigma * rng.standard_normal()))
    if isinstance(prior, Truncated):
        return replace(prior, prior=_measured_again(prior.prior, value, rng))
    return prior


def rises_at_truth(fit: Fit, name: str, value: float, draws: int, seed: int) -> Iterator[float]:
    """Rises t of chi-square at a value (SI), in curves simulated from the best fit that has this value.

    t is the sum of squares with the parameter held at the value, less its minimum; NaN where a curve cannot be
    fitted. Parameters are those of `draw_delta_chi_squares`.
    """
    _, centre = constrained_fit(fit, name, value)
    for number in range(draws):
        again = redrawn(fit.problem, centre, fit.noises, np.random.default_rng([seed, number]))
        truth = again.vector(fit.problem.values(centre))
        try:
            found = quick_fit(again)
            yield constrained_fit(found, name, value, truth)[0] - missed(found, truth)
        except (FitError, InputError):
            yield np.nan


def draw_delta_chi_squares(fit: Fit, name: str, value: float, draws: int, seed: int) -> Draws:
    """Simulate curves from the best fit that has a value (SI) of a parameter, and give their rises of chi-square.

    Parameters
    ----------
    fit : Fit
        The fit of the data.
    name : str
        The parameter.
    value : float
        Its hypothesised value (SI).
    draws : int
        How many curves.
    seed : int
        Curve number b is simulated from the seed (seed, b), whatever the hypothesis, so that neighbouring values
        use the same random numbers.

    Raises
    ------
    InputError
        As `constrained_fit`, or if a number is not allowed.
    FitError
        If more than a tenth of the curves cannot be fitted.
    """
    require_chance(draws, seed)
    rises = np.array(list(rises_at_truth(fit, name, value, draws, seed)))
    failures = int(np.isnan(rises).sum())
    if failures > _MOST_FAILURES * draws:
        raise FitError(
            f"{failures} of {draws} curves drawn at {name} = {value!r} could not be fitted: the fit is too close "
            "to where no law exists to be calibrated"
        )
    return Draws(value, read_only(np.sort(rises[np.isfinite(rises)])), failures)


def calibrated(walked: LikelihoodProfile, level: float, draws: int, seed: int) -> LikelihoodProfile:
    """Return the profile with thresholds from curves simulated at the ends of its interval.

    Parameters
    ----------
    walked : LikelihoodProfile
        Without calibration.
    level : float
        Confidence of the interval.
    draws, seed : int
        Curves per centre, and the seed of their random numbers.

    Raises
    ------
    InputError, FitError
        As `draw_delta_chi_squares`, or if there are too few curves for the level.
    """
    result = replace(walked, calibration=Calibration(level, draws, seed))
    for upper in (False, True):
        result = _with_end(result, level, draws, seed, upper=upper)
    return result


def _with_end(
    profile: LikelihoodProfile, level: float, draws: int, seed: int, *, upper: bool
) -> LikelihoodProfile:
    centres: tuple[Draws, ...] = ()
    for _ in range(_MOST_CENTRES):
        value = _next_place(profile, centres, level, upper=upper)
        if value is None:
            break
        centres = (*centres, draw_delta_chi_squares(profile.fit, profile.name, value, draws, seed))
        calibration = profile.calibration or Calibration(level, draws, seed)
        profile = replace(profile, calibration=calibration.with_side(centres, upper=upper))
    return profile


def _next_place(
    profile: LikelihoodProfile, centres: Sequence[Draws], level: float, *, upper: bool
) -> float | None:
    """Next value (SI) of the parameter at which to simulate curves for one end; None if no more are needed.

    `centres` are the simulations made so far for this end.
    """
    value, reason = profile.end_of_hull(level, upper=upper)
    # Where the data set no end there is no value to simulate curves at; the side stays open.
    if reason != "data":
        return None
    scaled = profile.fit.problem.coordinates[profile.index].scaled
    known = sorted(scaled(centre.value) for centre in centres)
    near = _CLOSE * abs(scaled(value) - float(profile.fit.vector[profile.index]))
    if not known or not known[0] - near <= scaled(value) <= known[-1] + near:
        return value
    for bottom in profile.bottoms_beyond(value, upper=upper):
        if min(abs(scaled(bottom) - place) for place in known) > near:
            return bottom
    return None
