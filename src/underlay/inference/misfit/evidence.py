"""The evidence of every combination of noise, drift, jump and ramp: the algebra of `competition.py`.

What is weighed is a grid whose members share most of their algebra. Under one noise the coordinates are solved
for once, and the jump once for each of its sizes; what is left of the drift, the ramp and the residuals is a small
matrix for each kind of drift.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy import special

from underlay._arrays import FloatArray
from underlay.inference.misfit.drift import DRIFTS, FADING
from underlay.inference.misfit.linearised import Linearised
from underlay.inference.misfit.shapes import acting_columns
from underlay.inference.misfit.sizes import Sizes, over_noise

__all__ = ["Evidence", "Weighed"]

# Standard deviations beyond which a force that should fade is seen to grow, and the kind of drift is none.
_GROWS = 1.645


class Weighed(NamedTuple):
    """Log evidence (c,), shifts (c, k) and covariances (c, k, k) of the coordinates, s^2 (c,), and `fading` (c,).

    The last is in the evidence already: the logarithm of how much likelier what fades is to fade than before the
    test, and -inf where it is seen to grow.
    """

    log_evidence: FloatArray
    shift: FloatArray
    covariance: FloatArray
    variance: FloatArray
    fading: FloatArray


@dataclass(frozen=True)
class Evidence:
    """The algebra of one linearised model under some noises.

    Parameters
    ----------
    model : Linearised
        The model.
    sizes : Sizes
        What is weighed.
    noises : sequence of (tau, g) or None
        Correlated noises; the first is white noise alone.
    products : FloatArray
        Of the columns that have a size, as of `Linearised.products`, (g, m, m).
    log_determinants : FloatArray
        log det V, (g,).
    """

    model: Linearised
    sizes: Sizes
    noises: Sequence[tuple[float, float] | None]
    products: FloatArray
    log_determinants: FloatArray

    @classmethod
    def of(cls, model: Linearised, sizes: Sizes) -> Self:
        """Prepare the noises that are weighed."""
        noises = sizes.noises([part.time for part in model.parts])
        return cls(model, sizes, noises, *model.products(noises, sizes.largest))

    @cached_property
    def log_prior(self) -> FloatArray:
        """Logarithm of the prior probability of every combination, (g, c)."""
        return self.sizes.log_prior(len(self.noises))

    @property
    def freedom(self) -> int:
        """n - k, and one for each prior that is a measurement."""
        return self.model.readings - self._known + self.model.measured

    @property
    def _known(self) -> int:
        """Number of coordinates and amplitudes."""
        return len(self.model.precision)

    @cached_property
    def _amount(self) -> NDArray[np.intp]:
        """Which of the 10 + 2 amounts is that of each of the misfits' columns."""
        return acting_columns(self.sizes.largest, len(self.model.parts))

    @cached_property
    def least_square(self) -> FloatArray:
        """S under every noise with the largest of drift, jump and ramp, (g,)."""
        root = np.linalg.cholesky(self._with_everything(np.ones(len(self.products))))
        return np.asarray(root[:, -1, -1] ** 2)

    def _with_everything(self, variance: FloatArray) -> FloatArray:
        """N as of `_bordered` under every noise, with the largest of drift, jump and ramp, (g, m, m)."""
        noises = len(self.products)
        return self._bordered(np.arange(noises), np.tile(self.sizes.largest, (noises, 1)), variance)

    def roughly(self) -> tuple[FloatArray, FloatArray]:
        """Log evidence and S of all combinations, (g, c), with s^2 of their noise: what is light is seen here."""
        noises, known = len(self.products), self._known
        bordered = self._with_everything(self.least_square / self.freedom)
        own, cross = bordered[:, -1 - known : -1, -1 - known : -1], bordered[:, -1 - known : -1]
        left, log_jump = self._without_jumps(
            bordered - np.swapaxes(cross, 1, 2) @ np.linalg.solve(own, cross)
        )
        found = [self._of_a_kind(left, np.array(kind)) for kind in self.sizes.kinds]
        square = np.stack([each for each, _ in found], axis=1).reshape(noises, -1)
        log_normal = np.stack([each + log_jump for _, each in found], axis=1).reshape(noises, -1)
        log_known = self.log_determinants + np.linalg.slogdet(own)[1]
        return self.log_prior + self._evidence(square, log_known[:, None], log_normal), square

    def _without_jumps(self, bordered: FloatArray) -> tuple[FloatArray, FloatArray]:
        """N (g, jumps, 1, m, m) of drift, ramp and residuals with the jump solved for at each of its sizes.

        And log det of its part, (g, jumps, 1).
        """
        jump, others = np.flatnonzero(self._amount == DRIFTS), np.flatnonzero(self._amount != DRIFTS)
        order = np.concatenate((jump, others, [bordered.shape[-1] - 1]))
        shares = _shares(self.sizes.jumps)
        scale = np.ones((len(shares), len(order)))
        scale[:, : len(jump)] = shares[:, None]
        root = np.linalg.cholesky(_rescaled(bordered[:, None, order[:, None], order], scale))
        first = len(jump)
        own = np.diagonal(root, axis1=-2, axis2=-1)[..., :first]
        left = np.asarray(root[..., first:, first:] @ np.swapaxes(root[..., first:, first:], -1, -2))
        return left[:, :, None], np.asarray(2.0 * np.log(own).sum(axis=-1)[:, :, None])

    def _of_a_kind(self, left: FloatArray, kind: FloatArray) -> tuple[FloatArray, FloatArray]:
        """S and log det N, each (g, jumps, ramps), of one kind of drift."""
        amount, ramps = self._amount[self._amount != DRIFTS], _shares(self.sizes.ramps)
        share = np.ones(len(self.sizes.largest))
        share[:DRIFTS] = np.divide(kind, self.sizes.largest[:DRIFTS], out=np.zeros(DRIFTS), where=kind > 0.0)
        used = np.flatnonzero(share[amount] > 0.0)
        scale = np.ones((len(ramps), len(used) + 1))
        scale[:, :-1] = np.where(amount[used] > DRIFTS, ramps[:, None], share[amount[used]])
        used = np.concatenate((used, [len(amount)]))
        root = np.linalg.cholesky(_rescaled(left[..., used[:, None], used], scale))
        diagonal = np.diagonal(root, axis1=-2, axis2=-1)
        return diagonal[..., -1] ** 2, 2.0 * np.log(diagonal[..., :-1]).sum(axis=-1)

    def closely(self, noise: NDArray[np.intp], column: NDArray[np.intp], variance: FloatArray) -> Weighed:
        """What some combinations say, (c,), each with its own s^2."""
        k, amounts = self._known, self.sizes.amounts[column]
        root = np.asarray(np.linalg.cholesky(self._bordered(noise, amounts, variance)))
        # The last pivot is r'r - c'N^-1 c without the cancellation.
        diagonal = np.diagonal(root, axis1=-2, axis2=-1)
        square = diagonal[:, -1] ** 2
        log_normal = 2.0 * np.log(diagonal[:, :-1]).sum(axis=-1)
        log_evidence = self._evidence(square, self.log_determinants[noise], log_normal)
        log_evidence += self.log_prior[noise, column]
        fading, fades = np.zeros(len(noise)), (amounts[:, FADING] > 0.0).any(axis=1)
        if fades.any():
            scale = over_noise(amounts[fades], variance[fades])[:, self._amount]
            fading[fades] = self._fades(root[fades], self._fading * scale[:, None])
        # The coordinates are the last columns but one: their part of the factor is that of what is left.
        inverse = np.linalg.inv(root[:, -1 - k : -1, -1 - k : -1])
        shift = -(root[:, -1:, -1 - k : -1] @ inverse)[:, 0]
        own = square / self.freedom
        covariance = own[:, None, None] * (np.swapaxes(inverse, 1, 2) @ inverse)
        return Weighed(log_evidence + fading, np.asarray(shift), covariance, own, fading)

    def with_creep(
        self, noise: NDArray[np.intp], column: NDArray[np.intp], variance: FloatArray, curve: int
    ) -> tuple[FloatArray, FloatArray]:
        """Shifts (c, k + 1) and covariances (c, k + 1, k + 1) of some combinations with this s^2, (c,).

        Last is what the baseline of a curve creeps by, a share of its largest force.
        """
        amounts, first = self.sizes.amounts[column], len(self._amount)
        ramp = int(np.flatnonzero(self._amount == DRIFTS + 1)[curve])
        bordered = self._bordered(noise, amounts, variance)
        wanted = np.append(first + np.arange(self._known), ramp)
        solved = np.linalg.solve(bordered[:, :-1, :-1], np.eye(bordered.shape[1] - 1)[None, :, wanted])
        size = np.ones((len(noise), len(wanted)))
        size[:, -1] = over_noise(amounts, variance)[:, DRIFTS + 1]
        shift = -(bordered[:, -1:, :-1] @ solved)[:, 0] * size
        covariance = variance[:, None, None] * solved[:, wanted]
        return np.asarray(shift), covariance * size[:, :, None] * size[:, None, :]

    def _fades(self, root: FloatArray, along: FloatArray) -> FloatArray:
        """Log of twice the probability that every curve's force fades, and does not grow, (c,).

        `along` (c, curves, m) are the misfits' shares in what has faded at full depth, N = `root` `root`'.
        """
        misfits = along.shape[-1]
        ahead = np.zeros((*along.shape[:2], root.shape[-1] - 1))
        ahead[..., :misfits] = along
        across = np.linalg.solve(root[:, :-1, :-1], np.swapaxes(ahead, 1, 2))
        mean = -(root[:, -1:, :-1] @ across)[:, 0]
        spread = np.linalg.norm(across, axis=1) * root[:, -1, -1:] / self.freedom**0.5
        # Nothing is lost at full depth of a withdrawal that begins there: the sign then tells nothing, even odds.
        z = np.divide(mean, spread, out=np.zeros_like(mean), where=spread > 0.0)
        return np.asarray(np.where(z > -_GROWS, np.log(2.0) + special.log_ndtr(z), -np.inf).sum(axis=-1))

    @cached_property
    def _fading(self) -> FloatArray:
        """Force that has faded at full depth for every column of the misfits, (curves, m)."""
        found = np.zeros((len(self.model.parts), len(self._amount)))
        own = len(self._amount) // len(self.model.parts)
        for number, part in enumerate(self.model.parts):
            amount = self._amount[:own]
            fades = np.flatnonzero((amount >= FADING.start) & (amount < FADING.stop))
            lost = part.drift[np.argmax(np.abs(part.drift[:, 0]))]
            found[number, own * number + fades] = -lost[amount[fades]]
        return found

    def misfits(self, noise: int, column: int, variance: float) -> FloatArray:
        """Best drift, jump and ramp of every curve under one combination, (19 curves,)."""
        amounts, s2 = self.sizes.amounts[[column]], np.array([variance])
        (bordered,) = self._bordered(np.array([noise]), amounts, s2)
        shift = -np.linalg.solve(bordered[:-1, :-1], bordered[:-1, -1])[: len(self._amount)]
        every = acting_columns(np.ones_like(self.sizes.largest), len(self.model.parts))
        found = np.zeros(len(every))
        found[self.sizes.largest[every] > 0.0] = shift * over_noise(amounts, s2)[0, self._amount]
        return found

    def _evidence(
        self, square: FloatArray, log_determinant: FloatArray, log_normal: FloatArray
    ) -> FloatArray:
        variance, degrees = square / self.freedom, self.model.readings - self._known
        total = degrees * np.log(variance) + self.freedom + log_determinant + log_normal
        return np.asarray(-0.5 * total)

    def _bordered(self, noise: NDArray[np.intp], amounts: FloatArray, variance: FloatArray) -> FloatArray:
        """N with c and r'r beside it, (c, m, m), for noises, amounts (c, 10 + 2), s^2 (c,)."""
        scale = over_noise(amounts, variance)[:, self._amount]
        return self.model.bordered(self.products[noise], scale, variance)


def _shares(sizes: Sequence[float]) -> FloatArray:
    """Sizes over the largest of them, none first."""
    return np.array((0.0, *sizes)) / max(sizes, default=1.0)


def _rescaled(bordered: FloatArray, shares: FloatArray) -> FloatArray:
    """N (..., m, m) whose misfits are given shares (..., m) of the size that they have: their prior stays one."""
    found = bordered * (shares[..., :, None] * shares[..., None, :])
    among = np.arange(shares.shape[-1])
    found[..., among, among] += 1.0 - np.square(shares)
    return np.asarray(found)
