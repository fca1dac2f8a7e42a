"""Noise, a drifting law, a jump at contact and a creeping baseline, weighed by restricted likelihood.

About the present fit a reading is  F(theta) + Phi u + Z v + t y + e:

- e, white noise of variance s^2 and an Ornstein-Uhlenbeck process on it (`Whitener`);
- Phi u, a law whose relative error grows from nil at contact (`drift.py`), u_j ~ N(0, sigma_drift_j^2) with one
  set of sizes for each kind of drift. They are shares of the force, whatever the noise: laws are wrong by per cents
  on loud curves too. What fades has u such that force has faded at full depth: the evidence is that of the half of
  the prior where it has, and none where the readings say that it grew;
- Z v, a force that sets in near contact (adhesion, drag, a snap): steps about contact and forces that grow
  toward it, v ~ N(0, s^2 sigma_jump^2 / 8);
- t y, a baseline that creeps in proportion to time, y ~ N(0, sigma_ramp^2), a share of the largest force: a line is
  no Ornstein-Uhlenbeck process, which is rough.

With J = dF/dtheta, A = [Phi sigma_drift / s, Z sigma_jump, t sigma_ramp / s], r = F - data, products under V^-1,

    N = [J A]'[J A] + diag(s^2 / sd^2, 1),   c = [J A]'r + ...,   S = r'r - c'N^-1 c,
    -2 log likelihood = (n - k) log s^2 + S / s^2 + log det V + log det N

(restricted maximum likelihood: Harville 1977, doi:10.1080/01621459.1977.10480998; a discrepancy with a prior:
Kennedy and O'Hagan 2001, doi:10.1111/1467-9868.00294), where a measured parameter or a known error has its prior's
sd in N, c and S, and s^2 = S / (n - k + number of those). No test decides which of them is there: every combination
on a grid of sizes and times is weighed, and a parameter's interval is that of the mixture.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.misfit.drift import DRIFTS, FADING
from underlay.inference.misfit.evidence import Evidence
from underlay.inference.misfit.linearised import Linearised
from underlay.inference.misfit.mixture import Mixture
from underlay.inference.misfit.sizes import Sizes

__all__ = ["Competition"]

# Lighter combinations, hundreds of them, weigh together less than one in a thousand.
_LIGHTEST = 1e-6


@dataclass(frozen=True)
class Competition:
    """The weights of the combinations about one present fit, those left out that weigh nothing.

    Parameters
    ----------
    noises : sequence of (tau, g) or None
        Correlated noises; the first is white noise alone.
    sizes : Sizes
        What was weighed.
    places : NDArray
        Number of the noise and of the amounts of drift, jump and ramp of every combination, (c, 2).
    log_evidence : FloatArray
        Logarithm of prior times likelihood, (c,).
    shift : FloatArray
        Best shift of the coordinates and of the amplitudes of known errors, (c, k).
    covariance : FloatArray
        Of coordinates and amplitudes, (c, k, k).
    variance : FloatArray
        s^2 over the scatter of the curves squared, (c,).
    fading : FloatArray
        What the sign of a force that fades adds to log_evidence, (c,); -inf where it would have to grow.
    misfits : FloatArray
        Best drift, jump and ramp of every curve under the heaviest combination, (19 curves,).
    degrees : int
        n - k.
    """

    noises: Sequence[tuple[float, float] | None]
    sizes: Sizes
    places: NDArray[np.intp]
    log_evidence: FloatArray
    shift: FloatArray
    covariance: FloatArray
    variance: FloatArray
    fading: FloatArray
    misfits: FloatArray
    degrees: int

    @classmethod
    def of(cls, model: Linearised, sizes: Sizes, lightest: float = _LIGHTEST) -> Competition:
        """Weigh every combination about a linearised model; those below the share `lightest` are left out."""
        evidence = Evidence.of(model, sizes)
        rough, square = evidence.roughly()
        weights = np.exp(rough - rough.max())
        # Whether what fades does fade is asked closely only; until then all else stays, light as it may seem.
        lasts = ~(sizes.amounts[:, FADING] > 0.0).any(axis=1)
        weights[:, lasts] = np.exp(rough[:, lasts] - rough[:, lasts].max())
        kept = np.argwhere(np.asarray(weights >= lightest * weights.sum()))
        return cls._closely(evidence, kept, square[tuple(kept.T)])

    @classmethod
    def in_haste(cls, model: Linearised, sizes: Sizes) -> Competition:
        """Weigh a few noises alone: which combination is about the heaviest, where the weights do not matter yet.

        A drift is as large as it would be beside the noise that the largest of everything leaves.
        """
        evidence = Evidence.of(model, sizes.in_haste)
        every = np.argwhere(np.isfinite(evidence.log_prior))
        return cls._closely(evidence, every, evidence.least_square[every[:, 0]])

    @classmethod
    def _closely(cls, evidence: Evidence, places: NDArray[np.intp], square: FloatArray) -> Competition:
        """Weigh the combinations at some places (c, 2), whose S is about `square` (c,)."""
        model, (noise, column) = evidence.model, places.T
        variance = square / evidence.freedom
        found = evidence.closely(noise, column, variance)
        best = int(np.argmax(found.log_evidence))
        misfits = evidence.misfits(noise[best], column[best], variance[best])
        degrees = model.readings - len(model.precision)
        return cls(evidence.noises, evidence.sizes, places, *found, misfits, degrees)

    @cached_property
    def weights(self) -> FloatArray:
        """Posterior probability of every combination, (c,)."""
        weights = np.exp(self.log_evidence - self.log_evidence.max())
        return np.asarray(weights / weights.sum())

    @cached_property
    def heaviest(self) -> int:
        """The combination with the largest weight."""
        return int(np.argmax(self.weights))

    @cached_property
    def amounts(self) -> FloatArray:
        """Sizes of drift, jump and ramp of every combination, (c, 10 + 2)."""
        return np.asarray(self.sizes.amounts[self.places[:, 1]])

    @property
    def is_white(self) -> bool:
        """Whether the noise of the heaviest combination is white."""
        return bool(self.places[self.heaviest, 0] == 0)

    @property
    def white(self) -> float:
        """Probability that the noise is white."""
        return float(self.weights[self.places[:, 0] == 0].sum())

    @property
    def exact_law(self) -> float:
        """Probability that the law does not drift."""
        return float(self.weights[(self.amounts[:, :DRIFTS] == 0.0).all(axis=1)].sum())

    @property
    def undisturbed(self) -> float:
        """Probability that there is white noise, and nothing else."""
        return float(self.weights[(self.places[:, 0] == 0) & (self.amounts == 0.0).all(axis=1)].sum())

    @property
    def no_jump(self) -> float:
        """Probability that the force does not jump at contact."""
        return float(self.weights[self.amounts[:, DRIFTS] == 0.0].sum())

    @property
    def level(self) -> float:
        """Probability that the baseline does not creep."""
        return float(self.weights[self.amounts[:, DRIFTS + 1] == 0.0].sum())

    @property
    def steady(self) -> float:
        """Probability that the noise is white and the baseline does not creep."""
        return float(self.weights[(self.places[:, 0] == 0) & (self.amounts[:, DRIFTS + 1] == 0.0)].sum())

    def with_creep(self, model: Linearised, curve: int) -> tuple[FloatArray, FloatArray]:
        """Shifts (c, k + 1) and covariances (c, k + 1, k + 1), the creep of one curve's baseline behind the others.

        `model` is the one that was weighed; the creep is a share of the curve's largest force.
        """
        noise, column = self.places.T
        return Evidence.of(model, self.sizes).with_creep(noise, column, self.variance, curve)

    @property
    def mixture(self) -> Mixture:
        """Distribution of coordinates and amplitudes, the combinations averaged by their weights."""
        variances = np.diagonal(self.covariance, axis1=-2, axis2=-1)
        return Mixture(self.weights, self.shift, np.sqrt(variances), self.degrees)
