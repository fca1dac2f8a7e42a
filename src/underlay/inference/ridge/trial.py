"""Try a mixture on a pilot of draws, and mend it by what the draws say."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy import special

from underlay._arrays import FloatArray
from underlay.inference.ridge.climb import Density
from underlay.inference.ridge.coordinates import PriorNormal
from underlay.inference.ridge.mixture import Mixture
from underlay.inference.ridge.pareto import smoothed
from underlay.inference.ridge.weights import WeightedDraws

__all__ = ["Trial", "weigh"]

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
