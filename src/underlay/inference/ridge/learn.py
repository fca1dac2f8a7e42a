"""Lay a mixture along the ridges of a posterior, try it, mend it, and freeze it.

Weights of the draws that a mixture was learnt from are biased: to low evidence, by 0.02 to 0.1 with four or five
parameters. What is reported comes from draws made after it was frozen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.ridge.budget import Budget, OutOfTimeError
from underlay.inference.ridge.climb import Density, Slice, climb, small_basis
from underlay.inference.ridge.coordinates import FARTHEST, Target, log_normal
from underlay.inference.ridge.march import Node, Ridge, march, march_inside
from underlay.inference.ridge.mixture import Mixture
from underlay.inference.ridge.parts import Part, nodes_of
from underlay.inference.ridge.trial import Trial

__all__ = ["Proposal", "learn"]

# Optima this far below the best one's evidence say nothing; two this near are one; so near a ridge is on it.
_FAR_BELOW, _ONE_PLACE, _ON_RIDGE = 12.0, 1.0, 2.5
# A search begins inside the prior, with room for differences.
_INSIDE = FARTHEST - 2.5
# A place of a scan is looked at if it is farther than this from all that was walked, in standard deviations of
# the prior, and its likelihood is not so far below the best that no ridge passes near it. So many are, and each
# climbs so many steps: onto a ridge, and not yet along it to a top that is known.
_APART, _HOPELESS = 0.3, 25.0
_MOST_PLACES, _ONTO_RIDGE = 8, 12


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
    *,
    places: Sequence[FloatArray] = (),
    parts: Sequence[Part] = (),
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
    places : sequence of FloatArray
        (p,) each: where else a ridge may be, though no optimum is; those on none that was walked are looked at.
    parts : sequence of Part
        Densities that the posterior is a sum of.

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
            if not _is_on(top.place, ridges):
                ridges.append(march(density, top))
        _walk_from_places(density, places, ridges)
    except OutOfTimeError:
        open_end = "the processor time for walking was used up"
    ridges = [ridge for ridge in ridges if ridge.slices]
    if not ridges:
        return None
    own, end = nodes_of(parts, budget)
    ends = [open_end, end, *(ridge.open_end for ridge in ridges)]
    mixture = Mixture.along([*(n for ridge in ridges for n in ridge.nodes), *own])
    # One batch, and without it nothing is known of a mixture: it is drawn whatever the walks have left of the time.
    trial = replace(Trial.of(target, target.coordinates, mixture, rng), density=density)
    try:
        trial = trial.adapted()
        if not trial.is_usable:
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


def _walk_from_places(density: Density, places: Sequence[FloatArray], ridges: list[Ridge]) -> None:
    """Add to `ridges` those above places that lie on none of them.

    A ridge that bends back on itself, or has a second arm behind a saddle, is left by the walk that came first.
    """
    if not (places and any(ridge.slices for ridge in ridges)):
        return
    inside = np.clip(places, -_INSIDE, _INSIDE)
    # A scan knows no prior: of its places the likelihood tells how near they are to what explains the data.
    likelihood = density(inside) - log_normal(inside)
    walked = [entry for ridge in ridges for entry in ridge.slices]
    best = max(entry.log_density - float(log_normal(entry.place)) for entry in walked)
    heaviest = max(entry.log_mass for entry in walked)
    looked = 0
    for row in np.argsort(-likelihood):
        if looked == _MOST_PLACES or not likelihood[row] > best - _HOPELESS:
            return
        known = np.array([entry.place for ridge in ridges for entry in ridge.slices])
        if np.linalg.norm(known - inside[row], axis=1).min() < _APART:
            continue
        looked += 1
        start = climb(density, inside[row], small_basis(inside.shape[1]), max_steps=_ONTO_RIDGE)
        if start is None or start.log_mass < heaviest - _FAR_BELOW or _is_on(start.place, ridges):
            continue
        ridges.append(march(density, start))


def _is_on(place: FloatArray, ridges: Sequence[Ridge]) -> bool:
    """Whether a place is on one of the ridges."""
    return any(_distance(place, node) < _ON_RIDGE for ridge in ridges for node in ridge.nodes)


def _steps(place: FloatArray, top: Slice) -> float:
    """Distance of a place from an optimum, in its standard deviations."""
    return float(np.linalg.norm(np.linalg.solve(top.basis, place - top.place)))


def _distance(place: FloatArray, node: Node) -> float:
    """Distance of a place from a node, in its widths."""
    columns = np.column_stack([node.across, node.along])
    return float(np.linalg.norm(np.linalg.lstsq(columns, place - node.place, rcond=None)[0]))
