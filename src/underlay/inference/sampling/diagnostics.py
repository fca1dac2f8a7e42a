"""Convergence of posterior draws, predictive bands, and comparison of prior and posterior.

A chain is an array (steps, walkers) of one quantity; each walker counts as a chain. Its correlation is measured by
emcee's autocorrelation time (Goodman and Weare 2010, doi:10.2140/camcos.2010.5.65), and the error of a quantile by
the scatter of the walkers; R-hat and effective sizes are ArviZ's, where that is installed (extra ``uq``): Vehtari,
Gelman, Simpson, Carpenter and Buerkner (2021), doi:10.1214/20-BA1221.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import ModuleType
from typing import NamedTuple

import emcee
import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import MissingExtraError, missing_extra
from underlay.inference.model.members import Member
from underlay.inference.model.parameter_sets import Readings
from underlay.inference.problem import Problem
from underlay.inference.uncertainty.mixture import weighted_quantiles
from underlay.scene.noise import NoiseModel

#: Fewest steps for which halves of a chain have a variance and an autocorrelation.
MIN_STEPS = 8
#: Quantiles of a parameter whose errors are stated.
LEVELS = (0.025, 0.5, 0.975)
#: Probabilities of the rows of a predictive band: 95 % and 68 % limits and the median.
PREDICTIVE_LEVELS = (0.025, 0.16, 0.5, 0.84, 0.975)
#: Verdicts of `compare_with_prior`.
DETERMINED, WEAKLY_DETERMINED = "informed", "weakly informed"
UNDETERMINED = "not informed by these data"

# Convergence of a chain: its length in autocorrelation times (emcee's advice), R-hat (advice of its source), and
# the error of a quantile in standard deviations: one known to 0.06 is hardly ever off by 0.15.
_TIMES_NEEDED, _RHAT_NEEDED, _LARGEST_ERROR = 50.0, 1.01, 0.06
# Burn-in in autocorrelation times: the walkers' correlation with their start decays as exp(-t / tau), and ten times
# leave 5e-5 of it.
_BURN_IN_TIMES = 10.0
# Largest distance between the distribution functions of prior and posterior for "not informed" and for "weakly
# informed". A normal posterior that is a third narrower than its normal prior, or shifted by a quarter of a
# standard deviation, is 0.1 away from it; one 0.4 times as wide, or shifted by half a standard deviation, 0.2. The
# third: 95 % point of the Kolmogorov distribution, for identical distributions by the noise of the draws alone.
_NOTHING, _LITTLE, _KOLMOGOROV_95 = 0.1, 0.2, 1.358
# Ratio of the ends of a positive prior above which its width is taken in the logarithm.
_DECADES = 20.0


# --- records ----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Importance:
    """How well weighted draws represent a posterior.

    Parameters
    ----------
    draws : int
        Number of draws.
    effective : float
        Kish's effective sample size.
    k_hat : float
        Tail index of the weights (Pareto); above 0.7 they cannot be trusted.
    log_evidence, log_evidence_error : float or None
        Natural logarithm of the evidence and its standard error; None where no noise was stated.
    quantile_error : float
        Largest Monte Carlo error of a 2.5, 50 or 97.5 % quantile, in standard deviations of the posterior.
    refused : str
        Why the weights are not trusted; empty where they are.
    disagreement : str
        In words, where a chain and the weighted draws differ by more than their errors; empty where they do not.
    """

    draws: int
    effective: float
    k_hat: float
    log_evidence: float | None
    log_evidence_error: float | None
    quantile_error: float
    refused: str
    disagreement: str = ""

    @property
    def stands(self) -> bool:
        """Whether the weighted draws are trusted and agree with the chain, if there is one."""
        return not (self.refused or self.disagreement)


@dataclass(frozen=True)
class SamplingDiagnostics:
    """How the sampling went.

    Parameters
    ----------
    converged : bool
        Whether the draws can be trusted. Of a chain: longer than 50 autocorrelation times and, where ArviZ is
        installed, R-hat below 1.01; 2.5, 50 and 97.5 % quantiles known to 0.06 standard deviations. Of weighted
        draws: a Pareto k below 0.7, and no chain that differs from them.
    reason : str
        Why it stopped, in words.
    steps, burn_in, thin, walkers : int
        Steps taken, steps dropped at the start, steps per kept draw, walkers; where a chain checks weighted draws,
        those of that chain.
    autocorrelation_time : tuple of float
        Integrated autocorrelation time of each parameter (steps), after burn-in; empty without a chain.
    rhat : tuple of float
        Rank-normalised split R-hat of each parameter over the walkers, after burn-in; empty where it was not
        computed or ArviZ is not installed.
    acceptance : float
        Share of proposals accepted, after burn-in; without a chain effective draws per draw.
    evaluations, failures : int
        Model evaluations, and how many of them failed inside the priors (each taken as of zero probability).
    failure_region : mapping of name to (low, high)
        Range of each parameter (SI) over the failures; empty where there were none.
    seconds : float
        Time of this run, without what a resumed file already held.
    seed : int or None
        Seed of the generator, if one was given.
    model_error : float
        Relative error of the force that the contact law states for itself at the best fit.
    versions : mapping of str to str
        Versions of underlay and the libraries it uses.
    method : str
        ``"emcee"`` where a chain was made, or ``"importance"`` for weighted draws alone.
    effective : tuple of float
        Effective draws of each parameter.
    quantile_errors : mapping of name to tuple of float
        Monte Carlo errors of the 2.5, 50 and 97.5 % quantiles, in standard deviations of the parameter.
    importance : Importance or None
        How well weighted draws represent the posterior; None for a chain that was made elsewhere.
    weighted : bool
        Whether the draws are the weighted ones, resampled with repetition.
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
    importance: Importance | None = None
    weighted: bool = False


class Outcome(NamedTuple):
    """State of a chain: length, burn-in, and for the steps after it autocorrelation times and R-hat, (p,) each.

    `quantile_errors` (3, p) are Monte Carlo errors of the 2.5, 50 and 97.5 % quantiles in standard deviations of
    the parameter; `converged` and `reason` are the verdict.
    """

    steps: int
    walkers: int
    burn_in: int
    times: FloatArray
    rhat: FloatArray
    quantile_errors: FloatArray
    converged: bool
    reason: str

    @property
    def effective(self) -> FloatArray:
        """Effective number of draws of each parameter, (p,), of all walkers together."""
        return np.asarray((self.steps - self.burn_in) * self.walkers / self.times)

    @property
    def probable_length(self) -> int:
        """Estimated steps to convergence: R-hat of single walkers falls below 1.01 after about 100 of `times`."""
        return max(
            self.steps, int((2.0 * _TIMES_NEEDED + _BURN_IN_TIMES) * min(self.times.max(), self.steps))
        )


# --- convergence ------------------------------------------------------------------------------------------


def arviz_library() -> ModuleType:
    """Import ArviZ, 0.x or 1.x.

    Raises
    ------
    MissingExtraError
        If it is not installed.
    """
    try:
        return _imported()
    except FileNotFoundError:
        # arviz records in the user's cache on which day it last warned. Where two processes import it at the same
        # moment, the second finds its temporary file gone; by then the record is in its place.
        return _imported()


def _imported() -> ModuleType:
    try:
        with warnings.catch_warnings():
            # arviz announces its next major version at import, which is not the caller's concern.
            warnings.simplefilter("ignore", FutureWarning)
            import arviz  # noqa: PLC0415  # an optional extra
    except ImportError as error:
        raise missing_extra("this needs arviz", "uq") from error
    module: ModuleType = arviz
    return module


def _arviz() -> ModuleType | None:
    try:
        return arviz_library()
    except MissingExtraError:
        return None


def autocorrelation_times(chain: FloatArray) -> FloatArray:
    """Integrated autocorrelation times (p,), in steps, of a chain (steps, walkers, p).

    Walkers that never move are left out; a parameter in which none moves gives inf.
    """
    moving = np.ptp(chain, axis=0) > 0.0
    return np.array(
        [
            float(emcee.autocorr.integrated_time(chain[:, own, i], tol=0)[0]) if own.any() else np.inf
            for i, own in enumerate(moving.T)
        ]
    )


def rank_normalised_rhat(chain: FloatArray) -> float:
    """ArviZ's R-hat of one quantity (steps, walkers); nan without ArviZ, or for a constant chain."""
    arviz = _arviz()
    return np.nan if arviz is None or not np.ptp(chain) > 0.0 else float(arviz.rhat(chain.T))


def effective_size(chain: FloatArray) -> float:
    """Effective number of independent draws of one quantity (steps, walkers).

    ArviZ's bulk effective sample size, or without ArviZ the number of draws over the autocorrelation time.
    """
    arviz = _arviz()
    if arviz is None:
        return float(chain.size / autocorrelation_times(chain[..., None])[0])
    return float(arviz.ess(chain.T, method="bulk"))


def quantile_errors(draws: FloatArray, weights: FloatArray, share_errors: FloatArray) -> FloatArray:
    """Monte Carlo errors (3, p) of the quantiles at `LEVELS`, in standard deviations.

    Parameters
    ----------
    draws, weights : FloatArray
        Draws (n, p) and their weights (n,), which sum to 1.
    share_errors : FloatArray
        Standard errors (3, p) of the probability below each quantile.

    Returns
    -------
    FloatArray
        Half the distance between the quantiles one such error below and above; nan where all draws are equal.
    """
    found = np.empty(share_errors.shape)
    for i, values in enumerate(draws.T):
        shares = np.add.outer([-1.0, 1.0], np.zeros(len(LEVELS))) * share_errors[:, i] + np.array(LEVELS)
        low, high = weighted_quantiles(values, weights, np.clip(shares, 0.0, 1.0).ravel()).reshape(2, -1)
        deviation = float(np.sqrt(weights @ np.square(values - weights @ values)))
        found[:, i] = 0.5 * (high - low) / deviation if deviation > 0.0 else np.nan
    return found


def chain_errors(kept: FloatArray) -> FloatArray:
    """Monte Carlo errors (3, p), as `quantile_errors`, of a chain (steps, walkers, p).

    The error of the probability below a quantile is the scatter of the walkers' shares over the root of their
    number: walkers that stay far out for long hardly lengthen the autocorrelation time of the quantity itself.
    """
    flat = kept.reshape(-1, kept.shape[-1])
    below = kept <= np.quantile(flat, LEVELS, axis=0)[:, None, None]
    errors = below.mean(axis=1).std(axis=1, ddof=1) / kept.shape[1] ** 0.5
    return quantile_errors(flat, np.full(len(flat), 1.0 / len(flat)), errors)


def memory(coords: FloatArray) -> tuple[int, FloatArray]:
    """Number of burn-in steps of a chain (steps, walkers, p), and the autocorrelation times (p,) of the rest."""
    steps = len(coords)
    late = float(autocorrelation_times(coords[steps // 2 :]).max())
    burn_in = min(steps // 2, int(np.ceil(_BURN_IN_TIMES * min(late, steps))))
    return burn_in, autocorrelation_times(coords[burn_in:])


def judge(coords: FloatArray, max_steps: int) -> Outcome:
    """Judge the convergence of a chain in scaled coordinates, (steps, walkers, p), of at most `max_steps`.

    It has converged if it is long against its autocorrelation time, R-hat is near 1 and quantiles are accurate.
    R-hat and quantile errors cost more than the autocorrelations: they are nan while the chain is too short in any
    case.
    """
    steps, walkers, parameters = coords.shape
    burn_in, times = memory(coords)
    kept = coords[burn_in:]
    long_enough = len(kept) > _TIMES_NEEDED * times.max()
    rhat, errors = np.full(parameters, np.nan), np.full((len(LEVELS), parameters), np.nan)
    if long_enough or steps >= max_steps:
        rhat = np.array([rank_normalised_rhat(kept[..., i]) for i in range(parameters)])
        errors = chain_errors(kept)
    # Without ArviZ R-hat is nan, and is not used.
    mixed = not (rhat >= _RHAT_NEEDED).any()
    sure = bool((errors <= _LARGEST_ERROR).all())
    converged = bool(long_enough and mixed and sure)
    about_rhat = (
        "" if np.isnan(rhat).all() else f", R-hat is {np.nanmax(rhat):.4f} ({_RHAT_NEEDED} is needed)"
    )
    details = (
        f"{len(kept)} steps after burn-in are {len(kept) / times.max():.0f} autocorrelation times "
        f"({_TIMES_NEEDED:.0f} are needed){about_rhat}"
    )
    if np.isfinite(errors).all():
        details += (
            f", and quantiles are uncertain by up to {errors.max():.2f} standard deviations "
            f"({_LARGEST_ERROR} may be)"
        )
    state = "converged" if converged else f"not converged after {steps} steps"
    return Outcome(steps, walkers, burn_in, times, rhat, errors, converged, f"{state}: {details}")


def highest_density_interval(draws: FloatArray, probability: float) -> tuple[float, float]:
    """Shortest interval that holds a share `probability` of `draws` (n,)."""
    ordered = np.sort(draws, axis=None)
    inside = int(np.ceil(probability * ordered.size))
    width = ordered[inside - 1 :] - ordered[: ordered.size - inside + 1]
    start = int(np.argmin(width))
    return float(ordered[start]), float(ordered[start + inside - 1])


# --- predictive bands -------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Predictive:
    """Posterior predictive band of one curve.

    Parameters
    ----------
    depth, force : FloatArray
        The data (m, N), (n,).
    model : FloatArray
        Quantiles of the model's force (N) at the probabilities `PREDICTIVE_LEVELS`, (5, n). Where no noise was
        stated the parameters' uncertainty allows for disturbances of the curve, which these forces do not contain.
    reading : FloatArray
        Quantiles of a new reading (N), noise included, at the same probabilities, (5, n).
    """

    depth: FloatArray
    force: FloatArray
    model: FloatArray
    reading: FloatArray

    def coverage(self) -> float:
        """Share of the data inside the 95 % band of a new reading."""
        return float(np.mean((self.force >= self.reading[0]) & (self.force <= self.reading[-1])))


def predictive_bands(
    problem: Problem, physical: FloatArray, best: FloatArray, rng: np.random.Generator
) -> tuple[Predictive, ...]:
    """Posterior predictive bands, one per curve.

    Parameters
    ----------
    problem : Problem
        The problem whose curves they are of.
    physical : FloatArray
        Draws of the parameters (SI), (draws, p); draws without a contact law are left out.
    best : FloatArray
        Best-fit values (SI), (p,), at whose residuals the size of an unstated noise is estimated.
    rng : numpy Generator
        Draws the noise of the readings.
    """
    readings = [
        member.readings(physical, stiffness=member.noise_of(physical).needs_stiffness)
        for member in problem.members
    ]
    possible = np.logical_and.reduce([own.possible for own in readings])
    learnt = best[None] if problem.noise_is_open else physical[possible]
    return tuple(
        _band(member, physical[possible], own, possible, learnt, rng)
        for member, own in zip(problem.members, readings, strict=True)
    )


def _band(
    member: Member,
    physical: FloatArray,
    readings: Readings,
    possible: NDArray[np.bool_],
    learnt: FloatArray,
    rng: np.random.Generator,
) -> Predictive:
    force = readings.force[possible]
    noise = member.noise_of(physical)
    sigma = noise.sigma(readings.contact[possible], readings.stiffness[possible], member.curve.time)
    if member.scale_is_unknown:
        sigma = sigma * _sizes(member, learnt, len(force), rng)[:, None]
    # One normal draw per point and posterior draw: the band is that of single readings, so the correlation
    # between neighbouring points does not enter.
    reading = force + sigma * rng.standard_normal(force.shape)
    return Predictive(
        depth=member.curve.depth,
        force=member.force,
        model=np.quantile(force, PREDICTIVE_LEVELS, axis=0),
        reading=np.quantile(reading, PREDICTIVE_LEVELS, axis=0),
    )


def _sizes(member: Member, physical: FloatArray, count: int, rng: np.random.Generator) -> FloatArray:
    """Draws (count,) of a noise's true size over its `sigma`, where the size was integrated out.

    sigma^2 is distributed as S / chi-squared(n), S the whitened sum of squares of the n residuals.
    """
    noise: NoiseModel = member.noise_of(physical)
    contact, stiffness, force, _ = member.readings(physical, stiffness=noise.needs_stiffness)
    sigma = noise.sigma(contact, stiffness, member.curve.time)
    whitened = noise.whiten((member.force - force) / sigma, member.curve.time)
    square = np.einsum("dn,dn->d", whitened, whitened)
    return np.asarray(np.sqrt(square / rng.chisquare(whitened.shape[-1], size=count)))


# --- prior against posterior ------------------------------------------------------------------------------


class Information(NamedTuple):
    """Prior and posterior of one parameter (SI), and how much the data narrowed it; see `compare_with_prior`."""

    prior_median: float
    prior_low: float
    prior_high: float
    posterior_median: float
    posterior_low: float
    posterior_high: float
    narrowing: float
    distance: float
    informed: str


#: Columns of `Posterior.prior_comparison`.
COMPARISON_COLUMNS = list(Information._fields)


def prior_levels(count: int) -> FloatArray:
    """Probabilities (count,) at the middles of `count` equal intervals between 0 and 1."""
    return (np.arange(count) + 0.5) / count


def compare_with_prior(
    draws: FloatArray, prior_quantiles: FloatArray, effective: float | None = None
) -> Information:
    """Compare the draws of one parameter with its prior.

    Parameters
    ----------
    draws : FloatArray
        Draws (SI) of any shape.
    prior_quantiles : FloatArray
        Quantiles of the prior (SI) at the probabilities `prior_levels`, (levels,).
    effective : float, optional
        Effective number of independent draws; by default the number of draws.

    Returns
    -------
    Information
        ``narrowing`` is 1 minus the ratio of the 68 % widths, those of the logarithm where the prior of a positive
        parameter spans more than a factor of 20; ``distance`` the Kolmogorov distance of the two distributions, 0
        for equal ones and 1 for disjoint ones. Below 0.1, or what the noise of the draws explains, the verdict is
        "not informed by these data", below 0.2 "weakly informed".
    """
    levels = prior_levels(len(prior_quantiles))
    ordered = np.sort(draws, axis=None)
    below = np.interp(ordered, prior_quantiles, levels, left=0.0, right=1.0)
    ranks = np.arange(ordered.size + 1) / ordered.size
    distance = float(max(np.max(ranks[1:] - below), np.max(below - ranks[:-1])))
    noise = _KOLMOGOROV_95 / np.sqrt(ordered.size if effective is None else effective)
    if distance < max(_NOTHING, noise):
        verdict = UNDETERMINED
    else:
        verdict = WEAKLY_DETERMINED if distance < _LITTLE else DETERMINED
    prior68, posterior68 = _widths(prior_quantiles, ordered)
    return Information(
        float(np.median(prior_quantiles)),
        *highest_density_interval(prior_quantiles, 0.95),
        float(np.median(ordered)),
        *highest_density_interval(ordered, 0.95),
        narrowing=float(1.0 - posterior68 / prior68),
        distance=distance,
        informed=verdict,
    )


def _widths(prior: FloatArray, posterior: FloatArray) -> tuple[float, float]:
    """Widths of the 68 % intervals of prior and posterior; of logarithms for a prior wider than a factor of 20."""
    low, high = np.quantile(prior, (0.025, 0.975))
    if low > 0.0 and high / low > _DECADES and posterior[0] > 0.0:
        prior, posterior = np.log(prior), np.log(posterior)
    ends = (highest_density_interval(draws, 0.68) for draws in (prior, posterior))
    first, second = (high - low for low, high in ends)
    return first, second
