"""Lay a mixture along the ridges, try it, mend it, and say what its draws say.

Try a mixture on a pilot of draws, and mend it by what the draws say.

Lay a mixture along the ridges of a posterior, try it, mend it, and freeze it.

Weights of the draws that a mixture was learnt from are biased: to low evidence, by 0.02 to 0.1 with four or five
parameters. What is reported comes from draws made after it was frozen.

Aim a frozen mixture at quantiles, so that fewer draws do for them.

The error of a quantile q of level a is that of the share of the posterior pi below it, over the density f there:
the draws that tell most of it are not spread as pi but as pi |1[x < q] - a| (Kahn and Marshall 1953, J. Oper. Res.
Soc. Am. 1, 263). In a posterior with a narrow core and wide, thin wings an end of an interval lies where f is
small, and only the few draws in the wings tell of it. Here the components get weight by
pi sqrt(sum (1[x < q] - a)^2 / f^2) over all quantiles, in standard deviations.

What the weighted draws of a frozen mixture say of a posterior, and whether they may be believed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np
from scipy import special

from underlay._arrays import FloatArray
from underlay.inference.ridge.march import (
    FARTHEST,
    Budget,
    Density,
    Node,
    OutOfTimeError,
    Part,
    PriorNormal,
    Ridge,
    Slice,
    Target,
    climb,
    log_normal,
    march,
    march_inside,
    nodes_of,
    small_basis,
)
from underlay.inference.ridge.mixture import LEVELS, Mixture, WeightedDraws, smoothed

__all__ = [
    "Importance",
    "LogEvidence",
    "Proposal",
    "Trial",
    "aimed",
    "judged",
    "leak_of",
    "leak_of_walk",
    "learn",
    "produced",
    "weigh",
]

_PILOT = 2048


# A mixture that needs no mending, and one that needs more than that. A round of mending costs a fiftieth of a
# chain; a proposal of uneven weights keeps a chain in its tails for long.
_GOOD_INDEX, _GOOD_SHARE = 0.3, 0.5


_USABLE_INDEX, _USABLE_SHARE = 0.5, 0.15


_ROUNDS = 6


# Components that every round puts at the heaviest draws, apart by half a standard deviation at least, each as wide
# as the nearest twentieth of the draws; and the weight they begin with.
_FRESH, _APART, _NEAREST, _SHARE = 4, 0.5, 0.05, 0.1


_LOOKED_AT = 50


def weigh(
    density: Density, coordinates: PriorNormal, mixture: Mixture, count: int, rng: np.random.Generator
) -> WeightedDraws:
    """Draw `count` places of a mixture and weigh them."""
    z = mixture.spread(count, rng)
    log_target = density(z)
    vectors = np.full_like(z, np.nan)
    possible = np.isfinite(log_target)
    vectors[possible] = coordinates.scaled(z[possible])
    return WeightedDraws(z, vectors, log_target, mixture.log_density(z))


@dataclass(frozen=True, eq=False)
class Trial:
    """A mixture, and draws of it that say how good it is.

    Parameters
    ----------
    density, coordinates
        The posterior, and the way to scaled vectors.
    rng : numpy Generator
        Draws.
    mixture : Mixture
        On trial.
    pilot : WeightedDraws
        Draws of it.
    """

    density: Density
    coordinates: PriorNormal
    rng: np.random.Generator
    mixture: Mixture
    pilot: WeightedDraws

    @classmethod
    def of(
        cls, density: Density, coordinates: PriorNormal, mixture: Mixture, rng: np.random.Generator
    ) -> Self:
        """Draw the pilot of a mixture."""
        pilot = weigh(density, coordinates, mixture, _PILOT, rng)
        return cls(density, coordinates, rng, mixture, pilot)

    def with_mixture(self, mixture: Mixture) -> Trial:
        """Another mixture, tried on a pilot of its own."""
        return Trial.of(self.density, self.coordinates, mixture, self.rng)

    @property
    def is_good(self) -> bool:
        """Whether its weights have a light tail and are nearly even."""
        return self.pilot.k_hat < _GOOD_INDEX and self.share > _GOOD_SHARE

    @property
    def is_usable(self) -> bool:
        """Whether its weights have a tail that allows an answer, and are not too uneven."""
        return self.pilot.k_hat < _USABLE_INDEX and self.share > _USABLE_SHARE

    @property
    def share(self) -> float:
        """Effective draws per draw."""
        return self.pilot.effective / len(self.pilot.z)

    @property
    def score(self) -> float:
        """How good it is: its share of effective draws, less its tail's index where that is too large."""
        return self.share if self.pilot.k_hat < _USABLE_INDEX else self.share - self.pilot.k_hat

    def mended(self) -> Mixture:
        """What its own draws teach, once."""
        return _Known.of(self).learnt(self)

    def adapted(self) -> Trial:
        """Itself if it is good; else the best of what its wider twin learns in rounds from all draws so far."""
        best, mixture, known = self, self.mixture.with_twins(), _Known.of(self)
        for _ in range(_ROUNDS):
            if best.is_good:
                break
            trial = self.with_mixture(mixture)
            best = max(best, trial, key=lambda entry: entry.score)
            known = known.and_of(trial)
            mixture = known.learnt(trial)
        return best


@dataclass(frozen=True, eq=False)
class _Known:
    """All draws so far: places (n, p), log-posterior (n,), and log-densities (m, n) of the mixtures they are of."""

    mixtures: tuple[Mixture, ...]
    z: FloatArray
    log_target: FloatArray
    proposals: FloatArray

    @classmethod
    def of(cls, trial: Trial) -> Self:
        """What one trial drew."""
        pilot = trial.pilot
        return cls((trial.mixture,), pilot.z, pilot.log_target, pilot.log_proposal[None])

    def and_of(self, trial: Trial) -> _Known:
        """With what another drew."""
        fresh = trial.pilot.z
        across = np.array([mixture.log_density(fresh) for mixture in self.mixtures])
        own = np.concatenate([trial.mixture.log_density(self.z), trial.pilot.log_proposal])
        return _Known(
            (*self.mixtures, trial.mixture),
            np.concatenate([self.z, fresh]),
            np.concatenate([self.log_target, trial.pilot.log_target]),
            np.vstack([np.hstack([self.proposals, across]), own]),
        )

    def learnt(self, last: Trial) -> Mixture:
        """The last mixture after what all draws say, with components at its heaviest draws."""
        # All draws as those of the even mixture of the mixtures: Veach and Guibas' balance heuristic.
        log_weights = self.log_target - special.logsumexp(self.proposals, axis=0)
        weights = special.softmax(smoothed(log_weights)[0])
        mixture = last.mixture.learnt(self.z, weights)
        places, factors = _at_heaviest(last.pilot, self.z, weights)
        return mixture.with_more(places, factors, _SHARE) if len(places) else mixture


def _at_heaviest(pilot: WeightedDraws, z: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Places (m, p) of the heaviest draws of a pilot, and factors (m, p, p) of all draws z (n, p) near them.

    Incremental mixture importance sampling: Raftery and Bao (2010), doi:10.1111/j.1541-0420.2010.01399.x.
    """
    parameters = z.shape[1]
    covariance = np.cov(z.T, aweights=weights).reshape(parameters, parameters)
    whiten = np.linalg.inv(np.linalg.cholesky(covariance)).T
    heavy = pilot.z[np.argsort(pilot.log_weights)[::-1][:_LOOKED_AT]]
    places: list[FloatArray] = []
    factors: list[FloatArray] = []
    for place in heavy:
        if any(np.linalg.norm((place - other) @ whiten) < _APART for other in places):
            continue
        off = z - place
        near = np.argsort(np.square(off @ whiten).sum(axis=1))[: int(_NEAREST * len(z))]
        # Half by weight, half each alike, as the authors have it.
        own = weights[near] / weights[near].sum() + 1.0 / len(near) if weights[near].sum() > 0.0 else 1.0
        scale = np.einsum("n,ni,nj->ij", own / np.sum(own) * np.ones(len(near)), off[near], off[near])
        places.append(place)
        factors.append(np.linalg.cholesky(scale))
        if len(places) == _FRESH:
            break
    return np.array(places), np.array(factors)


# Optima this far below the best one's evidence say nothing; two this near are one; so near a ridge is on it.
_FAR_BELOW, _ONE_PLACE, _ON_RIDGE = 12.0, 1.0, 2.5


# A search begins inside the prior, with room for differences.
_INSIDE = FARTHEST - 2.5


# A place of a scan is looked at if it is farther than this from all that was walked, in standard deviations of
# the prior, and its likelihood is not so far below the best that no ridge passes near it. So many are, and each
# climbs so many steps: onto a ridge, and not yet along it to a top that is known.
_LEARN_APART, _HOPELESS = 0.3, 25.0


_MOST_PLACES, _ONTO_RIDGE = 8, 12


@dataclass(frozen=True, eq=False)
class Proposal:
    """A frozen mixture, and what is known of how it was found.

    Parameters
    ----------
    mixture : Mixture
        In coordinates in which the prior is a standard normal.
    optima : int
        Tops whose ridges it follows.
    open_end : str
        Why a ridge may go on beyond it; empty where none does.
    """

    mixture: Mixture
    optima: int
    open_end: str

    @property
    def numbers(self) -> FloatArray:
        """All of it but words: parameters, optima, whether an end is open, then a row for each component."""
        mixture = self.mixture
        rows = np.column_stack(
            [mixture.weights, mixture.places, mixture.factors.reshape(len(mixture.weights), -1)]
        )
        return np.concatenate([[mixture.places.shape[1], self.optima, bool(self.open_end)], rows.ravel()])

    @classmethod
    def from_numbers(cls, numbers: FloatArray) -> Self:
        """Take up what `numbers` told."""
        parameters, optima, is_open = (int(number) for number in numbers[:3])
        rows = numbers[3:].reshape(-1, 1 + parameters + parameters**2)
        factors = rows[:, 1 + parameters :].reshape(-1, parameters, parameters)
        mixture = Mixture(rows[:, 0], rows[:, 1 : 1 + parameters], factors)
        return cls(mixture, optima, "a ridge goes on beyond what was walked" if is_open else "")


def learn(
    target: Target,
    starts: Sequence[FloatArray],
    rng: np.random.Generator,
    budget: Budget,
    *,
    places: Sequence[FloatArray] = (),
    parts: Sequence[Part] = (),
) -> Proposal | None:
    """Find a mixture for a posterior.

    Parameters
    ----------
    target : Target
        The posterior.
    starts : sequence of FloatArray
        (p,) each: optima of a fit, the best first.
    rng : numpy Generator
        Draws the pilots.
    budget : Budget
        Processor time it may take.
    places : sequence of FloatArray
        (p,) each: where else a ridge may be, though no optimum is; those on none that was walked are looked at.
    parts : sequence of Part
        Densities that the posterior is a sum of.

    Returns
    -------
    Proposal or None
        None where no start has a density, or the time was used up before a ridge was walked.
    """

    def density(z: FloatArray) -> FloatArray:
        budget.require()
        return target(z)

    ridges: list[Ridge] = []
    open_end = ""
    try:
        for top in _tops(density, starts):
            if not _is_on(top.place, ridges):
                ridges.append(march(density, top))
        _walk_from_places(density, places, ridges)
    except OutOfTimeError:
        open_end = "the processor time for walking was used up"
    ridges = [ridge for ridge in ridges if ridge.slices]
    if not ridges:
        return None
    own, end = nodes_of(parts, budget)
    ends = [open_end, end, *(ridge.open_end for ridge in ridges)]
    mixture = Mixture.along([*(n for ridge in ridges for n in ridge.nodes), *own])
    # One batch, and without it nothing is known of a mixture: it is drawn whatever the walks have left of the time.
    trial = replace(Trial.of(target, target.coordinates, mixture, rng), density=density)
    try:
        trial = trial.adapted()
        if not trial.is_usable:
            trial, inside = _with_sheets(density, ridges, trial)
            ends += inside
    except OutOfTimeError:
        ends.append("the processor time for trying the mixture was used up")
    return Proposal(trial.mixture.pruned(), len(ridges), next((end for end in ends if end), ""))


def _with_sheets(density: Density, ridges: Sequence[Ridge], trial: Trial) -> tuple[Trial, list[str]]:
    """The better of a mixture and one that is laid inside the slices too, with the open ends of its walks."""
    sheets = [march_inside(density, ridge) for ridge in ridges]
    nodes = [node for part, _ in sheets for node in part]
    if len(nodes) == sum(len(ridge.slices) for ridge in ridges):
        return trial, []
    other = trial.with_mixture(Mixture.along(nodes)).adapted()
    return (other, [end for _, end in sheets]) if other.score > trial.score else (trial, [])


def _tops(density: Density, starts: Sequence[FloatArray]) -> list[Slice]:
    """Distinct optima above the starts that may count, the best first."""
    tops: list[Slice] = []
    for start in starts:
        top = climb(density, np.clip(start, -_INSIDE, _INSIDE), small_basis(len(start)))
        if top is not None and not any(_steps(top.place, known) < _ONE_PLACE for known in tops):
            tops.append(top)
    tops.sort(key=lambda top: -top.log_mass)
    return [top for top in tops if top.log_mass > tops[0].log_mass - _FAR_BELOW]


def _walk_from_places(density: Density, places: Sequence[FloatArray], ridges: list[Ridge]) -> None:
    """Add to `ridges` those above places that lie on none of them.

    A ridge that bends back on itself, or has a second arm behind a saddle, is left by the walk that came first.
    """
    if not (places and any(ridge.slices for ridge in ridges)):
        return
    inside = np.clip(places, -_INSIDE, _INSIDE)
    # A scan knows no prior: of its places the likelihood tells how near they are to what explains the data.
    likelihood = density(inside) - log_normal(inside)
    walked = [entry for ridge in ridges for entry in ridge.slices]
    best = max(entry.log_density - float(log_normal(entry.place)) for entry in walked)
    heaviest = max(entry.log_mass for entry in walked)
    looked = 0
    for row in np.argsort(-likelihood):
        if looked == _MOST_PLACES or not likelihood[row] > best - _HOPELESS:
            return
        known = np.array([entry.place for ridge in ridges for entry in ridge.slices])
        if np.linalg.norm(known - inside[row], axis=1).min() < _LEARN_APART:
            continue
        looked += 1
        start = climb(density, inside[row], small_basis(inside.shape[1]), max_steps=_ONTO_RIDGE)
        if start is None or start.log_mass < heaviest - _FAR_BELOW or _is_on(start.place, ridges):
            continue
        ridges.append(march(density, start))


def _is_on(place: FloatArray, ridges: Sequence[Ridge]) -> bool:
    """Whether a place is on one of the ridges."""
    return any(_distance(place, node) < _ON_RIDGE for ridge in ridges for node in ridge.nodes)


def _steps(place: FloatArray, top: Slice) -> float:
    """Distance of a place from an optimum, in its standard deviations."""
    return float(np.linalg.norm(np.linalg.solve(top.basis, place - top.place)))


def _distance(place: FloatArray, node: Node) -> float:
    """Distance of a place from a node, in its widths."""
    columns = np.column_stack([node.across, node.along])
    return float(np.linalg.norm(np.linalg.lstsq(columns, place - node.place, rcond=None)[0]))


# Share that stays as it was: no weight grows by more than twice.
_KEPT = 0.5


# Levels on either side over which the density at a quantile is taken.
_BESIDE = 0.01


def aimed(mixture: Mixture, drawn: WeightedDraws) -> Mixture:
    """The same components, their weights such that the quantiles at `LEVELS` are known best.

    Parameters
    ----------
    mixture : Mixture
        A good proposal for the posterior.
    drawn : WeightedDraws
        Draws of it: no quantile is reported from these.
    """
    kept = drawn.weights > 0.0
    z, weights = drawn.z[kept], drawn.weights[kept]
    told = weights * np.sqrt(_influence(drawn, drawn.vectors[kept]))
    share = told @ mixture.responsibilities(z)
    return mixture.reweighted(_KEPT * mixture.weights + (1.0 - _KEPT) * share / share.sum())


def _influence(drawn: WeightedDraws, vectors: FloatArray) -> FloatArray:
    """Sum over quantiles of (1[x < q] - a)^2 / f^2, f per standard deviation, at vectors (n, p)."""
    total = np.zeros(len(vectors))
    for level, quantile in zip(LEVELS, drawn.quantiles(), strict=True):
        ends = drawn.quantiles((level - _BESIDE, level + _BESIDE))
        slopes = (ends[1] - ends[0]) / (2.0 * _BESIDE * drawn.deviations)
        total += np.square(((vectors < quantile) - level) * slopes).sum(axis=1)
    return total


# Largest Monte Carlo error of a quantile that is believed, in standard deviations of the posterior.
_LARGEST_ERROR = 0.1


_LARGEST_INDEX, _LARGEST_LEAK = 0.5, 0.06


_FIRST_DRAWS, _MOST_DRAWS = 4096, 32_768


# Weights of such a tail are not mended by more of them.
_HOPELESS_INDEX = 0.7


# A walk that keeps the posterior: draws it begins from, steps, and its step in a component's widths.
_WALKERS, _STEPS, _STEP = 128, 20, 0.8


_LEVEL = 0.99


class LogEvidence(NamedTuple):
    """Natural logarithm of the probability of the data under a model, and its standard error.

    The probability of the readings in their unit (per newton and point), with all parameters integrated over their
    priors: only differences between models of the same data mean something. Where the size of the noise is not
    stated it is known up to a factor that all models of the same data share.
    """

    value: float
    error: float


@dataclass(frozen=True)
class Importance:
    """The posterior as weighted draws of a frozen mixture.

    Parameters
    ----------
    draws, components, optima : int
        Draws, components of the mixture, and optima whose ridges it follows.
    effective : float
        Kish's effective sample size.
    k_hat : float
        Tail index of the weights.
    log_evidence, log_evidence_error : float
        Natural logarithm of the evidence and its standard error.
    leak : float
        Share of the posterior above the 99 % point of the weights, as a chain finds it; 0.01 where the mixture
        reaches all that the chain does.
    quantile_error : float
        Largest Monte Carlo error of a 2.5, 50 or 97.5 % quantile, in standard deviations of the posterior.
    refused : str
        Why the weights are not believed; empty where they are.
    disagreement : str
        Where a chain and the weights differ by more than their errors; empty where they do not.
    """

    draws: int
    components: int
    optima: int
    effective: float
    k_hat: float
    log_evidence: float
    log_evidence_error: float
    leak: float
    quantile_error: float
    refused: str
    disagreement: str = ""

    @property
    def accepted(self) -> bool:
        """Whether the weights may be believed."""
        return not self.refused

    @property
    def stands(self) -> bool:
        """Whether they may be believed and no chain differs."""
        return not (self.refused or self.disagreement)


def produced(
    target: Target,
    proposal: Proposal,
    rng: np.random.Generator,
    budget: Budget,
    *,
    error: float = _LARGEST_ERROR,
) -> WeightedDraws:
    """Draw from a frozen mixture until no quantile's error is above `error`, or 32,768 times, or out of time.

    Draws whose weights have a hopeless tail remain few.
    """
    drawn = weigh(target, target.coordinates, proposal.mixture, _FIRST_DRAWS, rng)
    while len(drawn.z) < _MOST_DRAWS and budget.left:
        if not drawn.k_hat < _HOPELESS_INDEX:
            break
        short = float(np.square(drawn.quantile_errors().max() / error))
        if short <= 1.0 and drawn.k_hat < _LARGEST_INDEX:
            break
        # As many as should do, but no more than there are: of few an error is known badly.
        share = min(max(short - 1.0, 0.25), 1.0)
        count = min(int(share * len(drawn.z)), _MOST_DRAWS - len(drawn.z))
        more = weigh(target, target.coordinates, proposal.mixture, count, rng)
        drawn = WeightedDraws.joined([drawn, more])
    return drawn


def judged(drawn: WeightedDraws, proposal: Proposal, leak: float) -> Importance:
    """Say what weighted draws are worth; `leak` as `Importance` has it."""
    # Of a handful of draws nothing can be said.
    worst = float(drawn.quantile_errors().max()) if drawn.k_hat < np.inf else float("inf")
    reasons = [proposal.open_end]
    if not drawn.k_hat <= _LARGEST_INDEX:
        reasons.append(f"k-hat is {drawn.k_hat:.2f}, where {_LARGEST_INDEX} is the largest that is believed")
    if not leak <= _LARGEST_LEAK:
        reasons.append(f"{100.0 * leak:.0f} % of the posterior is where the mixture hardly reaches")
    if not worst <= _LARGEST_ERROR:
        reasons.append(f"a quantile is uncertain by {worst:.2f} standard deviations")
    value, error = drawn.log_evidence
    return Importance(
        draws=len(drawn.z),
        components=len(proposal.mixture.weights),
        optima=proposal.optima,
        effective=drawn.effective,
        k_hat=drawn.k_hat,
        log_evidence=value,
        log_evidence_error=error,
        leak=leak,
        quantile_error=worst,
        refused="; ".join(reason for reason in reasons if reason),
    )


def leak_of_walk(
    density: Density, drawn: WeightedDraws, proposal: Proposal, rng: np.random.Generator
) -> float:
    """Share of short chains, begun from resampled draws, that ends above the 99 % point of the weights.

    A step picks a component by its responsibility for the place, goes by its widths, and is accepted with
    pi(z') rho(z') / pi(z) rho(z): each component's moves keep the posterior times its own responsibility.
    """
    mixture = proposal.mixture
    rows = drawn.resampled(_WALKERS, rng)
    z, log_target = drawn.z[rows], drawn.log_target[rows]
    every = np.arange(_WALKERS)
    for _ in range(_STEPS):
        own = mixture.responsibilities(z)
        which = (np.cumsum(own, axis=1) < rng.random((_WALKERS, 1))).sum(axis=1).clip(max=own.shape[1] - 1)
        steps = np.einsum("nij,nj->ni", mixture.factors[which], rng.standard_normal(z.shape))
        ahead = z + _STEP * steps
        after = density(ahead)
        gain = after - log_target + np.log(mixture.responsibilities(ahead)[every, which] + 1e-300)
        accepted = np.log(rng.random(_WALKERS)) < gain - np.log(own[every, which])
        z = np.where(accepted[:, None], ahead, z)
        log_target = np.where(accepted, after, log_target)
    return leak_of(log_target - mixture.log_density(z), drawn)


def leak_of(log_weights: FloatArray, drawn: WeightedDraws) -> float:
    """Share of a chain's log-weights (n,) above the 99 % point of those of weighted draws."""
    return float(np.mean(log_weights > drawn.upper_point(_LEVEL)))
