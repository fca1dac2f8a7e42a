"""A fit whose noise nobody stated: what the curve says when its residuals may be more than white noise.

The curve is taken in blocks (neighbouring readings of a real instrument shake together, and no noise model of
few numbers holds at full rate), its approach cut to twice the depth of contact (a long quiet approach tells of a
noise that is not the noise in contact). About the white fit all combinations of noise, drift and jump are weighed
(`Competition`), the fit is moved to the optimum of the heaviest, and they are weighed again there, until it stays.
Every optimum that the fit knows of takes part by its own weight.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import special

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.misfit.blocked import Blocked
from underlay.inference.misfit.competition import Competition
from underlay.inference.misfit.descent import Combination, descend
from underlay.inference.misfit.drift import DRIFTS
from underlay.inference.misfit.linearised import Linearised
from underlay.inference.misfit.mixture import Mixture
from underlay.inference.misfit.shapes import JUMPS, ramp_column
from underlay.inference.misfit.sizes import Sizes, shape_parameters
from underlay.inference.misfit.valley import Valley
from underlay.inference.problem import Problem
from underlay.inference.uncertainty.known_errors import KnownError

__all__ = ["Averaged", "average"]

_MOST_PASSES = 4
# Share of the largest force times contact radius from which on a reading is deep, and the chance of as loud a noise
# there below which it is none. Second differences (1, -2, 1) have correlations 1, -2/3, 1/6: 1 + 2 (4/9 + 1/36).
_DEEP, _CHANCE, _KNOWN = 0.5, 1e-3, 1.944
# Probability below which what is taken for granted is given up.
_GIVEN_UP = 0.1
# A shift whose square, what a linear model leaves out, is below this share of a standard deviation is not followed.
_STRAIGHT = 0.2
# Optima nearer than this, in standard deviations, are one; one lighter than this share does not count.
_APART, _LIGHTER = 0.3, 1e-4


class Optimum(NamedTuple):
    """Scaled vector (k,) of an optimum, the model about it, and the weights of the combinations there."""

    vector: FloatArray
    model: Linearised
    competition: Competition


@dataclass(frozen=True)
class Averaged:
    """What a curve says of the parameters, noise and misfit averaged over.

    Parameters
    ----------
    blocked : Blocked
        What was averaged.
    optima : sequence of Optimum
        Scaled vector (k,) of every optimum, the model and the weights about it, heaviest first.
    """

    blocked: Blocked
    optima: Sequence[Optimum]

    @property
    def vector(self) -> FloatArray:
        """Scaled vector of the heaviest combination's optimum, (k,)."""
        return self.optima[0].vector

    @property
    def competition(self) -> Competition:
        """The weights about it."""
        return self.optima[0].competition

    @property
    def model(self) -> Linearised:
        """The model about it."""
        return self.optima[0].model

    @cached_property
    def shares(self) -> FloatArray:
        """Probability of every optimum."""
        totals = np.array([_total(optimum.competition) for optimum in self.optima])
        shares = np.exp(totals - totals.max())
        return np.asarray(shares / shares.sum())

    @cached_property
    def mixture(self) -> Mixture:
        """Distribution of the scaled vector, all optima in it; amplitudes of known errors are left out."""
        parts, k = [optimum.competition.mixture for optimum in self.optima], len(self.vector)
        return Mixture(
            np.concatenate([s * part.weights for s, part in zip(self.shares, parts, strict=True)]),
            np.concatenate(
                [own.vector + part.shift[:, :k] for own, part in zip(self.optima, parts, strict=True)]
            ),
            np.concatenate([part.deviation[:, :k] for part in parts]),
            parts[0].degrees,
        )

    @cached_property
    def valley(self) -> Valley:
        """Profiles under the heaviest combination, every parameter free; raises InputError without a law."""
        free = self.blocked.released()
        combination = Combination.of(self.competition, self.competition.heaviest)
        free = free.standing(self.model, combination.amounts)
        is_known = not self.blocked.held and not any(curve.is_coarse for curve in free.curves)
        model = self.model if is_known else None
        return Valley(free, combination, descend(free, self.vector, combination, model=model))

    @property
    def deviations(self) -> FloatArray:
        """Standard deviations of the scaled vector under the heaviest combination, (k,)."""
        return _deviations(self.competition, self.competition.heaviest)[: len(self.vector)]

    @property
    def left_out(self) -> float:
        """What intervals leave out, over what they are asked to: less where what is taken for granted is given up.

        An interval pays for what it holds where undisturbed curves look like this one, and hardly any do when that
        has lost its weight: sets of least width on those for their coverage in both (Neyman and Pearson) leave out
        less there, in proportion. What is given up is the exact law of a half-space, and where a shape is fitted,
        that anything disturbs the curve.
        """
        sizes = self.competition.sizes
        granted = self.undisturbed if sizes.has_free_shape else self.exact_law
        return min(max(granted / _GIVEN_UP, sizes.least_out), 1.0)

    def inside(self, level: float) -> float:
        """Probability that an interval of this level is given."""
        return 1.0 - self.left_out * (1.0 - level)

    def least_z(self, level: float) -> float:
        """Standard deviations from the optimum to an end, were the heaviest combination the only one."""
        return float(special.stdtrit(self.competition.degrees, 0.5 + 0.5 * level))

    @property
    def drifts(self) -> list[float]:
        """Relative change of the law from contact to the deepest point, one per curve, of the likeliest drift."""
        amounts = self.competition.amounts[self.competition.heaviest]
        acting = amounts[:DRIFTS] > 0.0
        found = []
        for part, own in zip(self.model.parts, self._misfits, strict=True):
            at = int(np.argmax(np.abs(part.grown[:, 1])))
            added = part.force[at] * part.shapes(amounts).drift[at] @ own[:DRIFTS][acting]
            found.append(float(added / (2.0 * part.grown[at, 1])))
        return found

    @property
    def jumps(self) -> list[float]:
        """Force (N) that sets in about contact, one per curve, of the likeliest jump."""
        return [
            float(own[DRIFTS : DRIFTS + JUMPS].sum()) / JUMPS**0.5 * curve.member.scatter
            for own, curve in zip(self._misfits, self.blocked.curves, strict=True)
        ]

    def moved_by(self, index: int, drift: float) -> float:
        """Shift of an entry (scaled) if the law stiffens by the share `drift` to full depth, and nobody knows.

        Linear in depth, as finite strain and a base would.
        """
        model = self.model
        free = [i for i in range(len(self.vector)) if i not in self.blocked.held]
        jacobian = np.vstack([part.jacobian[:, free] for part in model.parts])
        added = np.concatenate([2.0 * drift * part.grown[:, 1] for part in model.parts])
        shift = np.linalg.lstsq(jacobian, added, rcond=None)[0]
        return float(shift[free.index(index)]) if index in free else 0.0

    @property
    def creeps(self) -> list[float]:
        """Creep of the baseline as a share of the largest force, one per curve, of the likeliest ramp."""
        return [float(own[DRIFTS + JUMPS]) for own in self._misfits]

    def creep_at(self, curve: int, time: FloatArray) -> FloatArray:
        """Force (N) at times (s), (n,), of a baseline of one curve that creeps by its largest force."""
        part, scatter = self.model.parts[curve], self.blocked.curves[curve].member.scatter
        return scatter * ramp_column(part.force, part.time, time)[:, 0]

    @property
    def wanders(self) -> list[float]:
        """How far the likeliest correlated noise wanders over the record, as a share of the range of the force.

        The standard deviation of its change from the first reading to the last, one per curve.
        """
        chosen = self.competition.heaviest
        noise = self.competition.noises[self.competition.places[chosen, 0]]
        if noise is None:
            return [0.0] * len(self.blocked.curves)
        tau, share = noise
        white = np.sqrt(self.competition.variance[chosen])
        return [
            float(white * np.sqrt(-2.0 * share * np.expm1((curve.time[0] - curve.time[-1]) / tau)))
            * curve.member.scatter
            / float(np.ptp(curve.force))
            for curve in self.blocked.curves
        ]

    @property
    def _misfits(self) -> list[FloatArray]:
        """Drift, jump and ramp of every curve, of the heaviest combination."""
        return np.split(self.competition.misfits, len(self.blocked.curves))

    @property
    def louder(self) -> float:
        """How many times as loud the noise is deep in contact as before it, at most; 1 where chance may do that.

        By second differences, which leave out what is smooth; n of them know a variance as n / 1.944 readings do.
        """
        found = [1.0]
        for part in self.model.parts:
            rough = np.diff(part.residuals, n=2)
            # P s is nil before contact, and half of its largest at 0.7 of the depth.
            grown = part.grown[1:-1, 0] / np.abs(part.grown[:, 0]).max()
            deep, before = rough[grown > _DEEP], rough[grown == 0.0]
            if len(deep) and before.any():
                ratio = float(np.mean(deep * deep) / np.mean(before * before))
                if special.fdtrc(len(deep) / _KNOWN, len(before) / _KNOWN, ratio) < _CHANCE:
                    found.append(ratio**0.5)
        return max(found)

    @property
    def exact_law(self) -> float:
        """Probability that the law does not drift with depth."""
        return float(self.shares @ [own.competition.exact_law for own in self.optima])

    @property
    def undisturbed(self) -> float:
        """Probability that there is white noise, and nothing else."""
        return float(self.shares @ [own.competition.undisturbed for own in self.optima])

    @property
    def no_jump(self) -> float:
        """Probability that no force sets in at contact beside the law's."""
        return float(self.shares @ [own.competition.no_jump for own in self.optima])

    @property
    def steady(self) -> float:
        """Probability that the noise is white and the baseline does not creep."""
        return float(self.shares @ [own.competition.steady for own in self.optima])


def average(
    problem: Problem,
    vector: FloatArray,
    others: Sequence[FloatArray] = (),
    held: frozenset[int] = frozenset(),
    sizes: Sizes | None = None,
    errors: Sequence[KnownError] = (),
) -> Averaged:
    """Average a fit over what its residuals may be.

    Parameters
    ----------
    problem : Problem
        What was fitted; its noise is of unknown size.
    vector : FloatArray
        Optimum of the fit with white noise, scaled coordinates (k,).
    others : sequence of FloatArray
        Further optima of it, which take part.
    held : frozenset of int
        Entries that stay where they are: on a bound, or without effect on the curve.
    sizes : Sizes, optional
        What is weighed.
    errors : sequence of KnownError
        What the laws leave out, to be allowed for.

    Raises
    ------
    InputError
        If there is no contact law at the vector.
    """
    sizes = sizes or Sizes.of(problem)
    blocked = Blocked.of(problem, vector, held, errors)
    optima = [_settled(blocked, vector, sizes)]
    for other in others:
        # A second optimum may lie at the very end of the laws; the first one then speaks alone.
        with suppress(InputError):
            optima.append(_settled(blocked, other, sizes))
    return Averaged(blocked, _distinct(optima))


def _settled(blocked: Blocked, vector: FloatArray, sizes: Sizes) -> Optimum:
    """Optimum of the heaviest combination, from a start, and the weights about it.

    While its noise is white the grid of noises is the sparse one. Where it is correlated it is the whole one, and
    nothing is followed that the whole one did not choose: under such noise a curve may have several contact points
    to choose from.
    """
    model = blocked.linearised(vector)
    competition = Competition.in_haste(model, sizes)
    followed, grid = competition.is_white, sizes.sparse if competition.is_white else sizes
    for _ in range(_MOST_PASSES):
        moved = _moved(blocked, Optimum(vector, model, competition)) if followed else None
        if moved is None and competition.sizes is grid:
            break
        vector, model = moved or (vector, model)
        competition = Competition.of(model, grid)
        grid = grid if competition.is_white else sizes
        followed = competition.sizes is grid
    return Optimum(vector, model, competition)


def _moved(blocked: Blocked, optimum: Optimum) -> tuple[FloatArray, Linearised] | None:
    """Vector of the heaviest combination's own optimum and the model about it; None where it is near enough."""
    vector, model, competition = optimum
    at, k = competition.heaviest, len(vector)
    shift, deviation = competition.shift[at][:k], _deviations(competition, at)[:k]
    if (shift * shift <= _STRAIGHT * deviation).all():
        return None
    chosen = Combination.of(competition, at)
    stand = blocked.standing(model, chosen.amounts)
    # A valley that bends, as those of a thickness do, is walked to its end: its deviations are no small lengths.
    straight = 0.0 if shape_parameters(blocked.problem) else _STRAIGHT
    ahead = descend(stand, vector, chosen, model=model, straight=straight).vector
    try:
        return ahead, blocked.linearised(ahead)
    except InputError:
        # The last step of a descent is the linear model's, and may end beyond the laws.
        return None


def _deviations(competition: Competition, at: int) -> FloatArray:
    return np.asarray(np.sqrt(np.diagonal(competition.covariance[at])))


def _distinct(optima: Sequence[Optimum]) -> list[Optimum]:
    """Optima that are not one another's, heaviest first."""
    ranked = sorted(optima, key=lambda optimum: -_total(optimum.competition))
    kept: list[Optimum] = []
    for own in ranked:
        if kept and _total(own.competition) < _total(kept[0].competition) + np.log(_LIGHTER):
            break
        deviation = own.competition.mixture.deviation.min(axis=0)[: len(own.vector)]
        if all((np.abs(own.vector - other.vector) > _APART * deviation).any() for other in kept):
            kept.append(own)
    return kept


def _total(competition: Competition) -> float:
    """Logarithm of the evidence of all combinations."""
    top = float(competition.log_evidence.max())
    return top + float(np.log(np.exp(competition.log_evidence - top).sum()))
