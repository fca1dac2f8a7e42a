"""How a sampling went, its predictive bands, and what the data told beyond the prior.

How a sampling went, for the record and for a verdict.

Posterior predictive bands: where the model, and a new reading, lie once the data are known.

Did the data tell anything about a parameter? Its posterior against its prior.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.misfit.blocked import clock_of
from underlay.inference.misfit.marginal import MarginalLikelihood
from underlay.inference.model.groups import Readings
from underlay.inference.model.members import Member
from underlay.inference.problem import Problem
from underlay.inference.ridge.importance import Importance
from underlay.inference.sampling.convergence import effective_size, highest_density_interval
from underlay.scene.noise import NoiseModel

__all__ = [
    "INFORMED",
    "INFORMED_COLUMNS",
    "NOT_INFORMED",
    "PREDICTIVE_LEVELS",
    "WEAKLY_INFORMED",
    "Information",
    "Predictive",
    "SamplingDiagnostics",
    "compare_with_prior",
    "predictive_bands",
    "prior_levels",
]


@dataclass(frozen=True)
class SamplingDiagnostics:
    """How the sampling went.

    Parameters
    ----------
    converged : bool
        Whether the stop rule was met: longer than 50 autocorrelation times, of the tails too, R-hat below 1.01, and
        2.5, 50 and 97.5 % quantiles known to 0.06 standard deviations, by the chain itself or by weighted draws
        that agree with it; of weighted draws alone, whether they were accepted.
    reason : str
        Why it stopped, in words.
    steps, burn_in, thin, walkers : int
        Steps taken, steps dropped at the start, steps per kept draw, walkers.
    autocorrelation_time : tuple of float
        Of each parameter (steps), after burn-in; empty for weighted draws.
    rhat : tuple of float
        Rank-normalised split R-hat of each parameter over the walkers, after burn-in; empty for weighted draws.
    acceptance : float
        Share of proposals accepted, after burn-in; of weighted draws, effective ones per draw.
    evaluations, failures : int
        Model evaluations, and how many of them failed inside the priors (each counted as impossible).
    failure_region : mapping of name to (low, high)
        Where they failed (SI), by parameter; empty where none did.
    seconds : float
        Time of this run, without what a resumed file already held.
    seed : int or None
        Seed of the generator, if one was given.
    model_error : float
        Relative error of the force that the contact law itself admits at the best fit.
    versions : mapping of str to str
        Of underlay and the libraries under it.
    method : str
        ``"emcee"`` where a chain was made, or ``"importance"`` for weighted draws alone.
    effective : tuple of float
        Effective draws of each parameter.
    quantile_errors : mapping of name to tuple of float
        Monte Carlo errors of the 2.5, 50 and 97.5 % quantiles, in standard deviations of the parameter.
    moves : mapping of str to float
        Share of proposals accepted by each move, over this run.
    importance : Importance or None
        What the weighted draws of a frozen mixture say; None where no mixture was found.
    weighted : bool
        Whether the draws are the weighted ones, resampled, several of each: a chain, if one was made, agreed with
        them and knew the quantiles less well.
    left_out : float
        What printed intervals leave out, over what they are asked to: below 1 where a fit's would (`Fit.interval`).
    """

    converged: bool
    reason: str
    steps: int
    burn_in: int
    thin: int
    walkers: int
    autocorrelation_time: tuple[float, ...]
    rhat: tuple[float, ...]
    acceptance: float
    evaluations: int
    failures: int
    failure_region: Mapping[str, tuple[float, float]]
    seconds: float
    seed: int | None
    model_error: float
    versions: Mapping[str, str]
    method: str = "emcee"
    effective: tuple[float, ...] = ()
    quantile_errors: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    moves: Mapping[str, float] = field(default_factory=dict)
    importance: Importance | None = None
    weighted: bool = False
    left_out: float = 1.0


#: Probabilities of the rows of a predictive band: 95 % and 68 % limits and the median.
PREDICTIVE_LEVELS = (0.025, 0.16, 0.5, 0.84, 0.975)


@dataclass(frozen=True, eq=False)
class Predictive:
    """Posterior predictive band of one curve.

    Parameters
    ----------
    depth, force : FloatArray
        The data (m, N), (n,).
    model : FloatArray
        (5, n): force of the model (N) at `PREDICTIVE_LEVELS`. Where nobody stated the noise it is that of the law
        with the drift, the jump and the creeping baseline that go with each draw.
    reading : FloatArray
        (5, n): the same of a new reading, noise included.
    """

    depth: FloatArray
    force: FloatArray
    model: FloatArray
    reading: FloatArray

    def coverage(self) -> float:
        """Share of the data inside the 95 % band of a new reading."""
        return float(np.mean((self.force >= self.reading[0]) & (self.force <= self.reading[-1])))


def predictive_bands(
    problem: Problem, physical: FloatArray, rng: np.random.Generator
) -> tuple[Predictive, ...]:
    """One band per curve from draws (draws, parameters), SI; draws without a law are left out."""
    readings = [member.readings(physical) for member in problem.members]
    possible = np.logical_and.reduce([own.possible for own in readings])
    off = _misfits(problem, physical[possible], rng)
    return tuple(
        _band(member, physical[possible], own, possible, misfit, rng)
        for member, own, misfit in zip(problem.members, readings, off, strict=True)
    )


def _misfits(
    problem: Problem, physical: FloatArray, rng: np.random.Generator
) -> Sequence[FloatArray | float]:
    """What the law of each curve is off by at its readings (N), (draws, n); zero where the noise was stated."""
    likelihood = problem.likelihood
    if not isinstance(likelihood, MarginalLikelihood):
        return [0.0] * len(problem.members)
    found = []
    for curve, at_blocks in zip(likelihood.blocked.curves, likelihood.misfit(physical, rng), strict=True):
        clock = clock_of(curve.member.curve)
        found.append(np.array([np.interp(clock, curve.time, own) for own in at_blocks]))
    return found


def _band(
    member: Member,
    physical: FloatArray,
    readings: Readings,
    possible: NDArray[np.bool_],
    misfit: FloatArray | float,
    rng: np.random.Generator,
) -> Predictive:
    contact, stiffness = readings.contact[possible], readings.stiffness[possible]
    force = readings.force[possible] + misfit
    noise = member.noise_of(physical)
    sigma = noise.sigma(contact, stiffness, member.curve.time)
    if member.scale_is_unknown:
        sigma = sigma * _scale_draws(member, noise, force, sigma, rng)[:, None]
    # One normal draw per point and posterior draw: the band is that of single readings, so the correlation
    # between neighbouring points does not enter.
    reading = force + sigma * rng.standard_normal(force.shape)
    return Predictive(
        depth=member.curve.depth,
        force=member.force,
        model=np.quantile(force, PREDICTIVE_LEVELS, axis=0),
        reading=np.quantile(reading, PREDICTIVE_LEVELS, axis=0),
    )


def _scale_draws(
    member: Member,
    noise: NoiseModel,
    force: FloatArray,
    sigma: FloatArray,
    rng: np.random.Generator,
) -> FloatArray:
    """Noise over `sigma`, (draws,), where its size was integrated out: sigma^2 is S / chi-squared(n)."""
    whitened = noise.whiten((member.force - force) / sigma, member.curve.time)
    square = np.einsum("dn,dn->d", whitened, whitened)
    return np.asarray(np.sqrt(square / rng.chisquare(whitened.shape[-1], size=len(square))))


INFORMED = "informed"


WEAKLY_INFORMED = "weakly informed"


NOT_INFORMED = "not informed by these data"


# Largest difference of the distribution functions. A normal posterior that is a third narrower than its
# normal prior, or a quarter of a standard deviation beside it, is 0.1 away from it; one 0.4 times as wide, or
# half a standard deviation beside it, 0.2.
_NOTHING = 0.1


_LITTLE = 0.2


# Ratio of the ends of a positive prior above which it is one over orders of magnitude.
_DECADES = 20.0


# 95 % point of the Kolmogorov distribution: what the noise of the draws alone makes of identical ones.
_KOLMOGOROV_95 = 1.358


class Information(NamedTuple):
    """Prior and posterior of one parameter side by side (SI)."""

    prior_median: float
    prior_low: float
    prior_high: float
    posterior_median: float
    posterior_low: float
    posterior_high: float
    narrowing: float
    distance: float
    informed: str


INFORMED_COLUMNS = list(Information._fields)


def prior_levels(count: int) -> FloatArray:
    """Middles of `count` equal shares of probability, (count,)."""
    return (np.arange(count) + 0.5) / count


def compare_with_prior(draws: FloatArray, prior_quantiles: FloatArray, inside: float = 0.95) -> Information:
    """Compare the draws of one parameter with its prior.

    Parameters
    ----------
    draws : FloatArray
        (draws, walkers).
    prior_quantiles : FloatArray
        (levels,): quantiles of the prior at `prior_levels`.
    inside : float
        Share of the draws that their 95 % interval holds.

    Returns
    -------
    Information
        ``narrowing`` is 1 minus the ratio of the 68 % widths, those of the logarithm where the prior of a positive
        parameter spans more than a factor of 20; ``distance`` the Kolmogorov distance of the two
        distributions, 0 for equal ones and 1 for disjoint ones. Below 0.1, or what the noise of the draws
        explains, the verdict is "not informed by these data", below 0.2 "weakly informed".
    """
    levels = prior_levels(len(prior_quantiles))
    ordered = np.sort(draws, axis=None)
    below = np.interp(ordered, prior_quantiles, levels, left=0.0, right=1.0)
    ranks = np.arange(ordered.size + 1) / ordered.size
    distance = float(max(np.max(ranks[1:] - below), np.max(below - ranks[:-1])))
    noise = _KOLMOGOROV_95 / np.sqrt(effective_size(draws))
    if distance < max(_NOTHING, noise):
        verdict = NOT_INFORMED
    else:
        verdict = WEAKLY_INFORMED if distance < _LITTLE else INFORMED
    prior68, posterior68 = _widths(prior_quantiles, ordered)
    prior95 = highest_density_interval(prior_quantiles, 0.95)
    posterior95 = highest_density_interval(ordered, inside)
    return Information(
        float(np.median(prior_quantiles)),
        *prior95,
        float(np.median(ordered)),
        *posterior95,
        narrowing=float(1.0 - posterior68 / prior68),
        distance=distance,
        informed=verdict,
    )


def _widths(prior: FloatArray, posterior: FloatArray) -> tuple[float, float]:
    """Widths of the 68 % intervals; on an even axis one over decades is as wide as its upper end is high."""
    low, high = np.quantile(prior, (0.025, 0.975))
    if low > 0.0 and high / low > _DECADES and posterior[0] > 0.0:
        prior, posterior = np.log(prior), np.log(posterior)
    ends = (highest_density_interval(draws, 0.68) for draws in (prior, posterior))
    first, second = (high - low for low, high in ends)
    return first, second
