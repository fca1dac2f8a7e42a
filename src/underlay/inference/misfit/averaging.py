"""A fit whose noise nobody stated: what the curve says when its residuals may be more than white noise.

The curve is taken in blocks (neighbouring readings of a real instrument shake together, and no noise model of
few numbers holds at full rate), its approach cut to twice the depth of contact (a long quiet approach tells of a
noise that is not the noise in contact). About the white fit all combinations of noise, drift and jump are weighed
(`Competition`), the fit is moved to the optimum of the heaviest, and they are weighed again there, until it stays.
A jump moves the contact point of the white fit: where one is likely, the fit is also begun at other contacts, and
every optimum found takes part by its own weight.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.misfit.competition import Competition
from underlay.inference.misfit.linearised import Linearised, Part, drift_columns, jump_columns
from underlay.inference.misfit.mixture import Mixture
from underlay.inference.misfit.sizes import Sizes
from underlay.inference.model.forward import Forward
from underlay.inference.model.members import Member
from underlay.inference.problem import Problem

__all__ = ["Averaged", "average"]

_CONTACT = "instrument.contact_depth"
_MOST_BLOCKS, _LEAST_IN_CONTACT = 400, 50
# Approach that is used, in depths of contact.
_APPROACH = 2.0
_MOST_PASSES = 3
_MOST_STEPS = 12
# A step below this share of a standard deviation moves no interval.
_SETTLED = 0.02
# Below this probability of no jump other contacts are tried, at these shares of the depth of contact.
_JUMP_LIKELY = 0.5
_CONTACTS = (-0.08, -0.04, 0.04, 0.08)
# Optima nearer than this, in standard deviations, are one; one lighter than this share does not count.
_APART, _LIGHTER = 0.3, 1e-4


@dataclass(frozen=True)
class Averaged:
    """What a curve says of the parameters, noise and misfit averaged over.

    Parameters
    ----------
    optima : sequence of (FloatArray, Competition)
        Scaled vector (k,) of every optimum and the weights about it, heaviest first.
    """

    optima: Sequence[tuple[FloatArray, Competition]]

    @property
    def vector(self) -> FloatArray:
        """Scaled vector of the heaviest combination's optimum, (k,)."""
        return self.optima[0][0]

    @property
    def competition(self) -> Competition:
        """The weights about it."""
        return self.optima[0][1]

    @cached_property
    def shares(self) -> FloatArray:
        """Probability of every optimum."""
        totals = np.array([_total(competition) for _, competition in self.optima])
        shares = np.exp(totals - totals.max())
        return np.asarray(shares / shares.sum())

    @cached_property
    def mixture(self) -> Mixture:
        """Distribution of the scaled vector, all optima in it."""
        parts = [competition.mixture for _, competition in self.optima]
        return Mixture(
            np.concatenate([s * part.weights for s, part in zip(self.shares, parts, strict=True)]),
            np.concatenate([v + part.shift for (v, _), part in zip(self.optima, parts, strict=True)]),
            np.concatenate([part.deviation for part in parts]),
            parts[0].degrees,
        )

    @property
    def exact_law(self) -> float:
        """Probability that the law does not drift with depth."""
        return float(self.shares @ [competition.exact_law for _, competition in self.optima])

    @property
    def no_jump(self) -> float:
        """Probability that no force sets in at contact beside the law's."""
        return float(self.shares @ [competition.no_jump for _, competition in self.optima])

    @property
    def white(self) -> float:
        """Probability that the noise is white."""
        return float(self.shares @ [competition.white for _, competition in self.optima])


def average(problem: Problem, vector: FloatArray, sizes: Sizes | None = None) -> Averaged:
    """Average a fit over what its residuals may be.

    Parameters
    ----------
    problem : Problem
        What was fitted; its noise is of unknown size.
    vector : FloatArray
        Optimum of the fit with white noise, scaled coordinates (k,).
    sizes : Sizes, optional
        What is weighed.

    Raises
    ------
    InputError
        If there is no contact law at the vector.
    """
    sizes = sizes or Sizes()
    blocked = _Blocked.of(problem, vector)
    first = _settled(blocked, vector, sizes)
    optima = [first]
    if first[1].no_jump < _JUMP_LIKELY:
        optima += [_settled(blocked, start, sizes) for start in _other_contacts(problem, blocked, first[0])]
    return Averaged(_distinct(optima))


@dataclass(frozen=True)
class _Blocked:
    """A problem whose curves are taken in blocks."""

    problem: Problem
    curves: list[_BlockedCurve]

    @classmethod
    def of(cls, problem: Problem, vector: FloatArray) -> _Blocked:
        physical = problem.physical(vector)
        return cls(problem, [_BlockedCurve.of(member, physical) for member in problem.members])

    def linearised(self, vector: FloatArray) -> Linearised:
        """Model about a scaled vector (k,); raises InputError where there is no law."""
        physical = self.problem.physical(vector)
        slopes = self.problem.space.slopes(physical)
        precision, pull = np.zeros(len(vector)), np.zeros(len(vector))
        for i, coordinate in enumerate(self.problem.coordinates):
            if coordinate.prior.informative:
                value, slope = coordinate.prior.penalty(float(physical[i]))
                precision[i] = (slope * slopes[i]) ** 2
                pull[i] = value * slope * slopes[i]
        return Linearised([curve.part(physical, slopes) for curve in self.curves], precision, pull)


@dataclass(frozen=True)
class _BlockedCurve:
    """One curve in blocks: its model at their depths, their forces (N) and times (s), each (n,)."""

    member: Member
    forward: Forward
    force: FloatArray
    time: FloatArray

    @classmethod
    def of(cls, member: Member, physical: FloatArray) -> _BlockedCurve:
        curve, contact = member.curve, member.values_at(physical)[_CONTACT]
        deepest = float(curve.depth.max()) - contact
        used = curve.depth >= contact - _APPROACH * deepest
        depth, force = curve.depth[used], curve.force[used]
        time = np.arange(len(curve.depth), dtype=np.float64) if curve.time is None else curve.time
        in_contact = int(np.count_nonzero(depth > contact))
        size = max(1, min(-(-len(depth) // _MOST_BLOCKS), in_contact // _LEAST_IN_CONTACT))
        # Whole blocks from the deep end: what is left over is far before contact.
        start = len(depth) % size

        def means(values: FloatArray) -> FloatArray:
            return np.asarray(values[start:].reshape(-1, size).mean(axis=1))

        forward = replace(member.forward, depth=means(depth))
        return cls(member, forward, means(force), means(time[used]))

    def part(self, physical: FloatArray, slopes: FloatArray) -> Part:
        values = self.member.values_at(physical)
        entries = list(self.member.entries.values())
        reading, own = self.forward.jacobian(values, tuple(self.member.entries), rough=True)
        columns = np.zeros((len(self.force), len(physical)))
        columns[:, entries] = own * slopes[entries]
        depth = self.forward.depth - values[_CONTACT] - values["instrument.compliance"] * reading.contact
        scatter = self.member.scatter
        return Part(
            (reading.force - self.force) / scatter,
            columns / scatter,
            drift_columns(reading.contact, depth),
            jump_columns(depth),
            self.time,
        )


def _settled(blocked: _Blocked, vector: FloatArray, sizes: Sizes) -> tuple[FloatArray, Competition]:
    """Optimum of the heaviest combination, from a start, and the weights about it."""
    competition = Competition.of(blocked.linearised(vector), sizes)
    for _ in range(_MOST_PASSES):
        chosen = competition.heaviest
        vector = _descend(blocked, vector, competition.noises[chosen[0]], sizes.scales_of(chosen[1]))
        competition = Competition.of(blocked.linearised(vector), sizes)
        if competition.heaviest == chosen:
            break
    return vector, competition


def _descend(
    blocked: _Blocked,
    vector: FloatArray,
    noise: tuple[float, float] | None,
    sizes: tuple[float, float],
) -> FloatArray:
    """Optimum of one combination: Levenberg-Marquardt, drift and jump solved for at every step."""
    low, high = blocked.problem.bounds.T
    scale = Sizes.scale(sizes, len(vector), len(blocked.curves))
    here, damping = _place(blocked, vector, noise, scale), 1e-6
    for _ in range(_MOST_STEPS):
        step = here.step(damping)
        target = np.clip(vector + step, low, high)
        try:
            there = _place(blocked, target, noise, scale)
        except InputError:
            there = None
        if there is None or not there.square < here.square:
            if here.gain(target - vector) < _SETTLED**2:
                break
            damping = max(10.0 * damping, 1e-3)
            continue
        settled = here.square - there.square < _SETTLED**2 * here.variance
        vector, here, damping = target, there, 0.1 * damping
        if settled:
            break
    return vector


@dataclass(frozen=True)
class _Place:
    """One combination at one vector: N, c and S, drift and jump solved for, and s^2."""

    normal: FloatArray
    gradient: FloatArray
    square: float
    variance: float

    def step(self, damping: float) -> FloatArray:
        """Damped Gauss-Newton step (k,)."""
        diagonal = np.diag(self.normal)
        return np.asarray(-np.linalg.solve(self.normal + np.diag(damping * diagonal), self.gradient))

    def gain(self, step: FloatArray) -> float:
        """By how much a step should lower S, in s^2."""
        return float(-(2.0 * self.gradient + self.normal @ step) @ step) / self.variance


def _place(
    blocked: _Blocked, vector: FloatArray, noise: tuple[float, float] | None, scale: FloatArray
) -> _Place:
    model = blocked.linearised(vector)
    k = len(vector)
    gram, _ = model.gram(noise)
    gram = gram * np.outer(np.r_[scale, 1.0], np.r_[scale, 1.0])
    misfit = gram[k:-1, k:-1] + np.eye(len(gram) - 1 - k)
    # The Schur complement of drift and jump, residuals and derivatives together.
    kept = np.r_[np.arange(k), -1]
    cross = gram[k:-1][:, kept]
    reduced = gram[np.ix_(kept, kept)] - cross.T @ np.linalg.solve(misfit, cross)
    variance = float(reduced[-1, -1]) / (model.readings - k)
    return _Place(
        reduced[:k, :k] + variance * np.diag(model.precision),
        reduced[:k, -1] + variance * model.pull,
        float(reduced[-1, -1]) + variance * model.offset,
        variance,
    )


def _other_contacts(problem: Problem, blocked: _Blocked, vector: FloatArray) -> list[FloatArray]:
    """Starts with the contact point elsewhere, inside the bounds; none where it is known."""
    physical = problem.physical(vector)
    starts = []
    for share in _CONTACTS:
        moved = np.array(vector)
        for curve in blocked.curves:
            entry = curve.member.entries.get(_CONTACT)
            if entry is not None:
                scale = problem.coordinates[entry].scale or 1.0
                moved[entry] += share * float(curve.forward.depth.max() - physical[entry]) / scale
        low, high = problem.bounds.T
        if (moved != vector).any() and (moved >= low).all() and (moved <= high).all():
            starts.append(moved)
    return starts


def _distinct(
    optima: Sequence[tuple[FloatArray, Competition]],
) -> list[tuple[FloatArray, Competition]]:
    """Optima that are not one another's, heaviest first."""
    ranked = sorted(optima, key=lambda entry: -_total(entry[1]))
    kept: list[tuple[FloatArray, Competition]] = []
    for vector, competition in ranked:
        if kept and _total(competition) < _total(kept[0][1]) + np.log(_LIGHTER):
            break
        deviation = competition.mixture.deviation.min(axis=0)
        if all((np.abs(vector - other) > _APART * deviation).any() for other, _ in kept):
            kept.append((vector, competition))
    return kept


def _total(competition: Competition) -> float:
    """Logarithm of the evidence of all combinations."""
    top = float(competition.log_evidence.max())
    return top + float(np.log(np.exp(competition.log_evidence - top).sum()))
