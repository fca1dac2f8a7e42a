"""Thresholds of a profile from simulated curves, where the likelihood ratio does not follow chi-square.

With two optima, a bound nearby or a parameter the curve hardly shows, t, the rise of chi-square at the true value
above its minimum, is not distributed as chi-square. Its distribution is then found by simulation (parametric
bootstrap; Beran 1987, doi:10.1093/biomet/74.3.457; Davison and Hinkley 1997, doi:10.1017/CBO9780511802843, equation
4.11): curves are simulated from the best fit that has the hypothesised value (`redrawn`), fitted as the data were,
and t of that value is computed in each. With N curves the value is inside the interval of a level where its t in
the data is at most the k-th smallest of those, k = ceil((N + 1) level).

The centre, the fit from which curves are simulated, is the constrained fit, not the free one: the error of the
level is then of higher order in the number of points (DiCiccio, Martin and Stern 2001, doi:10.2307/3316051). In 160
curves with two optima both centres covered alike within chance (`tests/studies/coverage.py`).

An interval would need this at every value. Its ends are where it matters (`calibrated`): curves are simulated at
the end that chi-square gives, then at the end that follows from them, and so on until the end stays; then at the
bottom of a basin beyond it that chi-square rejects and its own curves may not. Between these centres the root of
the threshold is linear in the scaled parameter, beyond them constant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from underlay._arrays import FloatArray, read_only
from underlay.data.curve import Curve
from underlay.errors import FitError, InputError
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.least_squares.fitting import quick_fit
from underlay.inference.least_squares.models import freeze
from underlay.inference.least_squares.objective import Objective
from underlay.inference.priors import LogNormal, Normal, Prior, Truncated
from underlay.inference.problem import Problem
from underlay.inference.profiling.profile_result import Calibration, Draws, LikelihoodProfile, require_chance
from underlay.inference.profiling.walked import constrained_fit, delta_chi_square_at, missed
from underlay.scene.noise import NoiseModel

# Share of curves that cannot be fitted and are left out; with more of them what is left is a selection.
_MOST_FAILURES = 0.1
_MOST_CENTRES = 5  # centres of one end; one or two are usual
# Distance from a centre, over the half-width of the interval, within which the threshold there serves. It changes
# by a few tenths of its size over a half-width, its own chance with a hundred curves is a tenth.
_CLOSE = 0.1


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


def draw_delta_chi_squares(
    fit: Fit, name: str, value: float, draws: int, seed: int, *, beyond: tuple[float, int] | None = None
) -> Draws:
    """Rise t of chi-square at a value (SI), in curves simulated from the best fit that has this value.

    t is the sum of squares with the parameter held at the value, less its minimum.

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
    beyond : (float, int), optional
        Only count rises of at least this size, and stop after so many: where a smaller one is certain without it,
        the fit with the parameter held is not made, and its rise is an upper bound.

    Raises
    ------
    InputError
        As `delta_chi_square_at`, or if a number is not allowed.
    FitError
        If more than a tenth of the curves cannot be fitted.
    """
    require_chance(draws, seed)
    least, most = (0.0, draws) if beyond is None else beyond
    _, centre = constrained_fit(fit, name, value)
    rises: list[float] = []
    failures, reached = 0, 0
    for number in range(draws):
        again = redrawn(fit.problem, centre, fit.noises, np.random.default_rng([seed, number]))
        try:
            rise = _delta_chi_square_of_truth(
                again, name, value, again.vector(fit.problem.values(centre)), least
            )
        except (FitError, InputError):
            failures += 1
            continue
        rises.append(rise)
        reached += rise >= least
        if reached >= most:
            break
    if failures > _MOST_FAILURES * (failures + len(rises)):
        raise FitError(
            f"{failures} of {failures + len(rises)} curves drawn at {name} = {value!r} could not be fitted: "
            "the fit is too close to where no law exists to be calibrated"
        )
    return Draws(value, read_only(np.sort(rises)), failures)


def _delta_chi_square_of_truth(
    problem: Problem, name: str, value: float, truth: FloatArray, least: float
) -> float:
    """Rise t of chi-square in a simulated problem at the true value of one parameter; an upper bound below `least`.

    Parameters
    ----------
    problem : Problem
        The simulated problem.
    name, value : str, float
        The parameter and its true value (SI).
    truth : FloatArray
        True scaled vector, (k,).
    least : float
        Rises below this need not be exact.
    """
    fit = quick_fit(problem)
    objective = Objective(fit.problem, freeze(fit.problem, fit.vector, fit.noises))
    at_truth, at_fit = objective.square(truth), objective.square(fit.vector)
    below = missed(fit, truth)
    # With all parameters at the truth the curve fits at most as well as with only this one there.
    bound = at_truth - at_fit - below
    return bound if bound < least else constrained_fit(fit, name, value, truth)[0] - below


def p_value_at(
    fit: Fit, name: str, value: float, draws: int = 99, seed: int = 0, *, enough: int | None = None
) -> float:
    """p-value of one value (SI) of a parameter: the share of curves simulated there that fit it as badly.

    (1 + number of rises of chi-square at least as large) / (draws + 1); a calibrated interval of level 1 - p holds
    the values with more than p.

    Parameters
    ----------
    fit : Fit
        The fit of the data.
    name : str
        The parameter.
    value : float
        Its hypothesised value (SI).
    draws, seed : int
        How many curves, and the seed of their random numbers.
    enough : int, optional
        Stop after this many rises at least as large, and return their share of the curves simulated so far (Besag
        and Clifford 1991, doi:10.1093/biomet/78.2.301): whether the share of all would be above `enough` / (`draws`
        + 1) is then already known.

    Raises
    ------
    InputError, FitError
        As `draw_delta_chi_squares`.
    """
    here = delta_chi_square_at(fit, name, value)
    drawn = draw_delta_chi_squares(fit, name, value, draws, seed, beyond=(here, enough or draws))
    worse = int(np.sum(drawn.delta_chi_squares >= here))
    if enough is not None and worse >= enough:
        return worse / len(drawn.delta_chi_squares)
    return (1 + worse) / (1 + len(drawn.delta_chi_squares))


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
