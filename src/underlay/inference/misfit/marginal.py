"""The likelihood of a posterior, noise and misfit averaged over as the intervals of a fit are (`competition.py`).

Every combination of noise, drift, jump and creeping baseline that the fit gives some weight is a Gaussian with a
covariance of low rank beside that of its noise: with r the residuals of the blocks over their scatter, X the
columns of drift, jump, baseline and known errors where the fit has them, D their sizes over s,

    V = V0 + X D^2 X',   r'V^-1 r = r'V0^-1 r - b'D (1 + D G D)^-1 D b,   b = X'V0^-1 r,   G = X'V0^-1 X,
    p(data | theta) = sum_c prior_c |V_c|^(-1/2) (r'V_c^-1 r)^(-n/2),

s integrated out under 1/s. The sizes over s and the blocks stay those of the fit, and the shapes of the columns:
they change by per cents of themselves over a posterior, and are themselves uncertain by factors. A drift is a share
of the law's force, though, and is as large as that is, l times that of the fit: drifts of a fixed force would stand
for the whole curve where the modulus is nothing. With V1 what is left of V without them, and D_v of them alone,

    D_v X'V1^-1 X D_v = U diag(e) U',   a = U'D_v X'V1^-1 r,
    r'V^-1 r = r'V1^-1 r - sum_i l^2 a_i^2 / (1 + l^2 e_i),   log |V| = log |V1| + sum_i log(1 + l^2 e_i).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

from underlay._arrays import FloatArray
from underlay.inference.misfit.averaging import Averaged
from underlay.inference.misfit.blocked import Blocked
from underlay.inference.misfit.competition import Competition
from underlay.inference.misfit.drift import DRIFTS
from underlay.inference.misfit.linearised import Linearised
from underlay.inference.misfit.misfits import Misfits
from underlay.inference.misfit.shapes import JUMPS, RAMPS, acting_columns
from underlay.inference.misfit.sizes import over_noise
from underlay.inference.misfit.whitened_squares import WhitenedSquares
from underlay.inference.misfit.whitener import Whitener
from underlay.inference.model.forward_batch import batched_readings
from underlay.inference.problem import LikelihoodPart

__all__ = ["MarginalLikelihood"]

# Combinations that together weigh less are left out, of what an interval leaves out: an end of a 95 % interval
# moves by 1 % of a deviation.
_LEFT_OUT = 1e-3
# Distance in standard deviations, and in the logarithm of these, within which one combination does for another.
_ALIKE = 0.5


@dataclass(frozen=True, eq=False)
class _Combinations:
    """What the densities of all combinations are made of, noise by noise.

    Parameters
    ----------
    squares : sequence of WhitenedSquares
        Of each curve: r'V0^-1 r.
    solved : sequence of FloatArray
        Of each curve: V0^-1 X of every noise, transposed, (noises m, n).
    noise : NDArray
        Number of the noise of every combination, (c,).
    constants : FloatArray
        log prior - log det V1 / 2, (c,).
    reductions : FloatArray
        D (1 + D G D)^-1 D of the columns that are no drift, (c, m, m).
    turned : FloatArray
        From X'V0^-1 r to a, (c, v, m).
    spread : FloatArray
        The e, (c, v).
    """

    squares: Sequence[WhitenedSquares]
    solved: Sequence[FloatArray]
    noise: NDArray[np.intp]
    constants: FloatArray
    reductions: FloatArray
    turned: FloatArray
    spread: FloatArray

    @classmethod
    def of(
        cls,
        model: Linearised,
        columns: Sequence[FloatArray],
        noises: Sequence[tuple[float, float] | None],
        noise: NDArray[np.intp],
        sizes: FloatArray,
        log_prior: FloatArray,
        follows: NDArray[np.bool_],
    ) -> _Combinations:
        """Prepare combinations of noises (tau, g) and columns (n, m) of each curve, of sizes over s (c, m).

        Those columns that are drifts, (m,), follow the force.
        """
        width = columns[0].shape[1]
        products, log_determinants = np.zeros((len(noises), width, width)), np.zeros(len(noises))
        squares, solved = [], []
        for part, own in zip(model.parts, columns, strict=True):
            whiteners = [
                None if entry is None else (Whitener.of(part.time, entry[0]), entry[1]) for entry in noises
            ]
            found = []
            for number, entry in enumerate(whiteners):
                inverse, log_determinant = (
                    (own, 0.0) if entry is None else entry[0].inverse_times(own, entry[1])
                )
                products[number] += own.T @ inverse
                log_determinants[number] += log_determinant
                found.append(inverse.T)
            squares.append(WhitenedSquares.of(whiteners, len(own)))
            solved.append(np.concatenate(found))
        still, moving = np.where(follows, 0.0, sizes), np.where(follows, sizes, 0.0)[:, :, None]
        gram = products[noise]
        inner = np.eye(width) + still[:, :, None] * gram * still[:, None, :]
        reductions = still[:, :, None] * np.linalg.inv(inner) * still[:, None, :]
        constants = log_prior - 0.5 * (log_determinants[noise] + np.linalg.slogdet(inner)[1])
        seen = moving * (np.eye(width) - gram @ reductions)
        spread, turns = np.linalg.eigh(seen @ gram * np.swapaxes(moving, 1, 2))
        # Eigenvalues come in rising order: the other columns' are the zeros before.
        acting = slice(width - int(follows.sum()), None)
        turned = np.swapaxes(turns, 1, 2)[:, acting] @ seen
        return cls(squares, solved, noise, constants, reductions, turned, spread[:, acting])

    def part(self, rows: NDArray[np.intp]) -> _Combinations:
        """Some of the combinations."""
        numbers, noise = np.unique(self.noise[rows], return_inverse=True)
        width = self.reductions.shape[-1]
        solved = [own.reshape(-1, width, own.shape[-1])[numbers] for own in self.solved]
        return _Combinations(
            [own.part(numbers) for own in self.squares],
            [own.reshape(-1, own.shape[-1]) for own in solved],
            noise,
            self.constants[rows],
            self.reductions[rows],
            self.turned[rows],
            self.spread[rows],
        )

    def log_densities(self, residuals: Sequence[FloatArray], force: FloatArray) -> FloatArray:
        """Log of prior times density, (c, sets), of the residuals of each curve, (n, sets).

        `force` (sets,) is that of the law over the fit's.
        """
        square = sum(own(part) for own, part in zip(self.squares, residuals, strict=True))
        readings = sum(len(part) for part in residuals)
        along = self.along(residuals)
        taken = np.einsum("cis,cis->cs", along, self.reductions @ along)
        gain = self.spread[:, :, None] * np.square(force)
        drifts = np.square(self.turned @ along * force)
        taken += (drifts / (1.0 + gain)).sum(axis=1)
        return np.asarray(
            self.constants[:, None]
            - 0.5 * np.log1p(gain).sum(axis=1)
            - 0.5 * readings * np.log(np.asarray(square)[self.noise] - taken)
        )

    def along(self, residuals: Sequence[FloatArray]) -> FloatArray:
        """X'V0^-1 r of the residuals of each curve, (n, sets), under every combination's noise, (c, m, sets)."""
        found = sum(own @ part for own, part in zip(self.solved, residuals, strict=True))
        return np.reshape(found, (-1, self.reductions.shape[-1], residuals[0].shape[1]))[self.noise]


class _Alike(NamedTuple):
    """Combinations that look alike: their rows, middle (k,) and covariance (k, k) of the heaviest, scaled."""

    rows: NDArray[np.intp]
    middle: FloatArray
    covariance: FloatArray


@dataclass(frozen=True, eq=False)
class MarginalLikelihood:
    """Log-density of the curves of a fit at physical vectors (sets, k), SI: (sets,), -inf where there is no law.

    Parameters
    ----------
    blocked : Blocked
        The curves in blocks.
    combinations : _Combinations
        Those that weigh something, the heaviest first.
    means : sequence of FloatArray
        Of each curve: what its known errors are expected to add, over the scatter, (n,).
    forces : sequence of FloatArray
        Of each curve: the contact force at the fit less its mean, over the scatter, (n,).
    unlike : sequence of _Alike
        The combinations, those together that look alike.
    left_out : float
        What printed intervals leave out, over what they are asked to: as those of the fit.
    misfits : Misfits
        What drift, jump and creep of the combinations are made of.
    """

    blocked: Blocked
    combinations: _Combinations
    means: Sequence[FloatArray]
    forces: Sequence[FloatArray]
    unlike: Sequence[_Alike]
    left_out: float
    misfits: Misfits

    @classmethod
    def of(cls, averaged: Averaged) -> MarginalLikelihood:
        """Take over what a fit was averaged over.

        Raises
        ------
        InputError
            If there is no contact law at the optimum.
        """
        blocked, competition = averaged.blocked, averaged.competition
        model, known = averaged.model, len(averaged.vector)
        columns = _columns(model, known)
        kept = _heaviest(competition.weights, _LEFT_OUT * averaged.left_out)
        prior = competition.sizes.log_prior(len(competition.noises))
        numbers, noise = np.unique(competition.places[kept, 0], return_inverse=True)
        sizes = _sizes(blocked, competition, kept)
        combinations = _Combinations.of(
            model,
            columns,
            [competition.noises[number] for number in numbers],
            noise,
            sizes,
            prior[competition.places[kept, 0], competition.places[kept, 1]] + competition.fading[kept],
            _drifts(blocked),
        )
        expected = np.array([error.mean for error in blocked.errors])
        means = [part.jacobian[:, known:] @ expected for part in model.parts]
        forces = [part.force - part.force.mean() for part in model.parts]
        misfits = Misfits(columns, sizes, _drifts(blocked))
        return cls(blocked, combinations, means, forces, _unlike(averaged, kept), averaged.left_out, misfits)

    def __call__(self, physical: FloatArray) -> FloatArray:
        """Log-density (sets,)."""
        found, possible = self._residuals(physical)
        result = np.full(len(physical), -np.inf)
        if possible.any():
            residuals = [own[:, possible] for own in found]
            densities = self.combinations.log_densities(residuals, self._force(residuals))
            result[possible] = special.logsumexp(densities, axis=0)
        return result

    def misfit(self, physical: FloatArray, rng: np.random.Generator) -> list[FloatArray]:
        """What the law is off by (N), (sets, n) at the blocks of each curve, for vectors (sets, k) that have a law.

        Known errors with it. The combination is drawn by its probability at each vector, and has its best drift,
        jump and creep there.
        """
        residuals, _ = self._residuals(physical)
        force = self._force(residuals)
        densities = self.combinations.log_densities(residuals, force)
        chosen = np.argmax(densities + rng.gumbel(size=densities.shape), axis=0)
        along = self.combinations.along(residuals)[chosen, :, np.arange(len(physical))]
        found = self.misfits.best(along, chosen, force, self._solved)
        return [
            curve.member.scatter * (own + mean)
            for curve, own, mean in zip(self.blocked.curves, found, self.means, strict=True)
        ]

    @cached_property
    def _solved(self) -> FloatArray:
        """X'V0^-1 X of every combination, (c, m, m)."""
        return self.combinations.along(self.misfits.columns)

    @property
    def data(self) -> Sequence[FloatArray]:
        """Depths (m) and forces (N) of the blocks of each curve, (2, n)."""
        return [np.array([curve.forward.depth, curve.force]) for curve in self.blocked.curves]

    @property
    def parts(self) -> Sequence[LikelihoodPart]:
        """Combinations that look alike, together."""
        return [
            LikelihoodPart(
                alike.middle,
                alike.covariance,
                replace(self, combinations=self.combinations.part(alike.rows), unlike=()),
            )
            for alike in self.unlike
        ]

    def _force(self, residuals: Sequence[FloatArray]) -> FloatArray:
        """Force of the law over that of the fit, (sets,): what the models have of it, baselines left out."""
        along, whole = np.zeros(residuals[0].shape[1]), 0.0
        for own, force, curve, mean in zip(
            residuals, self.forces, self.blocked.curves, self.means, strict=True
        ):
            model = own + (curve.force / curve.member.scatter - mean)[:, None]
            along += force @ model
            whole += float(force @ force)
        return along / whole

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


def _heaviest(weights: FloatArray, left_out: float) -> NDArray[np.intp]:
    """Numbers of the fewest combinations that weigh all but a share."""
    order = np.argsort(-weights)
    count = int(np.searchsorted(np.cumsum(weights[order]), 1.0 - left_out)) + 1
    return order[:count]


def _unlike(averaged: Averaged, kept: NDArray[np.intp]) -> list[_Alike]:
    """The combinations, heaviest first, each with those that are like it."""
    k, competition = len(averaged.vector), averaged.competition
    if averaged.blocked.held:
        return []
    middles = averaged.vector + competition.shift[kept, :k]
    covariances = competition.covariance[kept][:, :k, :k]
    deviations = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    found: dict[int, list[int]] = {}
    for row in range(len(kept)):
        first = list(found)
        apart = np.abs(middles[first] - middles[row]) / deviations[row]
        wider = np.abs(np.log(deviations[first] / deviations[row]))
        alike = np.flatnonzero(((apart < _ALIKE) & (wider < _ALIKE)).all(axis=1))
        found.setdefault(first[alike[0]] if alike.size else row, []).append(row)
    return [_Alike(np.array(rows), middles[row], covariances[row]) for row, rows in found.items()]


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


def _drifts(blocked: Blocked) -> NDArray[np.bool_]:
    """Which of those columns is a drift, (m,)."""
    own = np.arange(DRIFTS + JUMPS + RAMPS) < DRIFTS
    return np.concatenate((np.zeros(len(blocked.errors), dtype=bool), np.tile(own, len(blocked.curves))))


def _sizes(blocked: Blocked, competition: Competition, kept: NDArray[np.intp]) -> FloatArray:
    """Sizes of those columns over s, (c, m)."""
    variance = competition.variance[kept]
    own = over_noise(competition.amounts[kept], variance)
    own = own[:, acting_columns(np.ones(own.shape[1]), len(blocked.curves))]
    deviations = np.array([error.deviation for error in blocked.errors])
    return np.hstack((deviations / np.sqrt(variance)[:, None], own))
