"""Weighted draws of a posterior, by importance sampling from the result of a fit's likelihood.

The distribution that they were drawn from, mixed with Student kernels about the draws, also proposes moves to a
Markov chain; each kernel is as wide as its neighbouring draws are apart (Raftery and Bao 2010,
doi:10.1111/j.1541-0420.2010.01399.x).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Self, cast

import numpy as np
from scipy.special import gammaln, logsumexp

from underlay._arrays import FloatArray
from underlay.errors import FitError, InputError, UnderlayError
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.problem import Problem
from underlay.inference.sampling.diagnostics import LEVELS, Importance, chain_errors, memory, quantile_errors
from underlay.inference.uncertainty.likelihood import Likelihood
from underlay.inference.uncertainty.mixture import Mixture, pareto_shape, weighted_quantiles
from underlay.inference.uncertainty.proposal import Kernels
from underlay.inference.uncertainty.reading import DrawnReading, LinearReading, Reading
from underlay.inference.uncertainty.tree import NothingDrawnError

# Number of weighted draws: four fifths of them are effective, and an end of a 95 % interval is known to 0.05
# standard deviations.
_DRAWS = 4000
# Pareto k from which weights are not trusted, and effective draws below which they are not: the rule of
# `uncertainty/ridge`.
_LARGEST_PARETO, _FEWEST = 0.7, 300.0
# Effective share of the draws from which weights count as equal, whose tail has no index.
_EVEN = 0.99
# Largest number of further rounds from kernels about the draws after draws from the closed form: one sufficed in 43
# of 47 cases.
_ROUNDS = 4
# Quantiles of chain and weights differ if they are apart by more than so many joint standard errors plus so many
# standard deviations of the posterior.
_SIGMAS, _SLACK = 4.0, 0.05
# Vectors evaluated at once: with more, intermediate arrays do not fit into the processor's cache.
_BATCH = 256
# Difference of two evaluations of one log-density in different batches: rounding times the condition of the contact
# problem, far below a thousandth of a log unit; another problem differs by log units.
_SAME_DENSITY = 1e-3


class Target:
    """Log-posterior of a fit's likelihood as a function of scaled vectors, with a record of failed evaluations.

    Called with (m, p) it returns (m,). An evaluation fails, and gives -inf, when the prior allows the parameters
    and the model has no finite likelihood there, or raises one of the project's errors or an arithmetic one.
    """

    def __init__(self, found: Fit) -> None:
        self.fit, self.problem = found, found.problem
        self.likelihood: Likelihood = cast(Any, found.statement).likelihood
        self.evaluations = self.failures = 0
        self._low, self._high = np.full((2, len(found.names)), np.array([[np.inf], [-np.inf]]))

    def __call__(self, vectors: FloatArray) -> FloatArray:
        """Log-posterior (m,) at scaled vectors (m, p)."""
        values = self.peek(vectors)
        self.evaluations += len(vectors)
        impossible = np.isneginf(values)
        if impossible.any():
            failed = vectors[impossible][np.isfinite(self.problem.log_prior(vectors[impossible]))]
            self.failures += len(failed)
            self._low = np.minimum(self._low, failed.min(axis=0, initial=np.inf))
            self._high = np.maximum(self._high, failed.max(axis=0, initial=-np.inf))
        return values

    def peek(self, vectors: FloatArray) -> FloatArray:
        """Log-posterior (m,) at scaled vectors (m, p), without a record of evaluations and failures."""
        if len(vectors) > _BATCH:
            parts = np.array_split(vectors, -(-len(vectors) // _BATCH))
            return np.concatenate([self.peek(part) for part in parts])
        try:
            values = self.likelihood.log_density(vectors)
        except (UnderlayError, ArithmeticError, np.linalg.LinAlgError):
            # One of the vectors broke the batch: find out which.
            if len(vectors) == 1:
                return np.array([-np.inf])
            return np.concatenate([self.peek(vector[None]) for vector in vectors])
        return np.where(np.isfinite(values), values, -np.inf)

    def require_same(self, vectors: FloatArray, before: FloatArray) -> None:
        """Raise InputError if a stored log-posterior `before` (m,) at `vectors` (m, p) is not this problem's."""
        now = self.peek(vectors)
        if not np.allclose(now, before, rtol=1e-6, atol=_SAME_DENSITY):
            worst = int(np.argmax(np.abs(now - before)))
            raise InputError(
                "the file holds the chain of another problem: the log-posterior of its last step is "
                f"{before[worst]:.6g} there and {now[worst]:.6g} here; did the curve, a prior, the noise or "
                "the contact law change?"
            )

    @property
    def failure_region(self) -> dict[str, tuple[float, float]]:
        """Range (SI) of each parameter over the failures of this run; empty where there are none."""
        if not (self._low <= self._high).all():
            return {}
        low, high = self.problem.physical(self._low), self.problem.physical(self._high)
        return {name: (float(a), float(b)) for name, a, b in zip(self.problem.names, low, high, strict=True)}


@dataclass(frozen=True, eq=False)
class WeightedDraws:
    """Weighted draws of a posterior: scaled vectors (n, p), log-density and weights (n,).

    `source` is the distribution they were drawn from, `pareto` the Pareto k of the weights, `log_evidence` the
    logarithm of the mean weight.
    """

    source: Source
    vectors: FloatArray
    log_density: FloatArray
    weights: FloatArray
    pareto: float
    log_evidence: float

    @classmethod
    def of(
        cls, source: Source, vectors: FloatArray, log_density: FloatArray, log_weights: FloatArray
    ) -> Self:
        """Draws (n, p) of one distribution; `log_weights` (n,) are the log-density less the proposal's."""
        total = float(logsumexp(log_weights))
        weights = np.exp(log_weights - total)
        # Where the closed form is the exact density all weights are equal, and their rounding has no tail.
        even = 1.0 / float(weights @ weights) > _EVEN * len(weights)
        pareto = 0.0 if even and np.ptp(log_weights) < 1.0 else pareto_shape(log_weights)
        return cls(source, vectors, log_density, weights, pareto, total - math.log(len(vectors)))

    @property
    def effective(self) -> float:
        """Kish's effective sample size."""
        return 1.0 / float(self.weights @ self.weights)

    @property
    def refused(self) -> str:
        """Why the weights are not trusted (Pareto k, too few effective draws); empty where they are."""
        if not self.pareto < _LARGEST_PARETO:
            return f"the Pareto k of their weights is {self.pareto:.2f}, where {_LARGEST_PARETO} may be"
        few = self.effective < _FEWEST
        return f"{len(self.weights)} draws are worth {self.effective:.0f}, too few" if few else ""

    @property
    def quantiles(self) -> FloatArray:
        """Weighted quantiles (3, p) at the probabilities `LEVELS`."""
        return np.array([weighted_quantiles(x, self.weights, np.array(LEVELS)) for x in self.vectors.T]).T

    @property
    def quantile_errors(self) -> FloatArray:
        """Monte Carlo errors (3, p) of `quantiles`, in standard deviations."""
        below = self.vectors <= self.quantiles[:, None]
        off = self.weights[None, :, None] * (below - np.array(LEVELS)[:, None, None])
        return quantile_errors(self.vectors, self.weights, np.sqrt(np.square(off).sum(axis=1)))

    def record(self, disagreement: str) -> Importance:
        """Quality of the draws as a record; without the evidence where the noise is not stated."""
        is_open = self.source.problem.noise_is_open
        error = math.sqrt(max(1.0 / self.effective - 1.0 / len(self.weights), 0.0))
        return Importance(
            draws=len(self.weights),
            effective=self.effective,
            k_hat=self.pareto,
            log_evidence=None if is_open else self.log_evidence,
            log_evidence_error=None if is_open else error,
            quantile_error=float(np.nanmax(self.quantile_errors)),
            refused=self.refused,
            disagreement=disagreement,
        )

    def rows(self, count: int, rng: np.random.Generator) -> np.ndarray[Any, Any]:
        """Indices (count,) of draws resampled by their weights, systematically, in random order."""
        places = (np.arange(count) + rng.random()) / count
        found = np.minimum(np.searchsorted(np.cumsum(self.weights), places), len(self.weights) - 1)
        return rng.permutation(found)


@dataclass(frozen=True, eq=False)
class Source:
    """Distribution that a likelihood's result draws from.

    Entries that act on no curve (`silent`, their indices) are drawn from their priors.
    """

    reading: Reading
    problem: Problem
    silent: np.ndarray[Any, Any]

    @classmethod
    def of(cls, reading: Reading) -> Self:
        """Source for a likelihood's result (`Reading`)."""
        problem, silent = reading.likelihood.fit.problem, ~reading.likelihood.determined
        silent[sorted(problem.noise_entries)] = False
        return cls(reading, problem, np.flatnonzero(silent))

    def draw(self, count: int, rng: Any) -> FloatArray:
        """Draw scaled vectors (count, p)."""
        own = self.reading
        if isinstance(own, DrawnReading):
            return self.filled(own.ridge.source.draw(count, rng), rng)
        return self.filled(cast(LinearReading, own).mixture.draws(count, rng), rng)

    def filled(self, vectors: FloatArray, rng: Any) -> FloatArray:
        """Vectors (n, p) with the entries that act on no curve drawn from their priors."""
        filled = vectors.copy()
        for i in self.silent:
            c = self.problem.coordinates[i]
            values = c.prior.truncated(c.low, c.high).quantile(rng.uniform(size=len(vectors)))
            filled[:, i] = [c.scaled(float(x)) for x in values]
        return filled

    def log_density(self, vectors: FloatArray) -> FloatArray:
        """Log-density (n,) of this distribution at scaled vectors (n, p)."""
        own = self.reading
        if isinstance(own, DrawnReading):
            return own.ridge.source.log_density(vectors) + self.log_prior(vectors)
        return _log_density(cast(LinearReading, own).mixture, vectors) + self.log_prior(vectors)

    def log_prior(self, vectors: FloatArray) -> FloatArray:
        """Log-prior (n,) of the entries that act on no curve."""
        found = np.zeros(len(vectors))
        for i in self.silent:
            found += self.problem.coordinates[i].log_prior(vectors[:, i])
        return found


def weigh(density: Target, rng: np.random.Generator) -> WeightedDraws:
    """Draw from the closed form or along the ridge of the fit's likelihood, and weigh draws by the exact density.

    Where the weights of draws from the closed form are not trusted, up to four rounds from kernels about the draws
    follow.

    Raises
    ------
    FitError
        If no distribution to draw from could be found.
    """
    try:
        reading = density.likelihood.read(rng, _DRAWS)
        source = Source.of(reading)
        vectors = source.filled(reading.draws, rng)
    except NothingDrawnError as error:
        raise FitError(f"nothing can be drawn: {error}") from error
    if isinstance(reading, DrawnReading):
        ridge = reading.ridge
        density.evaluations += len(vectors)
        density.failures += ridge.failed
        levels = density.peek(vectors) if len(source.silent) else ridge.log_density
        evidence = ridge.log_evidence - float(source.log_prior(density.fit.vector[None])[0])
        return WeightedDraws(source, vectors, levels, ridge.weights, ridge.pareto, evidence)
    levels = density(vectors)
    drawn = WeightedDraws.of(source, vectors, levels, levels - source.log_density(vectors))
    for _ in range(_ROUNDS):
        if not drawn.refused:
            break
        proposal = Proposal.of(drawn, rng)
        vectors = proposal.draw(_DRAWS, rng)
        levels = density(vectors)
        drawn = WeightedDraws.of(source, vectors, levels, levels - proposal.log_density(vectors))
    return drawn


def _log_density(mixture: Mixture, vectors: FloatArray) -> FloatArray:
    """Log-density (n,) of a Student mixture at vectors (n, p), in the entries with a nonzero deviation."""
    free = np.flatnonzero(mixture.deviations > 0.0)
    freedom, q = mixture.freedom, len(free)
    roots = np.linalg.cholesky(mixture.covariances[:, free[:, None], free])
    off = vectors[:, None, free] - mixture.means[:, free]
    z = np.linalg.solve(roots, off[..., None])[..., 0]
    constant = gammaln(0.5 * (freedom + q)) - gammaln(0.5 * freedom) - 0.5 * q * np.log(freedom * np.pi)
    each = constant - np.log(np.diagonal(roots, axis1=1, axis2=2)).sum(axis=1)
    each = each - 0.5 * (freedom + q) * np.log1p(np.square(z).sum(axis=2) / freedom)
    return np.asarray(logsumexp(each, axis=1, b=mixture.weights))


def differs(names: tuple[str, ...], drawn: WeightedDraws, coords: FloatArray) -> str:
    """In words, quantiles of a chain (steps, walkers, p) and of weighted draws that differ beyond their errors."""
    kept = coords[memory(coords)[0] :]
    flat = kept.reshape(-1, kept.shape[-1])
    deviations = np.sqrt(drawn.weights @ np.square(drawn.vectors - drawn.weights @ drawn.vectors))
    off = (np.quantile(flat, LEVELS, axis=0) - drawn.quantiles) / deviations
    error = np.hypot(chain_errors(kept), drawn.quantile_errors)
    return ", ".join(
        f"the {100.0 * LEVELS[level]:g} % quantile of {names[i]} by {off[level, i]:+.2f} standard deviations"
        for level, i in np.argwhere(~(np.abs(off) <= _SIGMAS * error + _SLACK))
    )


@dataclass(frozen=True, eq=False)
class Proposal:
    """Proposals for a Markov chain: half from the draws' source, half from Student kernels about the draws."""

    source: Source
    kernels: Kernels

    @classmethod
    def of(cls, drawn: WeightedDraws, rng: np.random.Generator) -> Self:
        """Proposal with kernels placed about weighted draws."""
        weighty = drawn.weights > 0.0  # a draw without weight is no place for a kernel
        vectors, log_weights = drawn.vectors[weighty], np.log(drawn.weights[weighty])
        entries = np.arange(vectors.shape[1])
        return cls(drawn.source, Kernels.about(vectors, log_weights, entries, rng))

    def __call__(self, places: FloatArray, random: Any) -> tuple[FloatArray, FloatArray]:
        """Proposals (m, p), and log q(old) - log q(new), (m,), for walkers at `places` (m, p)."""
        proposed = self.draw(len(places), random)
        return proposed, self.log_density(places) - self.log_density(proposed)

    def draw(self, count: int, rng: Any) -> FloatArray:
        """Draw scaled vectors (count, p)."""
        # In random order: draws are stratified, and a walker's proposals must come from the whole mixture, not from
        # one stratum.
        own = rng.permutation(self.source.draw(count, rng))
        whole = len(self.kernels.centres) * -(-count // len(self.kernels.centres))
        near = rng.permutation(self.kernels.draw(whole, own[0], rng))[:count]
        return np.asarray(np.where(rng.uniform(size=(count, 1)) < 0.5, own, near))

    def log_density(self, vectors: FloatArray) -> FloatArray:
        """Log-density (n,) of the proposal at scaled vectors (n, p)."""
        both = self.source.log_density(vectors), self.kernels.log_density(vectors)
        return np.asarray(np.logaddexp(*both) - np.log(2.0))
