"""Lay a mixture along the ridges of a posterior, try it, mend it, and freeze it.

Weights of the draws that a mixture was learnt from are biased: to low evidence, by 0.02 to 0.1 with four or five
parameters. What is reported comes from draws made after it was frozen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.ridge.budget import Budget, OutOfTimeError
from underlay.inference.ridge.climb import Density, Slice, climb, small_basis
from underlay.inference.ridge.coordinates import FARTHEST, Target
from underlay.inference.ridge.march import Node, Ridge, march, march_inside
from underlay.inference.ridge.mixture import Mixture
from underlay.inference.ridge.trial import Trial

__all__ = ["Proposal", "learn"]

# Optima this far below the best one's evidence say nothing; two this near are one; so near a ridge is on it.
_FAR_BELOW, _ONE_PLACE, _ON_RIDGE = 12.0, 1.0, 2.5
# Share of components that were known beforehand.
_KNOWN = 0.5
# A search begins inside the prior, with room for differences.
_INSIDE = FARTHEST - 2.5


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
    known: tuple[FloatArray, FloatArray] | None = None,
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
    known : (FloatArray, FloatArray), optional
        Components that look like the posterior: places (m, p) and factors (m, p, p).

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
            if not any(_distance(top.place, node) < _ON_RIDGE for ridge in ridges for node in ridge.nodes):
                ridges.append(march(density, top))
    except OutOfTimeError:
        open_end = "the processor time for walking was used up"
    ridges = [ridge for ridge in ridges if ridge.slices]
    if not ridges:
        return None
    ends = [open_end, *(ridge.open_end for ridge in ridges)]
    mixture = Mixture.along([n for ridge in ridges for n in ridge.nodes])
    if known is not None and len(known[0]):
        mixture = mixture.with_more(*known, _KNOWN)
    trial = Trial.of(density, target.coordinates, mixture, rng)
    try:
        trial = trial.adapted()
        if not trial.is_good:
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


def _steps(place: FloatArray, top: Slice) -> float:
    """Distance of a place from an optimum, in its standard deviations."""
    return float(np.linalg.norm(np.linalg.solve(top.basis, place - top.place)))


def _distance(place: FloatArray, node: Node) -> float:
    """Distance of a place from a node, in its widths."""
    columns = np.column_stack([node.across, node.along])
    return float(np.linalg.norm(np.linalg.lstsq(columns, place - node.place, rcond=None)[0]))
