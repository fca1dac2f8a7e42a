"""The likelihood of a posterior, noise and misfit averaged over as the intervals of a fit are (`competition.py`).

Every combination of noise, drift, jump and creeping baseline that the fit gives some weight is a Gaussian with a
covariance of low rank beside that of its noise: with r the residuals of the blocks over their scatter, X the
columns of drift, jump, baseline and known errors where the fit has them, D their sizes over s,

    V = V0 + X D^2 X',   r'V^-1 r = r'V0^-1 r - b'D (1 + D G D)^-1 D b,   b = X'V0^-1 r,   G = X'V0^-1 X,
    p(data | theta) = sum_c prior_c |V_c|^(-1/2) (r'V_c^-1 r)^(-n/2),

s integrated out under 1/s. The columns, their sizes over s and the blocks stay those of the fit: they change by per
cents of themselves over a posterior, and are themselves uncertain by factors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from underlay._arrays import FloatArray
from underlay.inference.misfit.averaging import Averaged
from underlay.inference.misfit.blocked import Blocked
from underlay.inference.misfit.competition import Competition
from underlay.inference.misfit.linearised import Linearised
from underlay.inference.misfit.whitener import Whitener
from underlay.inference.model.forward_batch import batched_readings

__all__ = ["MarginalLikelihood"]

# Combinations that together weigh less are left out: an end of a 95 % interval moves by 1 % of a deviation.
_LEFT_OUT = 1e-3
# Distance in standard deviations, and in the logarithm of these, within which one combination does for another.
_ALIKE = 0.5


@dataclass(frozen=True, eq=False)
class _UnderOneNoise:
    """The combinations of one noise.

    Parameters
    ----------
    whiteners : sequence of Whitener or None
        Of each curve; None for white noise.
    share : float
        Variance of the correlated noise over that of the white.
    solved : sequence of FloatArray
        Of each curve: V0^-1 X, as `Whitener.inverse` gives it, (n, m).
    constants : FloatArray
        log prior - log det V / 2, (c,).
    reductions : FloatArray
        D (1 + D G D)^-1 D, (c, m, m).
    """

    whiteners: Sequence[Whitener | None]
    share: float
    solved: Sequence[FloatArray]
    constants: FloatArray
    reductions: FloatArray

    @classmethod
    def of(
        cls,
        model: Linearised,
        columns: Sequence[FloatArray],
        noise: tuple[float, float] | None,
        sizes: FloatArray,
        log_prior: FloatArray,
    ) -> _UnderOneNoise:
        """Prepare a noise (tau, g) for columns (n, m) of each curve, of sizes over s (c, m)."""
        whiteners = [None if noise is None else Whitener.of(part.time, noise[0]) for part in model.parts]
        share = 0.0 if noise is None else noise[1]
        solved, log_determinant = [], 0.0
        products = np.zeros((columns[0].shape[1],) * 2)
        for whitener, own in zip(whiteners, columns, strict=True):
            ahead = own if whitener is None else whitener.ahead(own)
            found, own_determinant = (own, 0.0) if whitener is None else whitener.inverse(ahead, share)
            products += ahead.T @ found
            solved.append(found)
            log_determinant += own_determinant
        inner = np.eye(len(products)) + sizes[:, :, None] * products * sizes[:, None, :]
        reductions = sizes[:, :, None] * np.linalg.inv(inner) * sizes[:, None, :]
        constants = log_prior - 0.5 * (log_determinant + np.linalg.slogdet(inner)[1])
        return cls(whiteners, share, solved, constants, reductions)

    def log_densities(self, residuals: Sequence[FloatArray]) -> FloatArray:
        """Log of prior times density, (c, sets), of the residuals of each curve, (n, sets)."""
        square = np.zeros(residuals[0].shape[1])
        along = np.zeros((self.solved[0].shape[1], len(square)))
        readings = 0
        for whitener, solved, own in zip(self.whiteners, self.solved, residuals, strict=True):
            ahead = own if whitener is None else whitener.ahead(own)
            inverse = own if whitener is None else whitener.inverse(ahead, self.share)[0]
            square += np.einsum("ns,ns->s", ahead, inverse)
            along += solved.T @ ahead
            readings += len(own)
        taken = np.einsum("is,cis->cs", along, self.reductions @ along)
        return np.asarray(self.constants[:, None] - 0.5 * readings * np.log(square - taken))


@dataclass(frozen=True, eq=False)
class MarginalLikelihood:
    """Log-density of the curves of a fit at physical vectors (sets, k), SI: (sets,), -inf where there is no law.

    Parameters
    ----------
    blocked : Blocked
        The curves in blocks.
    noises : sequence
        The combinations that weigh something, noise by noise.
    means : sequence of FloatArray
        Of each curve: what its known errors are expected to add, over the scatter, (n,).
    about : (FloatArray, FloatArray)
        Middles (m, k) and covariances (m, k, k) of the scaled vector under combinations that differ.
    """

    blocked: Blocked
    noises: Sequence[_UnderOneNoise]
    means: Sequence[FloatArray]
    about: tuple[FloatArray, FloatArray]

    @classmethod
    def of(cls, averaged: Averaged) -> MarginalLikelihood:
        """Take over what a fit was averaged over.

        Raises
        ------
        InputError
            If there is no contact law at the optimum.
        """
        blocked, competition = averaged.blocked, averaged.competition
        model, known = blocked.linearised(averaged.vector), len(averaged.vector)
        columns = _columns(model, known)
        kept = _heaviest(competition.weights)
        sizes = _sizes(blocked, competition, kept)
        prior = competition.sizes.log_prior(len(competition.noises))
        noises = []
        for number in np.unique(competition.places[kept, 0]):
            rows = competition.places[kept, 0] == number
            own = prior[number, competition.places[kept[rows], 1]]
            noise = competition.noises[number]
            noises.append(_UnderOneNoise.of(model, columns, noise, sizes[rows], own))
        expected = np.array([error.mean for error in blocked.errors])
        means = [part.jacobian[:, known:] @ expected for part in model.parts]
        return cls(blocked, noises, means, _unlike(averaged, kept))

    def __call__(self, physical: FloatArray) -> FloatArray:
        """Log-density (sets,)."""
        found, possible = self._residuals(physical)
        result = np.full(len(physical), -np.inf)
        if possible.any():
            residuals = [own[:, possible] for own in found]
            densities = np.concatenate([noise.log_densities(residuals) for noise in self.noises])
            result[possible] = special.logsumexp(densities, axis=0)
        return result

    def _residuals(self, physical: FloatArray) -> tuple[list[FloatArray], NDArray[np.bool_]]:
        """Model less data over the scatter, (n, sets) of each curve, and which sets exist."""
        possible = np.ones(len(physical), dtype=bool)
        residuals = []
        for curve, mean in zip(self.blocked.curves, self.means, strict=True):
            values = curve.member.values_of(physical)
            found = batched_readings(curve.forward, values, len(physical), stiffness=False)
            possible &= found.possible
            own = (found.force - curve.force) / curve.member.scatter + mean
            residuals.append(np.asfortranarray(own.T))
        return residuals, possible


def _heaviest(weights: FloatArray) -> NDArray[np.intp]:
    """Numbers of the fewest combinations that weigh all but a thousandth."""
    order = np.argsort(-weights)
    count = int(np.searchsorted(np.cumsum(weights[order]), 1.0 - _LEFT_OUT)) + 1
    return order[:count]


def _unlike(averaged: Averaged, kept: NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
    """Middles and covariances of the combinations, heaviest first, those left out that are like a heavier one."""
    k, competition = len(averaged.vector), averaged.competition
    free = [i for i in range(k) if i not in averaged.blocked.held]
    middles = averaged.vector + competition.shift[kept, :k]
    covariances = competition.covariance[kept][:, :k, :k]
    deviations = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    chosen: list[int] = []
    for row in range(len(kept) if len(free) == k else 0):
        apart = np.abs(middles[chosen] - middles[row]) / deviations[row]
        wider = np.abs(np.log(deviations[chosen] / deviations[row]))
        if not ((apart < _ALIKE) & (wider < _ALIKE)).all(axis=1).any():
            chosen.append(row)
    return middles[chosen], covariances[chosen]


def _columns(model: Linearised, known: int) -> list[FloatArray]:
    """Of each curve: columns of known errors, which all share, then drift, jump and baseline of every curve."""
    columns = []
    for number, part in enumerate(model.parts):
        own = np.hstack((part.drift, part.jump, part.ramp))
        errors = part.jacobian[:, known:]
        width = own.shape[1]
        every = np.zeros((len(own), errors.shape[1] + width * len(model.parts)))
        every[:, : errors.shape[1]] = errors
        start = errors.shape[1] + width * number
        every[:, start : start + width] = own
        columns.append(every)
    return columns


def _sizes(blocked: Blocked, competition: Competition, kept: NDArray[np.intp]) -> FloatArray:
    """Sizes of those columns over s, (c, m)."""
    variance = competition.variance[kept]
    own = competition.sizes.scales(competition.amounts[kept], variance, 0, len(blocked.curves))
    deviations = np.array([error.deviation for error in blocked.errors])
    return np.hstack((deviations / np.sqrt(variance)[:, None], own))
