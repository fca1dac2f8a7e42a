"""What the weighted draws of a frozen mixture say of a posterior, and whether they may be believed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.ridge.budget import Budget
from underlay.inference.ridge.climb import Density
from underlay.inference.ridge.coordinates import Target
from underlay.inference.ridge.learn import Proposal
from underlay.inference.ridge.trial import weigh
from underlay.inference.ridge.weights import WeightedDraws

__all__ = ["Importance", "LogEvidence", "judged", "leak_of", "leak_of_walk", "produced"]

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
